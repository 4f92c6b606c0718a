/**
 * Whether a press was meant for what is on the screen. A mouse that still lies where it pressed last chooses nothing:
 * it must have moved since, or the declared delay must have passed. Keys, touch and pens aim anew each time.
 */

const MOVED_PX = 3;

export class MeantPress {
  private readonly from_ms = performance.now();
  private travelled_px = 0;
  private last: { x: number; y: number } | null = null;

  constructor(
    private readonly delay_ms: number,
    signal: AbortSignal,
  ) {
    document.addEventListener("pointermove", (event) => this.moved(event), { signal, capture: true, passive: true });
  }

  allows(event: Event): boolean {
    if (!(event instanceof PointerEvent) || event.pointerType !== "mouse") return true;
    return this.travelled_px >= MOVED_PX || performance.now() - this.from_ms >= this.delay_ms;
  }

  /** Browsers also tell of a move where the page has moved under a resting pointer: its place then stays the same. */
  private moved({ pointerType, screenX: x, screenY: y, movementX, movementY }: PointerEvent): void {
    if (pointerType !== "mouse") return;
    const step = this.last ? Math.hypot(x - this.last.x, y - this.last.y) : Math.hypot(movementX, movementY);
    this.travelled_px += step;
    this.last = { x, y };
  }
}
