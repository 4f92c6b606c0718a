/**
 * A square in the clip's lower left corner that codes the frame's number, drawn with the frame itself, so that both
 * are on the screen in the same refresh. `stimuli scope` reads it (stimuli_builder/sync_patch/film.py).
 */
interface Canvas {
  readonly canvas: { readonly width: number; readonly height: number };
  fillStyle: unknown;
  fillRect(x: number, y: number, width: number, height: number): void;
}

const SIDE = 3;
const PARITY = 4;
/** Numbers repeat after this many frames. */
const NUMBERS = 256;
/** The square and its black rim take five of these parts of the clip's height. */
const PARTS = 12;

/** White fields, row by row: the middle one for odd frames, the others a Gray code, lowest bit first; all for none. */
export function patchFields(index: number | null): boolean[] {
  const number = (index ?? 0) % NUMBERS;
  // A Gray code: neighbors differ in one field, so that a film of two frames mixed is off by one at most.
  const code = number ^ (number >> 1);
  return Array.from({ length: SIDE * SIDE }, (_, field) => {
    if (index === null) return true;
    if (field === PARITY) return index % 2 === 1;
    return ((code >> (field > PARITY ? field - 1 : field)) & 1) === 1;
  });
}

export function drawSyncPatch(context: Canvas, index: number | null): void {
  const { height } = context.canvas;
  const part = Math.floor(height / PARTS);
  const rim = SIDE * part + 2 * part;
  context.fillStyle = "#000";
  context.fillRect(0, height - rim, rim, rim);
  context.fillStyle = "#fff";
  patchFields(index).forEach((white, field) => {
    const [column, row] = [field % SIDE, Math.floor(field / SIDE)];
    if (white) context.fillRect(part * (1 + column), height - rim + part * (1 + row), part, part);
  });
}
