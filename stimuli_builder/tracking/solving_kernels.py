"""Compiled loops of the normal equations of one step: right side, the Hessian from its forms, and Cholesky.

float32 over pixels, float64 over parameters.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import numpy as np

from stimuli_builder.compiled import compiled


@compiled
def accumulate(error, gx, gy, triangles, starts, forms, px, py, out):
    """Add error x gradient into the mesh vertices: out[v] = sum_x b_v(x) error(x) gradient(x)."""
    zero = np.float32(0)
    out[:] = zero
    for t in range(triangles.shape[0]):
        sx = zero
        sxx = zero
        sxy = zero
        sy = zero
        syx = zero
        syy = zero
        xs = px[starts[t] : starts[t + 1]]
        ys = py[starts[t] : starts[t + 1]]
        errors = error[starts[t] : starts[t + 1]]
        along_x = gx[starts[t] : starts[t + 1]]
        along_y = gy[starts[t] : starts[t + 1]]
        for i in range(xs.shape[0]):
            ex = errors[i] * along_x[i]
            ey = errors[i] * along_y[i]
            sx += ex
            sxx += ex * xs[i]
            sxy += ex * ys[i]
            sy += ey
            syx += ey * xs[i]
            syy += ey * ys[i]
        # The forms are linear in (x, y, 1), so that three sums per axis replace the triangle's pixels.
        for k in range(3):
            v = triangles[t, k]
            out[v, 0] += forms[t, k, 0] * sxx + forms[t, k, 1] * sxy + forms[t, k, 2] * sx
            out[v, 1] += forms[t, k, 0] * syx + forms[t, k, 1] * syy + forms[t, k, 2] * sy


@compiled
def project(modes, error, first, last, out):
    """Add the appearance part of SD^T E over pixels first <= x < last: out[i] += modes[i + 1] . error."""
    count = modes.shape[0] - 1
    part = error[first:last]
    i = 0
    # Four modes at a time, so that every error is read once for four sums.
    while i + 4 <= count:
        m0 = modes[i + 1, first:last]
        m1 = modes[i + 2, first:last]
        m2 = modes[i + 3, first:last]
        m3 = modes[i + 4, first:last]
        s0 = s1 = s2 = s3 = np.float32(0)
        for x in range(part.shape[0]):
            s0 += m0[x] * part[x]
            s1 += m1[x] * part[x]
            s2 += m2[x] * part[x]
            s3 += m3[x] * part[x]
        out[i] += s0
        out[i + 1] += s1
        out[i + 2] += s2
        out[i + 3] += s3
        i += 4
    while i < count:
        m0 = modes[i + 1, first:last]
        s0 = np.float32(0)
        for x in range(part.shape[0]):
            s0 += m0[x] * part[x]
        out[i] += s0
        i += 1


@compiled
def subtract_warp(directions, vertex_sums, out):
    """Subtract the warp part of SD^T E, over vertices, from out (K,)."""
    for k in range(out.shape[0]):
        total = 0.0
        for v in range(vertex_sums.shape[0]):
            total += directions[k, v, 0] * vertex_sums[v, 0] + directions[k, v, 1] * vertex_sums[v, 1]
        out[k] -= total


@compiled
def quadratic(forms, c, out):
    """out (M,) = sum over pairs i <= j of c_i c_j forms (pairs, M), with c_0 = 1."""
    pairs = forms.shape[0]
    weights = np.empty(pairs)
    pair = 0
    for i in range(c.shape[0] + 1):
        for j in range(i, c.shape[0] + 1):
            weights[pair] = (1.0 if i == 0 else c[i - 1]) * (1.0 if j == 0 else c[j - 1])
            pair += 1
    out[:] = 0.0
    pair = 0
    while pair + 4 <= pairs:
        w0, w1, w2, w3 = weights[pair], weights[pair + 1], weights[pair + 2], weights[pair + 3]
        f0, f1, f2, f3 = forms[pair], forms[pair + 1], forms[pair + 2], forms[pair + 3]
        for x in range(out.shape[0]):
            out[x] += (w0 * f0[x] + w1 * f1[x]) + (w2 * f2[x] + w3 * f3[x])
        pair += 4
    while pair < pairs:
        f0, w0 = forms[pair], weights[pair]
        for x in range(out.shape[0]):
            out[x] += w0 * f0[x]
        pair += 1


@compiled
def hessian(forms, c, out):
    """Lower triangle of the Hessian (K, K) at c, from forms float64 (pairs, K (K + 1) / 2)."""
    flat = np.empty(forms.shape[1])
    quadratic(forms, c, flat)
    entry = 0
    for row in range(out.shape[0]):
        for column in range(row + 1):
            out[row, column] = flat[entry]
            entry += 1


@compiled
def solve(matrix, right):
    """Solve matrix x = right in place by Cholesky, lower triangle given; False if not positive definite."""
    size = right.shape[0]
    for j in range(size):
        diagonal = matrix[j, j]
        for k in range(j):
            diagonal -= matrix[j, k] * matrix[j, k]
        # Written so that NaN fails too.
        if not diagonal > 0.0:
            return False
        root = np.sqrt(diagonal)
        matrix[j, j] = root
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / root
    for i in range(size):
        value = right[i]
        for k in range(i):
            value -= matrix[i, k] * right[k]
        right[i] = value / matrix[i, i]
    for i in range(size - 1, -1, -1):
        value = right[i]
        for k in range(i + 1, size):
            value -= matrix[k, i] * right[k]
        right[i] = value / matrix[i, i]
    return True
