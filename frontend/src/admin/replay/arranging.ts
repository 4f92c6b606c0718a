/** Where a trial's clips stood and how large: by the functions that the participant's page lays them out with. */
import type { RunState, TrialInfo } from "../../api/schema";
import { type Layout, layoutOf } from "../../participant/kinds/paired_comparison/layout";
import { clipHeight, clipWidth } from "../../participant/screen/size";
import type { Schemas } from "../api";
import { adminKind } from "../kinds";
import type { Clip, Play } from "./shown";

type Replay = Schemas["Replay"];

interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}
export interface Arranged {
  /** The canvas in pixels of its clips. */
  canvas: { width: number; height: number };
  /** The same in CSS pixels of the participant's screen. */
  shown: { width: number; height: number };
  boxOf(role: string): Box;
}

const ENDLESS = { width: Infinity, height: Infinity };

/** Null where the trial has no clip. */
export function arrange({ trial, display }: Pick<Replay, "trial" | "display">, clips: readonly Clip[], play: Play): Arranged | null {
  const first = clips[0];
  if (!first) return null;
  const pixels = { width: first.width_px, height: first.height_px };
  // As the page receives a trial: the sizes are those of its first clip.
  const received = { ...first } as Clip & TrialInfo;
  const window_px = windowOf(play)?.width ?? Infinity;
  const width = Math.min(clipWidth(received, display.inter_ocular_mm, play.px_per_mm), window_px);
  const shown = { width, height: clipHeight(received, width) };
  const layout = pairLayout(trial, play, pixels, shown);
  if (layout) return { canvas: layout.canvas, shown: layout.shown, boxOf: (role) => boxIn(layout, role) };
  return { canvas: pixels, shown, boxOf: () => ({ x: 0, y: 0, ...pixels }) };
}

function pairLayout(trial: RunState["trial"], play: Play, pixels: Layout["canvas"], shown: Layout["shown"]): Layout | null {
  const roles = play.views.flatMap(({ clips }) => clips.map(({ role }) => role));
  const presentation = adminKind(trial.kind).presentation?.(trial, play.answer?.["arrangement"]);
  if (!presentation || roles.includes("shown")) return null;
  return layoutOf(presentation, pixels, shown, ENDLESS, play.px_per_mm);
}

function boxIn({ arrangement, boxes, single }: Layout, role: string): Box {
  if (role === "reference" || arrangement === "one_after_the_other") return single;
  return role === "right" || role === "second" ? boxes[1] : boxes[0];
}

/** The participant's window at the first view's start, in CSS pixels; null where it is not known. */
export function windowOf({ views }: Play): { width: number; height: number } | null {
  const { width_px, height_px } = views[0]?.screen ?? {};
  return typeof width_px === "number" && typeof height_px === "number" && width_px > 0 && height_px > 0
    ? { width: width_px, height: height_px }
    : null;
}

const SMALLEST_ABOVE_PX = 12;
const BELOW_PX = 256;
const BELOW_SHARE = 0.52;
/** Rows above and below the clip share the rest of the height as 1 to 1.35 (participant/style/trial.css). */
const SHARE_ABOVE = 1 / 2.35;

/** How far below the window's upper edge the page puts a clip of this height. */
export function topOf(window_px: number, clip_px: number): number {
  const rest = window_px - clip_px;
  const below = Math.max(Math.min(BELOW_PX, BELOW_SHARE * window_px), rest * (1 - SHARE_ABOVE));
  return Math.max(SMALLEST_ABOVE_PX, rest - below);
}
