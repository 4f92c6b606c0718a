"""The skin as two sheets that meet along the closure line: upper and lower, each with its lid margin.

Sheet coordinates are closed-eye frontal coordinates, which are the UVs too, so texture travels with the lid.
Closing keeps the visible fissure at `open_fissure * (1 - closure)` in every column, by construction.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.curves import Array, bell, step

SPACING_MM = 0.22
HALF_WIDTH_MM = 72.0
TOP_MM, BOTTOM_MM = 52.0, -46.0
MARGIN_ROWS, FLANGE_MM = 12, (0.6, 1.5, 3.0)
POSTERIOR_ROW = MARGIN_ROWS - 1
EDGE_RADIUS_MM, MARGIN_RISE_MM = 0.45, 0.65
UV_WIDTH_MM, UV_HEIGHT_MM = 160.0, 100.0


@dataclass(frozen=True)
class LidPose:
    """How the lids stand: closure 0-1; lower lid mm up and mm towards the nose."""

    closure: float
    vertical_mm: float = 0.0
    horizontal_mm: float = 0.0


@dataclass(frozen=True)
class LidEdges:
    """Where lashes and tear film attach: (columns, 3) points on each lid's edges."""

    x: Array
    upper_front: Array
    lower_front: Array
    lower_back: Array
    open_height: Array

    @property
    def local_x(self) -> Array:
        """Column positions, growing towards the temple."""
        return np.abs(self.x) - anatomy.EYE_X_MM


@dataclass(frozen=True)
class SkinMesh:
    """(n, 3) vertices, (m, 4) quads, (n, 2) UVs, (n,) flags: lid margin, upper sheet."""

    vertices: Array
    quads: NDArray[np.int64]
    uv: Array
    margin: Array
    upper: Array
    edges: LidEdges


@dataclass(frozen=True)
class _Columns:
    """Everything that depends on the column alone."""

    x: Array
    local: Array
    side: Array
    line: Array
    fissure: Array
    edge_reach: Array
    motion: Array
    slide: Array
    reach: Array

    def height(self, closure: float) -> Array:
        """Distance of the upper front edge above the closure line that leaves the visible fissure."""
        rise = MARGIN_RISE_MM * (1 - step(0.5, 1.0, closure))
        return np.asarray(self.fissure * (1 - closure) + self.edge_reach * (1.8 * EDGE_RADIUS_MM + rise))


@lru_cache(maxsize=1)
def _columns() -> _Columns:
    x = np.arange(-HALF_WIDTH_MM, HALF_WIDTH_MM + SPACING_MM / 2, SPACING_MM)
    local, side = np.abs(x) - anatomy.EYE_X_MM, np.sign(x)
    length = anatomy.CANTHUS_TEMPORAL[0] - anatomy.CANTHUS_NASAL[0]
    along = np.clip((local - anatomy.CANTHUS_NASAL[0]) / length, 0, 1)
    inside = anatomy.inside_fissure(local)
    fissure = anatomy.open_fissure(local) * (1 - 0.035 * (side < 0) * np.sin(2 * np.pi * along))
    fissure *= anatomy.OPENING_MM / fissure.max()
    return _Columns(
        x=x,
        local=local,
        side=side,
        line=anatomy.closure_line(local),
        fissure=fissure,
        edge_reach=np.where(inside, np.clip(fissure / 2.0, 0, 1), 0.0),
        motion=np.where(inside, np.sin(np.pi * along) ** 0.8, 0.0),
        slide=np.where(inside, np.sin(np.pi * along), 0.0),
        reach=step(-18.0, -11.0, local) * step(23.0, 10.0, local),
    )


def _rows(extent: float) -> Array:
    """Distances from the margin: fine over the lid, coarser beyond."""
    fine = np.arange(0, 16, SPACING_MM * 0.8)
    coarse = 16 + np.cumsum(np.linspace(SPACING_MM, 1.2, 50))
    rows = np.concatenate([fine, coarse])
    return np.asarray(rows[rows < extent])


@dataclass(frozen=True)
class _OpenLid:
    """Open upper lid against the closed one: (rows, columns) change of y and z, and the crease's row."""

    rows: Array
    lift: Array
    bulge: Array
    crease: Array


