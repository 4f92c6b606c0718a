/** Where two clips are on their one canvas, in pixels of the clips, and how large that canvas is on the screen. */
import type { ShownPairedComparison } from "../../../api/schema";
import type { Size } from "../../trials/showing";

export type Arrangement = ShownPairedComparison["presentation"]["arrangement"];
export interface ClipBox extends Size {
  x: number;
  y: number;
}
export interface Layout {
  arrangement: Arrangement;
  /** The canvas in pixels of the clips. */
  canvas: Size;
  /** The same on the screen, in CSS px. */
  shown: Size;
  /** Left and right (upper and lower) clip; in turn, the same place twice. */
  boxes: [ClipBox, ClipBox];
  /** Where a single clip, such as a reference, is shown. */
  single: ClipBox;
}

/** Nothing is measured where calibration is off: a usual screen then. */
const ASSUMED_PX_PER_MM = 3.78;
/** The question and the answers need this much below the clips. */
const ANSWERS_PX = 230;

/**
 * The declared arrangement; another only where the declaration names it for screens that are too narrow.
 * Null where the window has to be larger. `pixels` and `shown` are the size of one clip: its own, and in CSS px.
 */
export function layoutOf(
  presentation: ShownPairedComparison["presentation"],
  pixels: Size,
  shown: Size,
  room: Size,
  px_per_mm: number | null,
): Layout | null {
  if (presentation.arrangement === "one_after_the_other") return arranged("one_after_the_other", pixels, shown, 0);
  const gap_px = presentation.gap_mm * (px_per_mm ?? ASSUMED_PX_PER_MM);
  if (presentation.arrangement === "stacked") return arranged("stacked", pixels, shown, gap_px);
  if (2 * shown.width + gap_px <= room.width) return arranged("side_by_side", pixels, shown, gap_px);
  // Stacked clips need the height for both, and for the answers below.
  const fits = 2 * shown.height + gap_px + ANSWERS_PX <= room.height;
  return presentation.if_too_narrow === "stack" && fits ? arranged("stacked", pixels, shown, gap_px) : null;
}

function arranged(arrangement: Arrangement, pixels: Size, shown: Size, gap_px: number): Layout {
  // Pixels of the clip per CSS px.
  const scale = pixels.width / shown.width;
  // Whole pixels of the canvas, or the second clip would be blurred.
  const gap = Math.round(gap_px * scale);
  const across = arrangement === "side_by_side" ? pixels.width + gap : 0;
  const below = arrangement === "stacked" ? pixels.height + gap : 0;
  const canvas = { width: pixels.width + across, height: pixels.height + below };
  return {
    arrangement,
    canvas,
    shown: { width: canvas.width / scale, height: canvas.height / scale },
    boxes: [
      { x: 0, y: 0, ...pixels },
      { x: across, y: below, ...pixels },
    ],
    // Half way to the second clip is the middle of the canvas.
    single: { x: Math.round(across / 2), y: Math.round(below / 2), ...pixels },
  };
}

/** The window that the declared arrangement needs, for the page that asks for it. */
export function roomNeeded(presentation: ShownPairedComparison["presentation"], shown: Size, px_per_mm: number | null): Size {
  if (presentation.arrangement === "one_after_the_other") return { width: shown.width, height: shown.height + ANSWERS_PX };
  const gap_px = presentation.gap_mm * (px_per_mm ?? ASSUMED_PX_PER_MM);
  return { width: Math.ceil(2 * shown.width + gap_px), height: Math.ceil(shown.height + ANSWERS_PX) };
}
