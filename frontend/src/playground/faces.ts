/** The shipped characters, drawn from strips of pictures from open to shut (`stimuli strips`). */

export interface Strips {
  width_px: number;
  height_px: number;
  /** Closure of each picture, the topmost first. */
  closures: readonly number[];
  characters: readonly string[];
}

/** Place of the ascending `steps` value that lies nearest. */
export function nearest(steps: readonly number[], value: number): number {
  let best = 0;
  steps.forEach((step, index) => {
    if (Math.abs(step - value) < Math.abs((steps[best] ?? 0) - value)) best = index;
  });
  return best;
}

/** One character on its own canvas. */
export class Face {
  readonly canvas = document.createElement("canvas");
  private readonly picture = new Image();
  private drawn = "";

  constructor(
    private readonly strips: Strips,
    name: string,
    address: string,
  ) {
    this.canvas.width = strips.width_px;
    this.canvas.height = strips.height_px;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `The ${name} character, blinking`);
    this.picture.src = address;
  }

  /** Draw both eyes; the character's left eye is at the right of the picture. */
  show(left: number, right: number): void {
    if (!this.picture.complete || this.picture.naturalWidth === 0) return;
    const rows = [nearest(this.strips.closures, right), nearest(this.strips.closures, left)];
    if (rows.join() === this.drawn) return;
    this.drawn = rows.join();
    const half = this.strips.width_px / 2;
    const height = this.strips.height_px;
    const drawing = this.canvas.getContext("2d");
    rows.forEach((row, side) => {
      drawing?.drawImage(this.picture, side * half, row * height, half, height, side * half, 0, half, height);
    });
  }
}
