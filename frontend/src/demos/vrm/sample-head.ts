/**
 * A head and shoulders as a VRM 1.0 file, so that the page has somebody before a model is dropped onto it. All of it is
 * computed here: smooth surfaces over two parameters. Lengths in m, y up; the face looks along z, its left side is +x.
 */
import { GlbWriter, type Mesh } from "./glb";

type Vector = readonly [number, number, number];
/** A point of a surface over two parameters from 0 to 1. Seen from outside, u runs to the right and v up. */
type Surface = (u: number, v: number) => Vector;
type Tint = (u: number, v: number, point: Vector) => Vector;

interface Sheet {
  columns: number;
  rows: number;
  at: Surface;
  tint: Tint;
  /** The same surface with the eye shut. */
  shut?: Surface;
}

const { PI, sin, cos, exp, sqrt, min, max } = Math;
const rad = (degrees: number): number => (degrees * PI) / 180;
const mix = (a: number, b: number, share: number): number => a + (b - a) * share;
const blend = (a: Vector, b: Vector, share: number): Vector => [mix(a[0], b[0], share), mix(a[1], b[1], share), mix(a[2], b[2], share)];
const smooth = (low: number, high: number, value: number): number => {
  const t = min(1, max(0, (value - low) / (high - low)));
  return t * t * (3 - 2 * t);
};
/** A hill of height 1 around (0, 0) with the given widths. */
const hill = (x: number, y: number, wide: number, high: number): number => exp(-((x / wide) ** 2) - (y / high) ** 2);

// Colors in linear light.

const SKIN: Vector = [0.72, 0.42, 0.3];
const BLUSH: Vector = [0.66, 0.28, 0.2];
const LIP: Vector = [0.5, 0.15, 0.13];
const LID: Vector = [0.6, 0.31, 0.22];
const RIM: Vector = [0.62, 0.3, 0.24];
const HAIR: Vector = [0.045, 0.022, 0.014];
const SHEEN: Vector = [0.13, 0.068, 0.04];
const LASH: Vector = [0.012, 0.008, 0.008];
const CLOTH: Vector = [0.05, 0.13, 0.17];
const WHITE: Vector = [0.82, 0.8, 0.78];

// The face: an egg with a jaw, and hills and hollows in front of it.

const TEMPLE = 0.075;
const CROWN = 0.118;
const CHIN = 0.108;
const FRONT = 0.09;
const BACK = 0.1;

/** A rounded square: at share 1 a circle of radius 1, below it flatter in the middle and steeper at the edge. */
const arc = (share: number, power: number): number => (1 - min(1, Math.abs(share)) ** power) ** (1 / power);

/** How wide the head is at a height, as a share of its widest. */
function ringAtHeight(dy: number, front: number): number {
  // In front, the lower face goes down nearly straight to the chin.
  return dy < 0 ? mix(arc(dy, 2), arc(dy, 3.4), 0.85 * front) : arc(dy, 2.35);
}

const widthAt = (y: number): number => 1 - 0.4 * smooth(0.02, -CHIN, y) ** 2;

function headPoint(azimuth: number, elevation: number): Vector {
  const dy = sin(elevation);
  const front = smooth(-0.3, 0.5, cos(azimuth));
  const ring = ringAtHeight(dy, front);
  const y = dy * (dy > 0 ? CROWN : CHIN);
  const x = TEMPLE * sin(azimuth) * ring * widthAt(y);
  if (cos(azimuth) < 0) return [x, y, BACK * cos(azimuth) * ring];
  return [x, y, FRONT * arc(sin(azimuth), 2.5) * ring + relief(x, y) * smooth(0, 0.45, cos(azimuth)) * smooth(0, 0.3, ring)];
}

/** How far in front the face is at a place around the eyes. */
function faceDepth(x: number, y: number): number {
  const dy = y / (y > 0 ? CROWN : CHIN);
  const ring = ringAtHeight(dy, 1);
  const share = min(1, Math.abs(x) / (TEMPLE * ring * widthAt(y)));
  return FRONT * arc(share, 2.5) * ring + relief(x, y) * smooth(0, 0.45, arc(share, 2));
}