@lru_cache(maxsize=1)
def _open_lid() -> _OpenLid:
    columns = _columns()
    rows = _rows(TOP_MM - columns.line.min())
    edge = columns.line + columns.height(0.0)
    fullness = gaussian_filter(columns.height(0.0) / columns.height(0.0).max(), 1.6 / SPACING_MM)
    crest = anatomy.fold_crest(columns.local) - 0.35 * columns.reach * (columns.side < 0)
    crest += 0.07 * np.sin(columns.local * 0.45 + columns.side) * columns.reach
    platform = np.maximum(crest - edge, 0.6)
    below, drop = platform * 0.98, 2.3 * fullness
    fold_raw = crest - drop - columns.line
    fold = np.maximum(fold_raw, below + 1.0)
    lift, bulge = np.zeros((len(rows), len(columns.x))), np.zeros((len(rows), len(columns.x)))
    for i in np.flatnonzero(columns.reach > 0):
        geometry = (columns.line[i], edge[i], crest[i], platform[i], below[i], fold[i], fold[i] - fold_raw[i])
        lift[:, i], bulge[:, i] = _fold_column(rows, fullness[i], columns.reach[i], *geometry)
    lift[rows > 50] = 0
    lift = gaussian_filter(lift, (1.0, 0.45 / SPACING_MM))
    lift[0] = columns.height(0.0)
    return _OpenLid(rows, lift, gaussian_filter(bulge, (1.0, 0.5 / SPACING_MM)), 0.5 * (below + fold))


def _fold_column(
    rows: Array, fullness: float, reach: float, line: float, edge: float, crest: float,
    platform: float, below: float, fold: float, excess: float,
) -> tuple[Array, Array]:  # fmt: skip
    """One column of the open lid: margin, flat platform, pocket folded under, crest, decay to the brow."""
    drop = 2.3 * fullness
    knots = np.array(
        [0, 0.5 * below, below, 0.5 * (below + fold), *(fold + np.array([0, 2, 5, 9, 14, 22, 60]))]
    )
    closed = line + knots
    opened = closed.copy()
    opened[:5] = [
        edge,
        edge + 0.5 * platform,
        edge + 0.97 * platform,
        crest + 2.3 * fullness + 0.5 * excess,
        crest + excess,
    ]
    opened[5:9] += np.array([0.78, 0.50, 0.25, 0.06]) * drop
    change = opened - closed
    change[1:] *= reach if fullness < 0.02 else 1.0
    deep = min(1.0, 3 * fullness)
    depth = np.array(
        [0, 0, -0.25 * deep, -(0.25 + 1.1 * fullness) * deep, 0.10 + 0.85 * fullness, 0.25 + 0.95 * fullness,
         0.15 + 0.55 * fullness, 0.05 + 0.2 * fullness, 0, 0, 0]
    )  # fmt: skip
    lift = CubicSpline(knots, change, bc_type="natural")(rows)
    return np.asarray(lift), np.asarray(PchipInterpolator(knots, depth * reach)(rows))


_Grid = tuple[Array, Array, Array]


def _upper_sheet(closure: float) -> _Grid:
    """The upper lid slides over the globe: y changes, z is read off the closed surface, the fold unrolls."""
    columns, lid = _columns(), _open_lid()
    open_height = columns.height(0.0)
    share = np.where(open_height > 0, columns.height(closure) / np.maximum(open_height, 1e-6), 1 - closure)
    x = np.broadcast_to(columns.x, lid.lift.shape).copy()
    y = columns.line + lid.rows[:, None] + share * lid.lift
    z = anatomy.closed_skin(x, y) + share * lid.bulge
    crease = np.exp(-0.5 * ((lid.rows[:, None] - lid.crease) / 0.7) ** 2)
    z -= 0.18 * closure * columns.reach * crease
    z += 0.12 * columns.reach * bell(lid.rows[:, None] - 1.0, 0.8)
    return x, y, z


def _lower_sheet(pose: LidPose) -> _Grid:
    """The lower lid slides along its own outline, so that the fissure keeps its shape, and lifts."""
    columns = _columns()
    rows = _rows(columns.line.max() - BOTTOM_MM)[:, None]
    nasal = -pose.horizontal_mm * columns.side * columns.slide
    x = columns.x + nasal * np.exp(-((rows / 4.5) ** 2))
    line = anatomy.closure_line(np.abs(x) - anatomy.EYE_X_MM)
    y = line - rows + pose.vertical_mm * columns.motion * np.exp(-((rows / 4.0) ** 2))
    z = anatomy.closed_skin(x, y)
    z += columns.reach * (0.30 * bell(rows - 1.9, 1.2) - 0.22 * bell(rows - 5.0, 1.0))
    z += 0.30 * pose.vertical_mm * columns.motion * bell(rows - 2.5, 1.8)
    return x, y, z


