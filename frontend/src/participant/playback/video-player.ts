/**
 * The fallback where WebCodecs is missing: a video element and its frame callbacks. Flagged in the data,
 * because the callbacks miss frames that were shown and say little about when.
 */
import { ClipBroken, type ClipPlayer, type PlayOptions, type Prepared, type ShownClip } from "./player";

const ASSUMED_FPS = 30;
const LOAD_LIMIT_MS = 20_000;

interface Loaded extends Prepared {
  address: string;
}

export class VideoPlayer implements ClipPlayer {
  readonly method = "video";
  readonly element = document.createElement("div");
  private readonly video = document.createElement("video");
  private readonly loaded = new Map<string, Loaded>();

  constructor() {
    Object.assign(this.video, { muted: true, playsInline: true, preload: "auto", disablePictureInPicture: true });
    this.video.style.visibility = "hidden";
    this.element.append(this.video);
  }

  async prepare(sha256: string, bytes: ArrayBuffer, fps: number | null): Promise<Prepared> {
    const known = this.loaded.get(sha256);
    if (known) return known;
    const address = URL.createObjectURL(new Blob([bytes], { type: "video/mp4" }));
    const probe = document.createElement("video");
    await ready(probe, address);
    const rate = fps ?? ASSUMED_FPS;
    const loaded = { address, fps: rate, frames: Math.round(probe.duration * rate), width: probe.videoWidth, height: probe.videoHeight };
    this.loaded.set(sha256, loaded);
    return loaded;
  }

  blank(sha256: string): void {
    const address = this.loaded.get(sha256)?.address;
    this.video.style.visibility = "hidden";
    if (address && this.video.src !== address) this.video.src = address;
  }

  async play(sha256: string, { fixation_ms, ready: kept }: PlayOptions): Promise<ShownClip> {
    const clip = this.loaded.get(sha256);
    if (!clip) throw new ClipBroken("expected a prepared clip");
    if (this.video.src !== clip.address) await ready(this.video, clip.address);
    await new Promise((resolve) => setTimeout(resolve, fixation_ms));
    await kept;
    const watch = watchFrames(this.video, clip.fps);
    this.video.currentTime = 0;
    this.video.style.visibility = "visible";
    await playToEnd(this.video);
    this.video.style.visibility = "hidden";
    return {
      method: "video",
      clock_gap_ms: null,
      clock_late_ms: null,
      refresh_ms: null,
      ended_at_ms: performance.timeOrigin + performance.now(),
      frames: clip.frames,
      fps: clip.fps,
      ...watch.stop(),
    };
  }

  compose(): Promise<Prepared> {
    return Promise.reject(new ClipBroken("this browser cannot draw several clips by one clock; it has no WebCodecs"));
  }

  release(sha256: string): void {
    const clip = this.loaded.get(sha256);
    if (clip) URL.revokeObjectURL(clip.address);
    this.loaded.delete(sha256);
  }
}

function ready(video: HTMLVideoElement, address: string): Promise<void> {
  return new Promise((resolve, reject) => {
    const limit = setTimeout(() => reject(new ClipBroken("the video element did not load the clip in time")), LOAD_LIMIT_MS);
    video.oncanplaythrough = () => {
      clearTimeout(limit);
      resolve();
    };
    video.onerror = () => {
      clearTimeout(limit);
      reject(new ClipBroken(video.error?.message ?? "the video element refused the clip"));
    };
    Object.assign(video, { muted: true, preload: "auto", src: address });
  });
}

function playToEnd(video: HTMLVideoElement): Promise<void> {
  return new Promise((resolve, reject) => {
    video.onended = () => resolve();
    video.onerror = () => reject(new ClipBroken(video.error?.message ?? "the video element stopped"));
    video.play().catch((error: unknown) => reject(new ClipBroken(String(error))));
  });
}

/** Log frames by requestVideoFrameCallback; where there is none, nothing is claimed to have been drawn. */
function watchFrames(video: HTMLVideoElement, fps: number): { stop: () => Pick<ShownClip, "drawn" | "stalls"> } {
  const drawn: [number, number][] = [];
  let stalls = 0;
  let going = true;
  const stalled = (): void => void (stalls += 1);
  const frame: VideoFrameRequestCallback = (_now, metadata) => {
    if (!going) return;
    drawn.push([Math.round(metadata.mediaTime * fps), performance.timeOrigin + metadata.expectedDisplayTime]);
    video.requestVideoFrameCallback(frame);
  };
  if ("requestVideoFrameCallback" in video) video.requestVideoFrameCallback(frame);
  video.addEventListener("waiting", stalled);
  return {
    stop: () => {
      going = false;
      video.removeEventListener("waiting", stalled);
      return { drawn, stalls };
    },
  };
}
