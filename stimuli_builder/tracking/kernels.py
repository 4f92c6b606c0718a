"""Compiled loops of the coupled AAM: place, sample, compose, accumulate, solve (docs/tracking.md).

float32 over pixels, float64 over parameters. Everything that calls each other stays in this file.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: D103

from typing import Any, NamedTuple

import numpy as np

from stimuli_builder.compiled import compiled

BLOCK = 512


@compiled
def posed_vertices(base, modes, c, pose, out):
    """Vertices of parameters c under a similarity: base (V, 2), modes (l, V, 2), out float32 (V, 2)."""
    for v in range(base.shape[0]):
        x = base[v, 0]
        y = base[v, 1]
        for i in range(c.shape[0]):
            x += c[i] * modes[i, v, 0]
            y += c[i] * modes[i, v, 1]
        out[v, 0] = pose[0] * x - pose[1] * y + pose[2]
        out[v, 1] = pose[1] * x + pose[0] * y + pose[3]


@compiled
def sample(picture, vertices, triangles, starts, forms, px, py, out):
    """Piecewise affine warp: bilinear samples of `picture` (uint8) at every base pixel.

    Outside the picture its edge is repeated.
    """
    height, width = picture.shape
    right = np.float32(width - 1.001)
    bottom = np.float32(height - 1.001)
    zero = np.float32(0)
    for t in range(triangles.shape[0]):
        ax = zero
        bx = zero
        cx = zero
        ay = zero
        by = zero
        cy = zero
        for k in range(3):
            vx = vertices[triangles[t, k], 0]
            vy = vertices[triangles[t, k], 1]
            ax += vx * forms[t, k, 0]
            bx += vx * forms[t, k, 1]
            cx += vx * forms[t, k, 2]
            ay += vy * forms[t, k, 0]
            by += vy * forms[t, k, 1]
            cy += vy * forms[t, k, 2]
        xs = px[starts[t] : starts[t + 1]]
        ys = py[starts[t] : starts[t + 1]]
        outs = out[starts[t] : starts[t + 1]]
        for i in range(xs.shape[0]):
            x = min(max(ax * xs[i] + bx * ys[i] + cx, zero), right)
            y = min(max(ay * xs[i] + by * ys[i] + cy, zero), bottom)
            column = np.uint32(np.int32(x))
            row = np.uint32(np.int32(y))
            below = row + np.uint32(1)
            beside = column + np.uint32(1)
            fx = x - np.float32(np.int32(x))
            fy = y - np.float32(np.int32(y))
            p00 = np.float32(picture[row, column])
            p01 = np.float32(picture[row, beside])
            p10 = np.float32(picture[below, column])
            p11 = np.float32(picture[below, beside])
            top = p00 + fx * (p01 - p00)
            outs[i] = top + fy * (p10 + fx * (p11 - p10) - top)


@compiled
def compose(modes, c, first, last, out):
    """out[x] = modes[0, x] + sum_i c[i] modes[i + 1, x] for first <= x < last; modes float32 (l + 1, N)."""
    count = c.shape[0]
    part = out[first:last]
    part[:] = modes[0, first:last]
    i = 0
    while i + 4 <= count:
        w0, w1, w2, w3 = np.float32(c[i]), np.float32(c[i + 1]), np.float32(c[i + 2]), np.float32(c[i + 3])
        m0 = modes[i + 1, first:last]
        m1 = modes[i + 2, first:last]
        m2 = modes[i + 3, first:last]
        m3 = modes[i + 4, first:last]
        for x in range(part.shape[0]):
            part[x] += (w0 * m0[x] + w1 * m1[x]) + (w2 * m2[x] + w3 * m3[x])
        i += 4
    while i < count:
        w0 = np.float32(c[i])
        m0 = modes[i + 1, first:last]
        for x in range(part.shape[0]):
            part[x] += w0 * m0[x]
        i += 1


@compiled
def differentiate(values, left, right, above, below, gx, gy):
    """Central differences of values (N,) along x and y; neighbours are pixel numbers, uint32 (N,)."""
    half = np.float32(0.5)
    for x in range(values.shape[0]):
        gx[x] = half * (values[right[x]] - values[left[x]])
        gy[x] = half * (values[below[x]] - values[above[x]])


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
        for k in range(3):
            v = triangles[t, k]
            out[v, 0] += forms[t, k, 0] * sxx + forms[t, k, 1] * sxy + forms[t, k, 2] * sx
            out[v, 1] += forms[t, k, 0] * syx + forms[t, k, 1] * syy + forms[t, k, 2] * sy


@compiled
def dot(a, b):
    total = np.float32(0)
    for x in range(a.shape[0]):
        total += a[x] * b[x]
    return total


@compiled
def right_side(c, appearance, directions, error, vertex_sums, out):
    """out = SD^T E: the appearance part over pixels, minus the warp part over vertices (K,)."""
    count = c.shape[0]
    for k in range(out.shape[0]):
        total = 0.0
        for v in range(vertex_sums.shape[0]):
            total += directions[k, v, 0] * vertex_sums[v, 0] + directions[k, v, 1] * vertex_sums[v, 1]
        out[k] = -total
    for k in range(count):
        out[k] += dot(appearance[k + 1], error)


@compiled
def hessian(forms, c, out):
    """Quadratic form of (1, c): forms float64 (pairs, K, K), lower triangles filled; out (K, K)."""
    count = c.shape[0] + 1
    size = out.shape[0]
    out[:] = 0.0
    pair = 0
    for i in range(count):
        ci = 1.0 if i == 0 else c[i - 1]
        for j in range(i, count):
            weight = ci * (1.0 if j == 0 else c[j - 1])
            for row in range(size):
                for column in range(row + 1):
                    out[row, column] += weight * forms[pair, row, column]
            pair += 1


@compiled
def solve(matrix, right):
    """Solve matrix x = right in place by Cholesky, lower triangle given; False if not positive definite."""
    size = right.shape[0]
    for j in range(size):
        diagonal = matrix[j, j]
        for k in range(j):
            diagonal -= matrix[j, k] * matrix[j, k]
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


@compiled
def step(c, pose, change, limits, scales, centre):
    """Additive step in c, kept within +-limits; similarity composed in the base frame, in place."""
    count = c.shape[0]
    for i in range(count):
        c[i] = min(max(c[i] - change[i], -limits[i]), limits[i])
    a = 1.0 - change[count] / scales[0]
    b = -change[count + 1] / scales[1]
    tx = centre[0] - (a * centre[0] - b * centre[1]) - change[count + 2] / scales[2]
    ty = centre[1] - (b * centre[0] + a * centre[1]) - change[count + 3] / scales[3]
    p, q, u, w = pose[0], pose[1], pose[2], pose[3]
    pose[0] = p * a - q * b
    pose[1] = q * a + p * b
    pose[2] = p * tx - q * ty + u
    pose[3] = q * tx + p * ty + w


@compiled
def squares_by_eye(error, weights, starts, eye_of, out):
    """Weighted mean square error of each eye, out (eyes,); `error` comes already times the weights."""
    counts = np.zeros(out.shape[0])
    out[:] = 0.0
    for t in range(eye_of.shape[0]):
        for i in range(starts[t], starts[t + 1]):
            out[eye_of[t]] += error[i] * error[i] / weights[i]
            counts[eye_of[t]] += weights[i]
    for eye in range(out.shape[0]):
        out[eye] /= counts[eye]


class MeshArrays(NamedTuple):
    """The base mesh of V vertices and N pixels.

    Attributes
    ----------
    vertices : float64 array (V, 2)
    triangles : int array (T, 3)
    starts : int array (T + 1,)
        First pixel of each triangle.
    forms : float32 array (T, 3, 3)
        Barycentric coordinates as linear forms in (x, y, 1).
    x, y : float32 array (N,)
        Pixel positions.
    eye_of : int array (T,)
    left, right, above, below : uint32 array (N,)
        Neighbours of each pixel.
    """

    vertices: Any
    triangles: Any
    starts: Any
    forms: Any
    x: Any
    y: Any
    eye_of: Any
    left: Any
    right: Any
    above: Any
    below: Any


class ModelArrays(NamedTuple):
    """What the fit needs of a model of l coupled parameters, K = l + 4.

    Attributes
    ----------
    shape_modes : float64 array (l, V, 2)
    appearance : float32 array (l + 1, N)
    weights : float32 array (N,)
    hessian_forms : float64 array (pairs, K, K)
    directions : float64 array (K, V, 2)
    prior, limits : float64 array (l,)
    scales : float64 array (4,)
    centre : float64 array (2,)
    """

    shape_modes: Any
    appearance: Any
    weights: Any
    hessian_forms: Any
    directions: Any
    prior: Any
    limits: Any
    scales: Any
    centre: Any


class Buffers(NamedTuple):
    """Written by every fit: float32 (N,) four times, float32 (V, 2), and float64 (eyes,)."""

    sampled: Any
    error: Any
    gx: Any
    gy: Any
    vertices: Any
    squares: Any


@compiled
def fit(picture, c, pose, max_iterations, tolerance, mesh, model, buffers):
    """Gauss-Newton on c and the similarity, in place; return the iterations used, 0 if it broke down.

    Stops when no vertex moves by more than `tolerance` pixels. The buffers' `vertices` and `squares` (mean
    square error by eye) are left as of the last step and the last evaluation.
    """
    size = c.shape[0] + 4
    sampled, error, vertices = buffers.sampled, buffers.error, buffers.vertices
    gx, gy = buffers.gx, buffers.gy
    weights = model.weights
    count = error.shape[0]
    before = np.empty_like(vertices)
    sums = np.empty_like(vertices)
    change = np.empty(size)
    matrix = np.empty((size, size))
    posed_vertices(mesh.vertices, model.shape_modes, c, pose, vertices)
    iteration = 0
    while iteration < max_iterations:
        iteration += 1
        sample(picture, vertices, mesh.triangles, mesh.starts, mesh.forms, mesh.x, mesh.y, sampled)
        first = 0
        while first < count:
            last = min(first + BLOCK, count)
            compose(model.appearance, c, first, last, error)
            first = last
        differentiate(error, mesh.left, mesh.right, mesh.above, mesh.below, gx, gy)
        for x in range(count):
            error[x] = weights[x] * (error[x] - sampled[x])
        accumulate(error, gx, gy, mesh.triangles, mesh.starts, mesh.forms, mesh.x, mesh.y, sums)
        right_side(c, model.appearance, model.directions, error, sums, change)
        hessian(model.hessian_forms, c, matrix)
        for k in range(c.shape[0]):
            matrix[k, k] += model.prior[k]
            change[k] += model.prior[k] * c[k]
        if not solve(matrix, change):
            return 0
        step(c, pose, change, model.limits, model.scales, model.centre)
        before[:] = vertices
        posed_vertices(mesh.vertices, model.shape_modes, c, pose, vertices)
        furthest = np.float32(0)
        for v in range(vertices.shape[0]):
            furthest = max(furthest, abs(vertices[v, 0] - before[v, 0]), abs(vertices[v, 1] - before[v, 1]))
        if not furthest < 1e6:
            return 0
        if furthest < tolerance:
            break
    squares_by_eye(error, weights, mesh.starts, mesh.eye_of, buffers.squares)
    return iteration
