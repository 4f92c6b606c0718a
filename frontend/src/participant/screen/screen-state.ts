/** What is known about this participant's screen, and whether it still holds. */
import type { CalibrationState } from "../../api/schema";
import { pixelRatio, pixels, within } from "../measured";
import { type ScreenChange, screenChange, screenShape, type ScreenShape, zoomed } from "./size";

export class ScreenState {
  calibration: CalibrationState | null = null;
  refresh_rate_hz: number | null = null;

  /** Take over a stored calibration where it was made on a screen like this one. */
  restore(stored: CalibrationState | null): void {
    if (stored && screenChange(stored, screenShape()) === "none") this.calibration = stored;
  }

  get px_per_mm(): number | null {
    return this.calibration?.px_per_mm ?? null;
  }

  change(now: ScreenShape = screenShape()): ScreenChange {
    return this.calibration ? screenChange(this.calibration, now) : "none";
  }

  /** The calibration as it is after a zoom, to be stored as a new one. */
  afterZoom(now: ScreenShape = screenShape()): CalibrationState | null {
    if (!this.calibration) return null;
    const px_per_mm = zoomed(this.calibration.px_per_mm, this.calibration, now);
    const window_size = { window_width_px: pixels(window.innerWidth), window_height_px: pixels(window.innerHeight) };
    this.calibration = { ...this.calibration, ...now, ...window_size, px_per_mm, occasion: "zoom", recheck_percent: null };
    return this.calibration;
  }

  record(): { refresh_rate_hz: number | null; device_pixel_ratio: number | null } {
    return { refresh_rate_hz: within(this.refresh_rate_hz, 0, 10_000), device_pixel_ratio: pixelRatio(window.devicePixelRatio) };
  }
}