/** How far the face stands out at a place, in m. */
function relief(x: number, y: number): number {
  const side = Math.abs(x);
  // A ridge that rises to the tip, steep below it.
  const ridge =
    mix(0.0125, 0.003, smooth(-0.034, 0.012, y)) * exp(-((x / 0.0075) ** 2)) * smooth(-0.049, -0.035, y) * smooth(0.03, 0.005, y);
  const nose = ridge + 0.0075 * hill(x, y + 0.0335, 0.0095, 0.0085);
  const wings = 0.0046 * hill(side - 0.0098, y + 0.0368, 0.0055, 0.0062);
  const brow = 0.0035 * hill(side - 0.03, y - 0.025, 0.024, 0.011);
  const socket = -0.0042 * hill(side - 0.031, y - 0.001, 0.021, 0.015);
  const cheek = 0.0045 * hill(side - 0.041, y + 0.034, 0.022, 0.02);
  const mouth = 0.0036 * hill(x, y + 0.061, 0.026, 0.017);
  const within = smooth(0.026, 0.012, side);
  const upperLip = 0.0024 * within * exp(-(((y - upperEdge(x) * 0.45 - LIPS * 0.55) / 0.0036) ** 2));
  const lowerLip = 0.0032 * smooth(0.023, 0.006, side) * exp(-(((y - LIPS + 0.0062) / 0.0046) ** 2));
  const between = -0.0026 * smooth(0.026, 0.02, side) * exp(-(((y - lipLine(x)) / 0.0014) ** 2));
  const philtrum = -0.0008 * hill(x, y + 0.05, 0.003, 0.006);
  const chin = 0.006 * hill(x, y + 0.094, 0.02, 0.014) - 0.002 * hill(x, y + 0.078, 0.02, 0.006);
  return nose + wings + brow + socket + cheek + mouth + upperLip + lowerLip + between + philtrum + chin;
}

const LIPS = -0.0615;
const lipLine = (x: number): number => LIPS + 0.0022 * (Math.abs(x) / 0.024) ** 2 - 0.0007 * exp(-((x / 0.004) ** 2));
/** The upper edge of the lips, with a bow. */
const upperEdge = (x: number): number => {
  const side = Math.abs(x);
  const arch = 0.0062 * max(0, 1 - (side / 0.0245) ** 1.6);
  return lipLine(x) + arch - 0.0013 * exp(-((x / 0.0035) ** 2));
};
const lowerEdge = (x: number): number => lipLine(x) - 0.0088 * max(0, 1 - (Math.abs(x) / 0.0235) ** 2) ** 0.8;

function skinTint([x, y, z]: Vector): Vector {
  if (z < 0) return SKIN;
  const side = Math.abs(x);
  const flush = 0.5 * hill(side - 0.043, y + 0.032, 0.02, 0.014) + 0.3 * hill(x, y + 0.034, 0.012, 0.008);
  const shade = blend(blend(SKIN, BLUSH, min(1, flush)), LID, 0.8 * hill(side - 0.031, y - 0.004, 0.024, 0.017));
  const inside = smooth(-0.0006, 0.0006, upperEdge(x) - y) * smooth(-0.0006, 0.0006, y - lowerEdge(x)) * smooth(0.0255, 0.0235, side);
  const groove = 0.75 * exp(-(((y - lipLine(x)) / 0.0009) ** 2)) * smooth(0.0265, 0.024, side);
  const nostril = 0.6 * hill(side - 0.0062, y + 0.0432, 0.003, 0.0015);
  return blend(blend(blend(shade, LIP, inside), [0.12, 0.03, 0.03], groove), [0.12, 0.05, 0.04], nostril);
}

/** Columns are closer in front and rows around nose and mouth, where the face has its detail. */
const azimuthAt = (u: number): number => PI * (0.4 * (2 * u - 1) + 0.6 * (2 * u - 1) ** 3);
const elevationAt = (v: number): number => {
  const p = mix(-1, 1.3083, v);
  return rad(max(-90, min(90, -20 + 50 * p + 20 * p ** 3)));
};

const FACE: Sheet = {
  columns: 208,
  rows: 190,
  at: (u, v) => headPoint(azimuthAt(u), elevationAt(v)),
  tint: (_u, _v, point) => skinTint(point),
};

// The eyes: globes larger than real ones, as drawn characters have them, with lids that slide over them.

