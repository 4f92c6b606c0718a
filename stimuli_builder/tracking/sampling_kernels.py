"""Compiled loops that place the mesh in a picture and sample it there: float32, four pixels per look-up."""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled

BLOCK = 512
"""Pixels worked on at a time: with the modes of a model they stay in the nearest cache."""


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
def bounds(vertices, height, width, margin, out):
    """Rows out[0] to out[1] and columns out[2] to out[3] (ends left out) of cells that samples may need.

    A cell is named by its upper left pixel; the mesh's box is widened by `margin` and cut at the picture.
    """
    for axis in range(2):
        low = vertices[0, 1 - axis]
        high = low
        for v in range(vertices.shape[0]):
            low = min(low, vertices[v, 1 - axis])
            high = max(high, vertices[v, 1 - axis])
        cells = (height if axis == 0 else width) - 1
        # Within the picture even where the mesh has left it: a box is never empty.
        first = min(max(int(low) - margin, 0), cells - 1)
        out[2 * axis] = first
        out[2 * axis + 1] = min(max(int(high) + 1 + margin, first + 1), cells)


@compiled
def outside(needed, box):
    """Whether a box of cells reaches out of another one."""
    return needed[0] < box[0] or needed[1] > box[1] or needed[2] < box[2] or needed[3] > box[3]


@compiled
def pack_pixels(picture, box):
    """Four pixels of every cell of a box in one number, int32: one look-up per sample instead of four."""
    cells = np.empty((box[1] - box[0], box[3] - box[2]), np.int32)
    for row in range(cells.shape[0]):
        above = picture[box[0] + row, box[2] : box[3] + 1]
        below = picture[box[0] + row + 1, box[2] : box[3] + 1]
        line = cells[row]
        for x in range(line.shape[0]):
            # Neighbors side by side in one word: a sample then touches memory once, not in two rows.
            upper = np.uint32(above[x]) | (np.uint32(above[x + 1]) << np.uint32(8))
            lower = np.uint32(below[x]) | (np.uint32(below[x + 1]) << np.uint32(8))
            line[x] = np.int32(upper | (lower << np.uint32(16)))
    return cells


@compiled
def warp(vertices, triangles, starts, forms, px, py, out_x, out_y):
    """Piecewise affine warp: where every base pixel lies in the picture."""
    zero = np.float32(0)
    for t in range(triangles.shape[0]):
        ax = zero
        bx = zero
        cx = zero
        ay = zero
        by = zero
        cy = zero
        # The affine map of the triangle, from its corners' places: one product per pixel and axis follows.
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
        xs_out = out_x[starts[t] : starts[t + 1]]
        ys_out = out_y[starts[t] : starts[t + 1]]
        for i in range(xs.shape[0]):
            xs_out[i] = ax * xs[i] + bx * ys[i] + cx
            ys_out[i] = ay * xs[i] + by * ys[i] + cy


@compiled
def locate(xs, ys, box, height, width, out):
    """Cell of each position in the box, int32, into `out`; positions become fractions of a cell in place.

    Three plain loops (this, the look-up, `blend`) so that the outer two are vectors: 9 us instead of 28.
    """
    left = np.float32(box[2])
    top = np.float32(box[0])
    # A thousandth inside the last cell, so that its number, cut to a whole one, is still that of a cell.
    right = min(np.float32(width - 1.001), np.float32(box[3] - 0.001))
    bottom = min(np.float32(height - 1.001), np.float32(box[1] - 0.001))
    stride = np.int32(box[3] - box[2])
    first_column = np.int32(box[2])
    first_row = np.int32(box[0])
    for i in range(xs.shape[0]):
        # Written so that NaN becomes the edge: no look-up outside the box.
        x = xs[i] if xs[i] > left else left
        y = ys[i] if ys[i] > top else top
        x = x if x < right else right
        y = y if y < bottom else bottom
        column = np.int32(x)
        row = np.int32(y)
        xs[i] = x - np.float32(column)
        ys[i] = y - np.float32(row)
        out[i] = np.int32((row - first_row) * stride + (column - first_column))


@compiled
def blend(cells, xs, ys, out):
    """Bilinear values of packed cells at fractions of a cell."""
    byte = np.int32(255)
    for i in range(cells.shape[0]):
        cell = cells[i]
        p00 = np.float32(cell & byte)
        p01 = np.float32((cell >> np.int32(8)) & byte)
        p10 = np.float32((cell >> np.int32(16)) & byte)
        p11 = np.float32((cell >> np.int32(24)) & byte)
        # Three products in place of the four of weights.
        upper = p00 + xs[i] * (p01 - p00)
        out[i] = upper + ys[i] * (p10 + xs[i] * (p11 - p10) - upper)


@compiled
def look_up(cells, box, height, width, xs, ys, out):
    """Bilinear samples at positions (spoilt by it); outside the picture its edge is repeated."""
    flat = cells.reshape(-1)
    numbers = np.empty(BLOCK, np.int32)
    first = 0
    while first < out.shape[0]:
        last = min(first + BLOCK, out.shape[0])
        block = numbers[: last - first]
        locate(xs[first:last], ys[first:last], box, height, width, block)
        for i in range(block.shape[0]):
            # Unsigned: the compiler then leaves out the test for numbers that count from the end.
            block[i] = flat[np.uint32(block[i])]
        blend(block, xs[first:last], ys[first:last], out[first:last])
        first = last


@compiled
def sample(picture, vertices, triangles, starts, forms, px, py, out):
    """Piecewise affine warp: bilinear samples of `picture` (uint8) at every base pixel, out float32 (N,)."""
    height, width = picture.shape
    box = np.empty(4, np.int64)
    bounds(vertices, height, width, 1, box)
    xs = np.empty_like(out)
    ys = np.empty_like(out)
    warp(vertices, triangles, starts, forms, px, py, xs, ys)
    look_up(pack_pixels(picture, box), box, height, width, xs, ys, out)


@compiled
def grey_spreads(levels: NDArray[np.float32], ends: NDArray[np.int64], eyes: int) -> NDArray[np.float64]:
    """Standard deviation of gray levels (N,) over each eye, (eyes,); eye e has those up to ends[e]."""
    spreads = np.empty(eyes)
    first = 0
    for eye in range(eyes):
        part = levels[first : ends[eye]]
        total, squares = 0.0, 0.0
        for x in range(part.shape[0]):
            total += part[x]
            squares += part[x] * part[x]
        mean = total / part.shape[0]
        # A difference of two large numbers, which rounding may take below zero.
        spreads[eye] = math.sqrt(max(squares / part.shape[0] - mean * mean, 0.0))
        first = ends[eye]
    return spreads
