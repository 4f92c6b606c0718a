/** What shows clips: the worker where the browser has WebCodecs, else an ordinary video element. */
import type { Showing } from "./record";

export interface Prepared {
  frames: number;
  width: number;
  height: number;
  fps: number;
}
/** A prepared clip and its place on a canvas of several, in that canvas's pixels. */
export interface Part {
  sha256: string;
  x: number;
  y: number;
  width: number;
  height: number;
}
/** What the player itself knows of a showing; the page adds what happened around it. */
export type ShownClip = Omit<Showing, "key_at_ms" | "focus_lost" | "disturbances" | "visible_share">;
export interface PlayOptions {
  fixation_ms: number;
  refresh_ms: number;
  /** No frame is drawn before this. */
  ready?: Promise<void>;
}

/** The clip cannot be decoded or drawn here. */
export class ClipBroken extends Error {
  override name = "ClipBroken";
}

export interface ClipPlayer {
  readonly method: "webcodecs" | "video";
  /** The element that shows the clip; it is the same one for every trial. */
  readonly element: HTMLElement;
  /** Make a clip ready to start at once. Rejects with ClipBroken. */
  prepare(sha256: string, bytes: ArrayBuffer, fps: number | null): Promise<Prepared>;
  /**
   * Put prepared clips on one canvas under a name of its own: it is then played as a clip, one clock drawing frame k of
   * each in the same refresh. A shorter one holds its last frame. Rejects with ClipBroken.
   */
  compose(name: string, parts: readonly Part[], width: number, height: number): Promise<Prepared>;
  /** Give the element this clip's own pixel size and the surround's colour. */
  blank(sha256: string): void;
  /** Show a prepared clip from the next screen refresh on; resolves after its last frame. */
  play(sha256: string, options: PlayOptions): Promise<ShownClip>;
  release(sha256: string): void;
}