const GLOBE = 0.024;
const EYE: Vector = [0.0305, 0, 0.0622];
const LID_UP = 0.0012;
/** While it shuts, the globe gives way: a morph target moves the lid along a straight line, not along the globe. */
const GLOBE_BACK = 0.0012;
const HALF_WIDTH = rad(37);
/** The lids are turned towards the temples, as the face is. */
const TURNED = rad(1.5);
const RAISED = 2.6;

/** Upper, lower and shut margins in degrees above the middle of the eye; `across` from -1 (nose) to 1 (temple). */
function margins(across: number): { upper: number; lower: number; shut: number } {
  const bow = max(0, 1 - Math.abs(across) ** 2.3);
  const axis = RAISED * across;
  // Beyond the corners the upper lid lies over the lower one.
  const over = 1.5 * smooth(1, 1.2, Math.abs(across));
  const upper = axis + 16.5 * bow ** 0.75 * (1 - 0.12 * across) - over;
  const lower = axis - 14.5 * max(0, 1 - across * across) ** 0.85;
  return { upper, lower, shut: mix(lower, upper, 0.1 * bow) - over };
}

/** A point of a ball around the globe's center; azimuth to the temple. */
function onBall(side: number, azimuth: number, elevation: number, radius: number): Vector {
  const across = azimuth + TURNED;
  return [
    side * (EYE[0] + radius * sin(across) * cos(elevation)),
    EYE[1] + radius * sin(elevation),
    EYE[2] + radius * cos(across) * cos(elevation),
  ];
}

const LID_REACH = rad(72);

/**
 * The skin of a lid: on the ball near the margin (`apart` 0), and one with the face further away, where it ends just
 * below the face (`apart` 1).
 */
function lidSkin(side: number, azimuth: number, elevation: number, radius: number, apart: number): Vector {
  const [x, y, z] = onBall(side, azimuth, elevation, radius);
  // Just above the face's own triangles; the border itself lies below them.
  const face = faceDepth(x, y) + mix(0.0002, -0.0002, smooth(0.5, 1, apart));
  // The greater of both, rounded where they meet.
  const soft = mix(0.0004, 0.0035, smooth(0.05, 0.5, apart));
  const share = min(1, max(0, 0.5 + (0.5 * (z - face)) / soft));
  const joined = mix(face, z, share) + soft * share * (1 - share) * smooth(1, 0.8, apart);
  return [x, y, mix(z, joined, smooth(0, 0.2, apart))];
}

/** How far a place of a lid is from the eye's opening, 0 to 1: at its outer rows, or beyond the corners. */
const apartAt = (azimuth: number, rows: number): number => max(rows, smooth(HALF_WIDTH * 0.95, LID_REACH, Math.abs(azimuth)));

/** 0 along the opening of the eye, 1 beyond its corners. */
const beyond = (azimuth: number): number => smooth(0.9, 1.04, Math.abs(azimuth / HALF_WIDTH));

function upperLid(side: number): Sheet {
  const at =
    (margin: "upper" | "shut"): Surface =>
    (u, v) => {
      const azimuth = side * mix(-LID_REACH, LID_REACH, u);
      const { [margin]: edge } = margins(azimuth / HALF_WIDTH);
      // The first rows are the rim, from the globe to the lid's outside.
      const rim = max(smooth(0, 0.06, v), beyond(azimuth));
      const radius = GLOBE - 0.0004 + (LID_UP + 0.0004) * rim;
      return lidSkin(side, azimuth, rad(mix(edge, 66, max(0, v - 0.05) / 0.95)), radius, apartAt(azimuth, v));
    };
  const fold = (v: number): number => exp(-(((v - 0.32) / 0.06) ** 2));
  return {
    columns: 72,
    rows: 44,
    at: at("upper"),
    shut: at("shut"),
    tint: (u, v, point) => {
      const corner = beyond(mix(-LID_REACH, LID_REACH, u));
      const skin = blend(RIM, skinTint(point), max(smooth(0.02, 0.1, v), corner));
      return blend(skin, [0.34, 0.14, 0.1], 0.5 * fold(v) * (1 - corner));
    },
  };
}

