/** Frame by frame in the worker where that is possible, else the video element. */
import type { ClipPlayer } from "./player";
import { VideoPlayer } from "./video-player";
import { WorkerPlayer } from "./worker-player";

export function hasWebCodecs(): boolean {
  return "VideoDecoder" in globalThis && "OffscreenCanvas" in globalThis && "transferControlToOffscreen" in HTMLCanvasElement.prototype;
}

/** True where any way to show clips exists. */
export function hasVideo(): boolean {
  return hasWebCodecs() || typeof document.createElement("video").play === "function";
}

export function choosePlayer(background: string): ClipPlayer {
  return hasWebCodecs() ? new WorkerPlayer(background) : new VideoPlayer();
}
