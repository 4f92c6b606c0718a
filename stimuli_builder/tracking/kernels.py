"""Compiled loops of the coupled AAM: compose, compare, step and fit (docs/explanation/tracking.md).

float32 over pixels, float64 over parameters. `fit` also calls the loops that sample.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import numpy as np

from stimuli_builder.compiled import compiled, compiled_over
from stimuli_builder.tracking import sampling_kernels
from stimuli_builder.tracking.sampling_kernels import (
    BLOCK,
    bounds,
    look_up,
    outside,
    pack_pixels,
    posed_vertices,
    warp,
)

MARGIN = 6
"""Pixels around the mesh that are packed with it, so that steps of a fit need no new packing."""


# The normal equations of one step: right side, the Hessian from its forms, and Cholesky.


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


# Compose, compare, step and fit.


@compiled
def compose(modes, c, first, last, out):
    """out[x] = modes[0, x] + sum_i c[i] modes[i + 1, x] for first <= x < last; modes float32 (l + 1, N)."""
    count = c.shape[0]
    part = out[first:last]
    part[:] = modes[0, first:last]
    i = 0
    # Four modes in one pass, so that the output is read and written a quarter as often.
    while i + 4 <= count:
        w0, w1, w2, w3 = np.float32(c[i]), np.float32(c[i + 1]), np.float32(c[i + 2]), np.float32(c[i + 3])
        m0 = modes[i + 1, first:last]
        m1 = modes[i + 2, first:last]
        m2 = modes[i + 3, first:last]
        m3 = modes[i + 4, first:last]
        for x in range(part.shape[0]):
            part[x] += (w0 * m0[x] + w1 * m1[x]) + (w2 * m2[x] + w3 * m3[x])
        i += 4
    while i + 2 <= count:
        w0, w1 = np.float32(c[i]), np.float32(c[i + 1])
        m0 = modes[i + 1, first:last]
        m1 = modes[i + 2, first:last]
        for x in range(part.shape[0]):
            part[x] += w0 * m0[x] + w1 * m1[x]
        i += 2
    while i < count:
        w0 = np.float32(c[i])
        m0 = modes[i + 1, first:last]
        for x in range(part.shape[0]):
            part[x] += w0 * m0[x]
        i += 1


@compiled
def differentiate(values, left, right, above, below, gx, gy):
    """Central differences of values (N,) along x and y; neighbors are pixel numbers, uint32 (N,)."""
    half = np.float32(0.5)
    for x in range(values.shape[0]):
        gx[x] = half * (values[right[x]] - values[left[x]])
        gy[x] = half * (values[below[x]] - values[above[x]])


@compiled_over(sampling_kernels)
def compare(appearance, weights, c, sampled, look, error, out):
    """Look of parameters c, its weighted error, and the error's appearance part of SD^T E into out (K,).

    Block by block, so that the modes are read from the nearest cache the second time.
    """
    out[:] = 0.0
    first = 0
    while first < sampled.shape[0]:
        last = min(first + BLOCK, sampled.shape[0])
        compose(appearance, c, first, last, look)
        looks, samples = look[first:last], sampled[first:last]
        errors, counted = error[first:last], weights[first:last]
        for x in range(errors.shape[0]):
            # Model minus picture, weighted once here: `project` and `accumulate` need only this product.
            errors[x] = counted[x] * (looks[x] - samples[x])
        project(appearance, error, first, last, out)
        first = last


@compiled
def step(c, pose, change, limits, scales, centre):
    """Additive step in c, kept within +-limits; similarity composed in the base frame, in place."""
    count = c.shape[0]
    for i in range(count):
        # Held within the limits at every step: a fit that once left them draws a shape from which no
        # gradient leads back.
        c[i] = min(max(c[i] - change[i], -limits[i]), limits[i])
    # By the norms, as `similarity_directions` gives unit movements.
    a = 1.0 - change[count] / scales[0]
    b = -change[count + 1] / scales[1]
    tx = centre[0] - (a * centre[0] - b * centre[1]) - change[count + 2] / scales[2]
    ty = centre[1] - (b * centre[0] + a * centre[1]) - change[count + 3] / scales[3]
    p, q, u, w = pose[0], pose[1], pose[2], pose[3]
    # Composed, not added: the steepest-descent images are those of the base frame.
    pose[0] = p * a - q * b
    pose[1] = q * a + p * b
    pose[2] = p * tx - q * ty + u
    pose[3] = q * tx + p * ty + w


@compiled
def squares_by_eye(error, shares, ends, out):
    """Weighted mean square error of each eye, out (eyes,); `error` comes already times the weights.

    Eye e has the pixels up to ends[e]; shares (N,) are 1 / (weight times the sum of the eye's weights).
    """
    first = 0
    for eye in range(out.shape[0]):
        errors = error[first : ends[eye]]
        parts = shares[first : ends[eye]]
        total = np.float32(0)
        for i in range(errors.shape[0]):
            total += errors[i] * errors[i] * parts[i]
        out[eye] = total
        first = ends[eye]


@compiled
def moved_by(vertices, before):
    """Greatest movement of a vertex along x or y; infinite where a number is not finite."""
    furthest = np.float32(0)
    for v in range(vertices.shape[0]):
        for axis in range(2):
            distance = abs(vertices[v, axis] - before[v, axis])
            # NaN included: a comparison with it is false.
            if not distance < np.float32(1e6):
                return np.float32(np.inf)
            furthest = max(furthest, distance)
    return furthest


@compiled_over(sampling_kernels)
def fit(picture, c, pose, max_iterations, tolerance, mesh, model, buffers):
    """Gauss-Newton on c and the similarity, in place; return the iterations used, 0 if it broke down.

    Stops when no vertex moves by more than `tolerance` pixels. The buffers' `vertices` and `squares` (mean
    square error by eye) are left as of the last step and the last evaluation.
    """
    height, width = picture.shape
    size = c.shape[0] + 4
    error, vertices = buffers.error, buffers.vertices
    before = np.empty_like(vertices)
    sums = np.empty_like(vertices)
    change = np.empty(size)
    matrix = np.empty((size, size))
    posed_vertices(mesh.vertices, model.shape_modes, c, pose, vertices)
    box = np.zeros(4, np.int64)
    needed = np.empty(4, np.int64)
    cells = np.empty((0, 0), np.int32)
    iteration = 0
    while iteration < max_iterations:
        iteration += 1
        bounds(vertices, height, width, 1, needed)
        # Packing costs as much as an iteration; within MARGIN the mesh moves without it.
        if outside(needed, box):
            bounds(vertices, height, width, MARGIN, box)
            cells = pack_pixels(picture, box)
        warp(vertices, mesh.triangles, mesh.starts, mesh.forms, mesh.x, mesh.y, buffers.gx, buffers.gy)
        look_up(cells, box, height, width, buffers.gx, buffers.gy, buffers.sampled)
        compare(model.appearance, model.weights, c, buffers.sampled, buffers.look, error, change)
        differentiate(buffers.look, mesh.left, mesh.right, mesh.above, mesh.below, buffers.gx, buffers.gy)
        accumulate(
            error, buffers.gx, buffers.gy, mesh.triangles, mesh.starts, mesh.forms, mesh.x, mesh.y, sums
        )
        subtract_warp(model.directions, sums, change)
        hessian(model.hessian_forms, c, matrix)
        for k in range(c.shape[0]):
            matrix[k, k] += model.prior[k]
            # The gradient of the prior's penalty, prior c^2 / 2; its Hessian is on the diagonal.
            change[k] += model.prior[k] * c[k]
        if not solve(matrix, change):
            return 0
        step(c, pose, change, model.limits, model.scales, model.centre)
        before[:] = vertices
        posed_vertices(mesh.vertices, model.shape_modes, c, pose, vertices)
        furthest = moved_by(vertices, before)
        # Infinite where a number is not finite: the fit has broken down.
        if not furthest < 1e6:
            return 0
        if furthest < tolerance:
            break
    squares_by_eye(error, model.shares, mesh.ends, buffers.squares)
    return iteration