function lowerLid(side: number): Sheet {
  const at =
    (closure: number): Surface =>
    (u, v) => {
      const azimuth = side * mix(-LID_REACH, LID_REACH, u);
      const { lower, shut } = margins(azimuth / HALF_WIDTH);
      const edge = mix(lower, shut, closure);
      const rim = max(smooth(0, 0.06, 1 - v), beyond(azimuth));
      const radius = GLOBE - 0.0004 + (LID_UP + 0.0002) * rim;
      return lidSkin(side, azimuth, rad(mix(-64, edge, min(1, v / 0.95))), radius, apartAt(azimuth, 1 - v));
    };
  return {
    columns: 72,
    rows: 36,
    at: at(0),
    shut: at(1),
    tint: (u, v, point) => blend(skinTint(point), RIM, smooth(0.9, 0.97, v) * (1 - beyond(mix(-LID_REACH, LID_REACH, u)))),
  };
}

/** The upper lashes as one inked stroke: thin at the nose, with a wing at the temple. */
function lashes(side: number): Sheet {
  const at =
    (margin: "upper" | "shut", lift: number, long: number): Surface =>
    (u, v) => {
      // Towards the temple the stroke goes on beyond the corner of the eye.
      const along = side > 0 ? u : 1 - u;
      const across = mix(-0.95, 1.05, along);
      const { [margin]: edge } = margins(across);
      const reach = mix(0.0007, 0.0032, smooth(0.05, 0.9, along)) * smooth(1.02, 0.88, along) + 0.00025;
      const angle = rad(lift);
      const radius = GLOBE + LID_UP + 0.0002 + v * long * reach * cos(angle);
      return onBall(side, across * HALF_WIDTH, rad(edge - 0.7) + (v * long * reach * sin(angle)) / GLOBE, radius);
    };
  return { columns: 60, rows: 6, at: at("upper", 62, 1), shut: at("shut", -30, 0.75), tint: () => LASH };
}

function brow(side: number): Sheet {
  return {
    columns: 48,
    rows: 10,
    at: (u, v) => {
      const along = side > 0 ? u : 1 - u;
      const azimuth = side * rad(mix(9, 47, along));
      const arch = 12.6 + 3.4 * sin(PI * min(1, along * 0.78 + 0.06)) - 2.6 * smooth(0.62, 1, along);
      const half = 1.75 * smooth(-0.06, 0.22, along) * mix(1, 0.22, smooth(0.3, 1, along));
      const across = 2 * v - 1;
      const thick = 0.0013 * sqrt(max(0, 1 - across * across)) - 0.0002;
      const [x, y, z] = headPoint(azimuth, rad(arch + half * across));
      const length = sqrt(x * x + z * z);
      return [x + (thick * x) / length, y, z + (thick * z) / length];
    },
    tint: (u) => blend(HAIR, SHEEN, 0.3 + 0.2 * sin(u * 90)),
  };
}

/** Globe, iris and pupil around the center of the eye: rings around the line of sight, so that the iris is round. */
function globe(): Sheet {
  const at =
    (back: number): Surface =>
    (u, v) => {
      const away = ringAt(1 - v);
      const turn = 2 * PI * u;
      // The cornea stands out a little.
      const radius = GLOBE + 0.0005 * exp(-((away / rad(14)) ** 2));
      return [radius * sin(away) * cos(turn), radius * sin(away) * sin(turn), radius * cos(away) - back];
    };
  return { columns: 64, rows: 60, at: at(0), shut: at(GLOBE_BACK), tint: (u, v) => irisTint(u, ringAt(1 - v)) };
}

const IRIS = rad(16.2);
const PUPIL = rad(6.8);
/** Half of the rings lie within the iris. */
const ringAt = (w: number): number => (w < 0.6 ? (rad(20) * w) / 0.6 : mix(rad(20), rad(110), (w - 0.6) / 0.4));

function irisTint(u: number, away: number): Vector {
  const share = (away - PUPIL) / (IRIS - PUPIL);
  const fibres = 0.5 + 0.25 * sin(u * 2 * PI * 23) + 0.25 * sin(u * 2 * PI * 37 + 1.3);
  const below = 0.5 - 0.5 * sin(2 * PI * u);
  const colored = blend([0.06, 0.16, 0.14], [0.2, 0.42, 0.33], 0.25 * fibres + 0.6 * below * smooth(1, 0.2, share));
  const warm = blend(colored, [0.36, 0.24, 0.08], 0.55 * smooth(0.35, 0.02, share));
  const iris = blend(warm, [0.012, 0.03, 0.03], smooth(0.72, 0.98, share));
  const white = blend(WHITE, [0.5, 0.42, 0.42], smooth(rad(22), rad(44), away));
  const edged = blend(iris, white, smooth(IRIS - rad(0.5), IRIS + rad(0.7), away));
  return blend([0.004, 0.004, 0.005], edged, smooth(PUPIL - rad(0.4), PUPIL + rad(0.4), away));
}

