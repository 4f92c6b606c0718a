/** What the canvas showed at a moment: the surround, and on it each clip's frame at its place. */
import { drawSyncPatch } from "../../participant/playback/sync-patch";
import type { Schemas } from "../api";
import type { Arranged } from "./arranging";
import type { Pictures } from "./pictures";
import type { Shown } from "./shown";

interface Painted {
  canvas: HTMLCanvasElement;
  arranged: Arranged;
  pictures: ReadonlyMap<string, Pictures>;
  display: Schemas["Display"];
}

/** Paint a moment; resolves when it stands there. `current` says whether it is still the one asked for. */
export async function paint({ canvas, arranged, pictures, display }: Painted, { frames }: Shown, current: () => boolean): Promise<void> {
  const context = canvas.getContext("2d", { alpha: false });
  if (!context) return;
  const sources = frames.map(({ lane, stand }) => pictures.get(lane.sha256)?.picture(stand.index) ?? null);
  // Without a wait where everything is decoded: the picture and its time change together.
  const ready: (CanvasImageSource | null)[] = [];
  for (const source of sources) ready.push(source instanceof Promise ? await source : source);
  if (!current()) return;
  context.fillStyle = display.background;
  context.fillRect(0, 0, canvas.width, canvas.height);
  frames.forEach(({ lane }, row) => {
    const { x, y, width, height } = arranged.boxOf(lane.role);
    const picture = ready[row];
    if (picture) context.drawImage(picture, x, y, width, height);
  });
  if (display.sync_patch) drawSyncPatch(context, frames.length ? Math.max(...frames.map(({ stand }) => stand.index)) : null);
}
