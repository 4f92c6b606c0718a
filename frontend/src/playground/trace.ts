/** The closure of the last seconds, drawn as a moving line. */

const SECONDS = 8;

export class Trace {
  readonly canvas = document.createElement("canvas");
  private readonly points: [time_s: number, closure: number][] = [];

  constructor(name: string) {
    this.canvas.width = 480;
    this.canvas.height = 60;
    this.canvas.className = "playground-trace";
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `Closure over the last ${SECONDS} seconds: ${name}`);
  }

  add(time_s: number, closure: number): void {
    this.points.push([time_s, closure]);
    while ((this.points[0]?.[0] ?? time_s) < time_s - SECONDS) this.points.shift();
    const drawing = this.canvas.getContext("2d");
    if (drawing === null) return;
    const { width, height } = this.canvas;
    drawing.clearRect(0, 0, width, height);
    drawing.strokeStyle = getComputedStyle(this.canvas).color;
    drawing.lineWidth = 2;
    drawing.beginPath();
    for (const [at, value] of this.points) drawing.lineTo(width - ((time_s - at) / SECONDS) * width, 2 + value * (height - 4));
    drawing.stroke();
  }

  clear(): void {
    this.points.length = 0;
  }
}