/** The reflection of a window, on the globe next to the pupil. */
function catchlight(): Sheet {
  const at =
    (back: number): Surface =>
    (u, v) => {
      const turn = 2 * PI * u;
      const width = rad(2.7) * (1 - v);
      const [x, y] = [rad(-4.6) + width * cos(turn), rad(6) + 1.15 * width * sin(turn)];
      const radius = GLOBE + 0.0009;
      return [radius * sin(x), radius * sin(y), radius * sqrt(1 - sin(x) ** 2 - sin(y) ** 2) - back];
    };
  return { columns: 32, rows: 4, at: at(0), shut: at(GLOBE_BACK), tint: () => [1, 1, 1] };
}

// Hair, neck and shirt.

/** How far down the hair reaches, in degrees above the middle of the head: a side parting, and a bob. */
function hairline(azimuth: number): number {
  const degrees = (azimuth * 180) / PI;
  const around = Math.abs(degrees);
  const fringe =
    38 - 13 * exp(-(((degrees + 30) / 26) ** 2)) - 6 * exp(-(((degrees - 38) / 20) ** 2)) - 2 * exp(-(((degrees - 12) / 8) ** 2));
  return mix(fringe, -58, smooth(50, 78, around));
}

const HAIR_SHEET: Sheet = {
  columns: 288,
  rows: 70,
  at: (u, v) => {
    const azimuth = mix(-PI, PI, u);
    const edge = hairline(azimuth);
    const elevation = mix(edge, 90, v ** 1.15);
    const side = smooth(50, 80, (Math.abs(azimuth) * 180) / PI);
    const down = smooth(10, -58, elevation) * side;
    const strands = 0.0011 * sin(azimuth * 46 + 5 * sin(elevation * 0.05)) + 0.0007 * sin(azimuth * 91 + elevation * 0.11);
    const full = 0.0125 + 0.003 * smooth(60, 20, elevation) + 0.014 * down + strands * smooth(0.98, 0.7, v);
    const offset = mix(-0.002, full, sqrt(smooth(0, 0.34, v)));
    // Below the ears the hair hangs: it does not follow the neck inwards.
    const [x, y, z] = headPoint(azimuth, rad(max(elevation, -22)));
    const drop = elevation < -22 ? (elevation + 22) * 0.0021 : 0;
    const length = sqrt(x * x + y * y + z * z);
    const out = 1 + offset / length;
    return [x * out, y * out + drop, z * out];
  },
  tint: (u, v) => {
    const azimuth = mix(-PI, PI, u);
    const strand = 0.5 + 0.5 * sin(azimuth * 46 + 0.6) * sin(azimuth * 131);
    return blend(HAIR, SHEEN, strand * (0.25 + 0.75 * exp(-(((v - 0.45) / 0.16) ** 2))));
  },
};

const NECK: Sheet = {
  columns: 72,
  rows: 40,
  at: (u, v) => {
    const turn = mix(-PI, PI, u);
    const flare = smooth(0.35, 0, v) * 0.02;
    const radius = 0.045 + flare;
    return [radius * sin(turn) * (1 + flare * 8), mix(-0.19, -0.04, v), 0.92 * radius * cos(turn) - 0.016];
  },
  tint: (_u, v) => blend(SKIN, LID, 0.9 * smooth(0.4, 0.85, v)),
};

