/** Frame by frame in the worker where that is possible, else the video element. */
import type { RunState } from "../../api/schema";
import { loadModule } from "../../ui/load-module";
import type { ClipPlayer } from "./player";
import { startedWorker, WorkerPlayer } from "./worker-player";

export function hasWebCodecs(): boolean {
  return "VideoDecoder" in globalThis && "OffscreenCanvas" in globalThis && "transferControlToOffscreen" in HTMLCanvasElement.prototype;
}

/** Most clips are H.264, High profile; a browser built without licensed codecs lacks it. */
const H264 = "avc1.640028";

/** True where the browser decodes H.264 the way its clips will be played. */
export async function playsH264(): Promise<boolean> {
  if (!hasWebCodecs()) return document.createElement("video").canPlayType(`video/mp4; codecs="${H264}"`) !== "";
  return VideoDecoder.isConfigSupported({ codec: H264, codedWidth: 960, codedHeight: 360 }).then(
    ({ supported }) => supported === true,
    () => false,
  );
}

/** True where any way to show clips exists. */
export function hasVideo(): boolean {
  return hasWebCodecs() || typeof document.createElement("video").play === "function";
}

type Display = Pick<RunState["display"], "background" | "sync_patch">;

/** The fallback is fetched only where it is needed: by a browser without a decoder, or one to which the worker never comes. */
export async function choosePlayer({ background, sync_patch }: Display): Promise<ClipPlayer> {
  const worker = hasWebCodecs() ? await startedWorker().catch(() => null) : null;
  try {
    if (worker) return new WorkerPlayer(worker, background, sync_patch);
  } catch (error) {
    // A canvas that cannot be handed over, as where an extension guards canvases.
    console.warn("clips are played by the video element", error);
  }
  const { VideoPlayer } = await loadModule(() => import("./video-player"));
  return new VideoPlayer();
}
