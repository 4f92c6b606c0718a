/** The screen as it was measured, and how large a clip is on it. */
import { pixelRatio, pixels, within } from "../measured";
import type { CalibrationState, TrialInfo } from "../../api/schema";

// From calibration to the clip's size on this screen, and what a zoom or another screen does to it.

export interface ScreenShape {
  device_pixel_ratio: number;
  screen_width_px: number;
  screen_height_px: number;
}

type ScreenChange = "none" | "zoom" | "screen";

const SAME_SHARE = 0.01;

export function screenShape(): ScreenShape {
  // 1 is what a browser without pixel ratios has.
  return {
    device_pixel_ratio: pixelRatio(window.devicePixelRatio) ?? 1,
    screen_width_px: pixels(screen.width),
    screen_height_px: pixels(screen.height),
  };
}

/**
 * What has happened between two looks at the screen. Chromium keeps the screen's size under zoom, Firefox
 * divides it by the zoom: either way the pixel ratio has changed and nothing else has.
 */
export function screenChange(before: ScreenShape, now: ScreenShape): ScreenChange {
  const same = (a: number, b: number): boolean => Math.abs(a - b) <= SAME_SHARE * Math.max(a, b);
  const turned = same(before.screen_width_px, now.screen_height_px) && same(before.screen_height_px, now.screen_width_px);
  const sameSize = turned || (same(before.screen_width_px, now.screen_width_px) && same(before.screen_height_px, now.screen_height_px));
  const sameRatio = same(before.device_pixel_ratio, now.device_pixel_ratio);
  if (sameRatio) return sameSize ? "none" : "screen";
  const device = (shape: ScreenShape): number => shape.screen_width_px * shape.device_pixel_ratio;
  return sameSize || same(device(before), device(now)) ? "zoom" : "screen";
}

/** CSS pixels per millimeter after a zoom: the pixel has grown, so a millimeter holds fewer. */
export function zoomed(px_per_mm: number, before: ScreenShape, now: ScreenShape): number {
  return (px_per_mm * before.device_pixel_ratio) / now.device_pixel_ratio;
}

/** Shown width of a clip in CSS px: inter-ocular distance as declared, else its width in mm, else its own pixels. */
export function clipWidth(trial: TrialInfo, inter_ocular_mm: number, px_per_mm: number | null): number {
  const own = trial.width_px ?? 640;
  if (px_per_mm === null) return own;
  if (trial.inter_ocular_px) return (own * inter_ocular_mm * px_per_mm) / trial.inter_ocular_px;
  return trial.width_mm ? trial.width_mm * px_per_mm : own;
}

export function clipHeight(trial: TrialInfo, width: number): number {
  return trial.width_px && trial.height_px ? (width * trial.height_px) / trial.width_px : width / 2;
}

/** What was measured of the screen itself. */
export type Measured = Pick<CalibrationState, "px_per_mm" | "method" | "repeats" | "spread_percent" | "ruler_check">;
/** The measured viewing distance. */
export type Distance = Pick<CalibrationState, "viewing_distance_mm" | "distance_method" | "distance_spread_mm" | "distance_typed_mm">;

export const NO_DISTANCE: Distance = {
  viewing_distance_mm: null,
  distance_method: null,
  distance_spread_mm: null,
  distance_typed_mm: null,
};

export function calibrationBody(measured: Measured, distance: Distance, occasion: CalibrationState["occasion"]): CalibrationState {
  return {
    ...measured,
    ...distance,
    occasion,
    recheck_percent: null,
    px_per_mm: Math.round(measured.px_per_mm * 10_000) / 10_000,
    ...screenShape(),
    window_width_px: pixels(window.innerWidth),
    window_height_px: pixels(window.innerHeight),
    // Only a hint: the frame of the window counts in it too.
    zoom: within(Math.round((window.outerWidth / window.innerWidth) * 100) / 100, 0.01, 100) ?? 1,
  };
}

/** CSS pixels per millimeter that screens have: 48 to 254 an inch, from a large television to a telephone. */
const PLAUSIBLE_PX_PER_MM = [1.9, 10] as const;

/** Widest screen that somebody rates at, and the same where it is twice as wide as high or more. */
const WIDEST_MM = [1_000, 1_300] as const;

/** False where a card or ruler cannot have been held against the screen: it would be a meter wide, or as small as a stamp. */
export function isPlausible(px_per_mm: number, { screen_width_px: width, screen_height_px: height } = screenShape()): boolean {
  const widest = WIDEST_MM[width >= 2 * height ? 1 : 0];
  return px_per_mm >= PLAUSIBLE_PX_PER_MM[0] && px_per_mm <= PLAUSIBLE_PX_PER_MM[1] && width / px_per_mm <= widest;
}

// What is known about this participant's screen, and whether it still holds.

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