const SHIRT: Sheet = {
  columns: 80,
  rows: 60,
  at: (u, v) => {
    const turn = mix(-PI, PI, u);
    // From the waist up to the shoulders, then in to the collar.
    const rise = smooth(0.45, 0.98, v);
    const wide = mix(mix(0.15, 0.195, smooth(0, 0.4, v)), 0.058, rise ** 1.4);
    const deep = mix(mix(0.085, 0.1, smooth(0, 0.4, v)), 0.056, rise);
    const y = mix(-0.5, -0.245, smooth(0, 0.62, v)) + 0.085 * smooth(0.5, 1, v) - 0.012 * cos(turn) * smooth(0.8, 1, v);
    const square = (value: number): number => Math.sign(value) * Math.abs(value) ** 0.8;
    return [wide * square(sin(turn)), y, deep * square(cos(turn)) - 0.022];
  },
  tint: (_u, v) => blend(CLOTH, [0.09, 0.2, 0.25], smooth(0.955, 0.975, v)),
};

// From sheets to a file.

const STEP = 1e-3;

function meshOf({ columns, rows, at, tint, shut }: Sheet): Mesh {
  const count = (columns + 1) * (rows + 1);
  const colors = new Float32Array(3 * count);
  const open = shapeOf(at, columns, rows);
  for (let k = 0; k < count; k += 1) {
    const point: Vector = [open.positions[3 * k] ?? 0, open.positions[3 * k + 1] ?? 0, open.positions[3 * k + 2] ?? 0];
    colors.set(tint((k % (columns + 1)) / columns, Math.floor(k / (columns + 1)) / rows, point), 3 * k);
  }
  const indices = new Uint32Array(6 * columns * rows);
  for (let square = 0; square < columns * rows; square += 1) {
    const a = Math.floor(square / columns) * (columns + 1) + (square % columns);
    indices.set([a, a + 1, a + columns + 2, a, a + columns + 2, a + columns + 1], 6 * square);
  }
  return { ...open, colors, indices, ...(shut === undefined ? {} : { shut: shapeOf(shut, columns, rows) }) };
}

function shapeOf(at: Surface, columns: number, rows: number): { positions: Float32Array; normals: Float32Array } {
  const positions = new Float32Array(3 * (columns + 1) * (rows + 1));
  const normals = new Float32Array(positions.length);
  for (let row = 0; row <= rows; row += 1) {
    for (let column = 0; column <= columns; column += 1) {
      const [u, v] = [column / columns, row / rows];
      const offset = 3 * (row * (columns + 1) + column);
      positions.set(at(u, v), offset);
      normals.set(normalAt(at, u, v), offset);
    }
  }
  return { positions, normals };
}

/** The direction to which a surface looks, from its two tangents. */
function normalAt(at: Surface, u: number, v: number): Vector {
  // Where rows meet in one point there is no tangent along them.
  const within = min(1 - 2 * STEP, max(2 * STEP, v));
  const [a, b] = [at(u - STEP, within), at(u + STEP, within)];
  const [c, d] = [at(u, within - STEP), at(u, within + STEP)];
  const along: Vector = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
  const up: Vector = [d[0] - c[0], d[1] - c[1], d[2] - c[2]];
  const [x, y, z] = [along[1] * up[2] - along[2] * up[1], along[2] * up[0] - along[0] * up[2], along[0] * up[1] - along[1] * up[0]];
  const length = sqrt(x * x + y * y + z * z);
  return length > 0 ? [x / length, y / length, z / length] : [0, 0, 1];
}

/** Bones that VRM 1.0 requires, and those of the eyes, with their parents; places relative to them. */
const BONES: readonly (readonly [name: string, parent: string, position: Vector])[] = [
  ["hips", "", [0, 0.95, 0]],
  ["spine", "hips", [0, 0.15, 0]],
  ["head", "spine", [0, 0.36, 0]],
  ...[1, -1].flatMap((side): [string, string, Vector][] => {
    const name = side > 0 ? "left" : "right";
    return [
      [`${name}Eye`, "head", [side * EYE[0], 0.1 + EYE[1], EYE[2]]],
      [`${name}UpperArm`, "spine", [side * 0.17, 0.2, 0]],
      [`${name}LowerArm`, `${name}UpperArm`, [side * 0.26, 0, 0]],
      [`${name}Hand`, `${name}LowerArm`, [side * 0.25, 0, 0]],
      [`${name}UpperLeg`, "hips", [side * 0.09, -0.05, 0]],
      [`${name}LowerLeg`, `${name}UpperLeg`, [0, -0.42, 0]],
      [`${name}Foot`, `${name}LowerLeg`, [0, -0.42, 0]],
    ];
  }),
];
const MATERIALS = [
  { name: "skin", roughness: 0.62 },
  { name: "eye", roughness: 0.18 },
  { name: "light", roughness: 1 },
  { name: "hair", roughness: 0.5 },
  { name: "cloth", roughness: 0.9 },
] as const;
type Material = (typeof MATERIALS)[number]["name"];