def _lid_margin(sheet: _Grid, upper: bool, rise_mm: float) -> list[_Grid]:
    """Rows from the front edge round to the globe: a quarter circle, the flat margin, a hidden flange."""
    x, y, z = (axis[0] for axis in sheet)
    local = np.abs(x) - anatomy.EYE_X_MM
    thickness = np.maximum(z - anatomy.globe_surface(local, y, 0.06), 0.05)
    reach = np.interp(x, _columns().x, _columns().edge_reach)
    radius = np.minimum(EDGE_RADIUS_MM, thickness * 0.4) * reach
    sense, rounded = (-1.0, 0.5) if upper else (1.0, 0.4)
    rise = -0.25 * np.ones_like(x) if upper else rise_mm * reach
    rows: list[_Grid] = []
    for share in np.arange(1, MARGIN_ROWS + 1) / MARGIN_ROWS:
        turn = min(share / rounded, 1.0) * np.pi / 2
        back = max(share - rounded, 0.0) / (1 - rounded)
        row_y = y + sense * radius * np.sin(turn) + sense * rise * back**0.8
        row_z = z - radius * (1 - np.cos(turn)) - (thickness - radius) * back
        if share > 0.9:
            row_z = np.maximum(row_z, anatomy.globe_surface(local, row_y, 0.06))
        rows.append((x, row_y, row_z))
    for depth in FLANGE_MM:
        hidden_y = rows[MARGIN_ROWS - 1][1] - sense * depth
        rows.append((x, hidden_y, anatomy.globe_surface(local, hidden_y, 0.02)))
    return rows


def build_skin(pose: LidPose) -> SkinMesh:
    """Mesh of the skin in a pose, both sides of the face."""
    columns = _columns()
    rise = MARGIN_RISE_MM * float(1 - step(0.5, 1.0, pose.closure))
    upper, lower = _upper_sheet(pose.closure), _lower_sheet(pose)
    upper_margin, lower_margin = _lid_margin(upper, True, 0.0), _lid_margin(lower, False, rise)
    parts = [_sheet_mesh(upper, upper_margin, True), _sheet_mesh(lower, lower_margin, False)]
    count, width, rows = len(parts[0][0]), len(columns.x), MARGIN_ROWS + len(FLANGE_MM)
    quads = np.vstack([parts[0][1], parts[1][1] + count])
    weld = np.arange(2 * count + len(parts[1][0]))
    outside = columns.fissure <= 0
    weld[count + rows * width + np.flatnonzero(outside)] = rows * width + np.flatnonzero(outside)
    edges = LidEdges(
        x=columns.x,
        upper_front=np.stack([axis[0] for axis in upper], -1),
        lower_front=np.stack([axis[0] for axis in lower], -1),
        lower_back=np.stack(lower_margin[POSTERIOR_ROW], -1),
        open_height=columns.height(0.0) * (columns.fissure > 0),
    )
    vertices, uv, margin = (np.concatenate([part[k] for part in parts]) for k in (0, 2, 3))
    upper_flag = np.concatenate([np.ones(count), np.zeros(len(parts[1][0]))])
    return SkinMesh(vertices, weld[quads], uv, margin, upper_flag, edges)


def _sheet_mesh(
    sheet: _Grid, margin: list[_Grid], upper: bool
) -> tuple[Array, NDArray[np.int64], Array, Array]:
    """Vertices, quads, UVs and margin flag of one sheet; margin quads only within the fissure."""
    columns = _columns()
    grids = [np.vstack([*(row[k] for row in margin[::-1]), sheet[k]]) for k in range(3)]
    rows, width = grids[0].shape
    index = np.arange(rows * width).reshape(rows, width)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1)
    inside = columns.fissure > 0
    keep = np.ones(quads.shape[:2], bool)
    keep[: len(margin)] = inside[:-1] | inside[1:]
    distance = np.concatenate([np.zeros(len(margin)), _rows(1e9)[: rows - len(margin)]])
    v = columns.line + (1 if upper else -1) * distance[:, None]
    u = np.broadcast_to(columns.x, v.shape)
    uv = np.stack([(u + UV_WIDTH_MM / 2) / UV_WIDTH_MM, (v + UV_HEIGHT_MM / 2) / UV_HEIGHT_MM], -1)
    flag = np.zeros((rows, width))
    flag[: len(margin)] = 1
    quads = quads if upper else quads[..., ::-1]
    return np.stack(grids, -1).reshape(-1, 3), quads[keep], uv.reshape(-1, 2), flag.ravel()
