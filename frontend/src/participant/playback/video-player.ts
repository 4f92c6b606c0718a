/**
 * The fallback where WebCodecs is missing: a video element and its frame callbacks. Flagged in the data,
 * because the callbacks miss frames that were shown and say little about when.
 */
import { absoluteNow, ClipBroken, type ClipPlayer, type PlayOptions, type Prepared, type ShownClip } from "./protocol";
import { count } from "../measured";

const ASSUMED_FPS = 30;
const LOAD_LIMIT_MS = 20_000;
// A page in the background gets no refreshes at all.
const REFRESH_LIMIT_MS = 1_000;

interface Loaded extends Prepared {
  address: string;
}

export class VideoPlayer implements ClipPlayer {
  readonly method = "video";
  readonly element = document.createElement("div");
  private readonly video = document.createElement("video");
  private readonly loaded = new Map<string, Loaded>();

  constructor() {
    // Only a muted video may start by itself, and iPhones show one that is not inline in full screen.
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
    // Some files say nothing of their length, or a wrong one: the trial then knows how many frames there are.
    const frames = count(probe.duration * rate) ?? 0;
    const loaded = { address, fps: rate, frames, width: probe.videoWidth, height: probe.videoHeight };
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
    // The view must be kept before its first frame is uncovered.
    await kept;
    await rewound(this.video);
    const first_at_ms = await uncovered(this.video);
    const watch = watchFrames(this.video, clip.fps, first_at_ms);
    await playToEnd(this.video);
    this.video.style.visibility = "hidden";
    return {
      method: "video",
      clock_gap_ms: null,
      clock_late_ms: null,
      refresh_ms: null,
      ended_at_ms: absoluteNow(),
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
    // The browser holds the bytes until their address is revoked.
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

/** At its first frame, which is drawn: what is uncovered next is the clip's beginning. */
function rewound(video: HTMLVideoElement): Promise<void> {
  if (video.currentTime === 0 && !video.ended) return Promise.resolve();
  return new Promise((resolve, reject) => {
    const limit = setTimeout(() => reject(new ClipBroken("the video element did not go back to its first frame")), LOAD_LIMIT_MS);
    video.addEventListener(
      "seeked",
      () => {
        clearTimeout(limit);
        resolve();
      },
      { once: true },
    );
    video.currentTime = 0;
  });
}

/** Show the first frame; resolves with the time of the refresh that draws it. A hidden page gets no refreshes and does not wait. */
function uncovered(video: HTMLVideoElement): Promise<number> {
  video.style.visibility = "visible";
  return new Promise((resolve) => {
    const limit = setTimeout(() => resolve(absoluteNow()), REFRESH_LIMIT_MS);
    requestAnimationFrame(() => {
      clearTimeout(limit);
      resolve(absoluteNow());
    });
  });
}

/**
 * Log frames by requestVideoFrameCallback, whose callbacks begin with the second one: the first is on the screen, paused,
 * when it is uncovered. Where there is none, it is not known which frames were drawn.
 */
function watchFrames(
  video: HTMLVideoElement,
  fps: number,
  first_at_ms: number,
): { stop: () => Pick<ShownClip, "drawn" | "stalls" | "logs_frames" | "unlogged"> } {
  const drawn: [number, number][] = [[0, first_at_ms]];
  const unlogged = new Map<number, number>();
  let presented: number | null = null;
  const logs_frames = "requestVideoFrameCallback" in video;
  let stalls = 0;
  let going = true;
  const stalled = (): void => void (stalls += 1);
  const frame: VideoFrameRequestCallback = (_now, metadata) => {
    if (!going) return;
    const [index, at_ms] = [Math.round(metadata.mediaTime * fps), performance.timeOrigin + metadata.expectedDisplayTime];
    // For the paused first frame, the callback reports when it was decoded, long before it was uncovered.
    if (index > 0 && at_ms >= first_at_ms) {
      // A callback can come too late for its frame: the next one says how many were presented meanwhile.
      const between = Math.min(index - (drawn.at(-1)?.[0] ?? 0), metadata.presentedFrames - (presented ?? metadata.presentedFrames)) - 1;
      if (between > 0) unlogged.set(index, between);
      drawn.push([index, at_ms]);
    }
    presented = metadata.presentedFrames;
    video.requestVideoFrameCallback(frame);
  };
  if (logs_frames) video.requestVideoFrameCallback(frame);
  // The only sign of a stall where frames are not reported.
  video.addEventListener("waiting", stalled);
  return {
    stop: () => {
      going = false;
      video.removeEventListener("waiting", stalled);
      return { drawn, stalls, logs_frames, unlogged };
    },
  };
}