/** Parts by name: the bone they hang on, where, and their sheets. Those of an eye have one morph target, the blink. */
const PARTS: readonly (readonly [name: string, bone: string, position: Vector, sheets: readonly (readonly [Material, Sheet])[]])[] = [
  ["face", "head", [0, 0.1, 0], [["skin", FACE]]],
  [
    "hair",
    "head",
    [0, 0.1, 0],
    [
      ["hair", HAIR_SHEET],
      ["hair", brow(1)],
      ["hair", brow(-1)],
    ],
  ],
  [
    "body",
    "spine",
    [0, 0.46, 0],
    [
      ["skin", NECK],
      ["cloth", SHIRT],
    ],
  ],
  ...[1, -1].flatMap((side): [string, string, Vector, [Material, Sheet][]][] => {
    const name = side > 0 ? "Left" : "Right";
    return [
      [
        `lids${name}`,
        "head",
        [0, 0.1, 0],
        [
          ["skin", upperLid(side)],
          ["skin", lowerLid(side)],
          ["hair", lashes(side)],
        ],
      ],
      [
        `globe${name}`,
        `${name.toLowerCase()}Eye`,
        [0, 0, 0],
        [
          ["eye", globe()],
          ["light", catchlight()],
        ],
      ],
    ];
  }),
];

/** The file's bytes. */
export function sampleHead(): ArrayBuffer {
  const writer = new GlbWriter();
  const meshes = PARTS.map(([name, , , sheets]) => {
    const primitives = sheets.map(([material, sheet]) =>
      writer.primitive(
        meshOf(sheet),
        MATERIALS.findIndex((one) => one.name === material),
      ),
    );
    const blink = /Left|Right/.exec(name);
    return { name, primitives, ...(blink ? { extras: { targetNames: [`blink${blink[0]}`] } } : {}) };
  });
  const nodes = [
    ...BONES.map(([name, , translation]) => ({
      name,
      translation,
      children: [
        ...BONES.flatMap(([, parent], bone) => (parent === name ? [bone] : [])),
        ...PARTS.flatMap(([, bone], part) => (bone === name ? [BONES.length + part] : [])),
      ],
    })).map(({ children, ...node }) => (children.length > 0 ? { ...node, children } : node)),
    ...PARTS.map(([name, , translation], mesh) => ({ name, translation, mesh })),
  ];
  const closing = (...sides: ("Left" | "Right")[]) => ({
    morphTargetBinds: PARTS.flatMap(([name], part) =>
      sides.some((side) => name.endsWith(side)) ? [{ node: BONES.length + part, index: 0, weight: 1 }] : [],
    ),
  });
  const range = { inputMaxValue: 30, outputScale: 12 };
  return writer.file({
    asset: { version: "2.0", generator: "Palpebra" },
    extensionsUsed: ["VRMC_vrm"],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes,
    meshes,
    materials: MATERIALS.map(({ name, roughness }) => ({
      name,
      doubleSided: true,
      pbrMetallicRoughness: { metallicFactor: 0, roughnessFactor: roughness },
      ...(name === "light" ? { emissiveFactor: [0.9, 0.9, 0.9] } : {}),
    })),
    extensions: {
      VRMC_vrm: {
        specVersion: "1.0",
        meta: { name: "Sample head", version: "2", authors: ["Palpebra"], licenseUrl: "https://vrm.dev/licenses/1.0/" },
        humanoid: { humanBones: Object.fromEntries(BONES.map(([name], node) => [name, { node }])) },
        lookAt: {
          type: "bone",
          offsetFromHeadBone: [0, 0.1, EYE[2]],
          rangeMapHorizontalInner: range,
          rangeMapHorizontalOuter: range,
          rangeMapVerticalDown: range,
          rangeMapVerticalUp: range,
        },
        expressions: { preset: { blink: closing("Left", "Right"), blinkLeft: closing("Left"), blinkRight: closing("Right") } },
      },
    },
  });
}
