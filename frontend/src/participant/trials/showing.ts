/** A clip's stage, and one showing on it: waits for the start key, plays, and notes what disturbed it. */
import type { TrialInfo } from "../../api/schema";
import type { MessageKey } from "../../i18n";
import { h, button } from "../../ui/element";
import { clipHeight, clipWidth } from "../screen/size";
import { stopButton, screenSignal } from "../screens/support";
import type { Session } from "../session";
import { layout, type Layout, refreshDropped, watchDisturbances } from "../views/disturbances";
import { clickNothing, isStartKey, listenKeys, MeantPress } from "../../ui/keys";
import type { Showing } from "../playback/record";

// The place of the clip: at actual size, always at the same spot, with marks at its corners between plays.

export interface Size {
  width: number;
  height: number;
}
interface Fitted extends Size {
  /** Smaller than its own pixels, since the window is narrower. */
  is_scaled_down: boolean;
}
export interface Stage {
  element: HTMLElement;
  /** Where the prompt, the scale and the feedback appear, below the clip. */
  below: HTMLElement;
  setPlaying(playing: boolean): void;
  /** Give the clip its size in the window as it is now. */
  fit: () => void;
  isScaledDown: () => boolean;
  layout: Layout;
}

function stage(clip: HTMLElement, size: () => Fitted, name: string): Stage {
  const marks = ["tl", "tr", "bl", "br"].map((corner) => h("i", { class: `mark mark-${corner}` }));
  const frame = h("div", { class: "clip", role: "img", "aria-label": name }, clip, ...marks);
  let scaled_down = false;
  const fit = (): void => {
    const { width, height, is_scaled_down } = size();
    scaled_down = is_scaled_down;
    frame.style.width = `${width}px`;
    frame.style.height = `${height}px`;
  };
  fit();
  const below = h("div", { class: "below" });
  const element = h("section", { class: "trial" }, h("div", { class: "above" }), frame, below);
  const setPlaying = (playing: boolean): void => void element.classList.toggle("playing", playing);
  return { element, below, setPlaying, fit, isScaledDown: () => scaled_down, layout: layout() };
}

/** Actual size, whatever the window is; where no size was measured it is at most as wide as the window. `own` is its width in its own pixels. */
export function inWindow({ screen }: Session, { width, height }: Size, own = width): Fitted {
  if (screen.px_per_mm !== null) return { width, height, is_scaled_down: false };
  const scale = Math.min(1, window.innerWidth / width);
  return { width: width * scale, height: height * scale, is_scaled_down: Math.round(width * scale) < own };
}

/** The size of one clip. */
export function clipSize(session: Session, trial: TrialInfo): Fitted {
  const width = clipWidth(trial, session.run.display.inter_ocular_mm, session.screen.px_per_mm);
  return inWindow(session, { width, height: clipHeight(trial, width) });
}

/** The place of clips of this size, with the way out, as all that is on the screen. */
export function showStage(session: Session, display: HTMLElement, size: () => Fitted, name: MessageKey = "clip_name"): Stage {
  const clipStage = stage(session.player.element, size, session.t(name));
  clipStage.element.append(stopButton(session));
  display.replaceChildren(clipStage.element);
  return clipStage;
}

// One showing of a clip: waits for the start key, plays, and notes what disturbed it.

export interface Shown extends Showing {
  early_keys: number;
}

const FALLBACK_REFRESH_MS = 1000 / 60;

/** The ready screen; resolves with the time of the press that starts the clip (absolute, ms). */
export function waitForStart(
  session: Session,
  stage: Stage,
  prompt: string,
  note: string,
  pointer_delay_ms: number,
  left?: AbortSignal,
): Promise<number> {
  const { signal, done } = screenSignal(session);
  left?.addEventListener("abort", done);
  const { t } = session;
  return new Promise((resolve) => {
    const meant = new MeantPress(pointer_delay_ms, signal);
    const start = (event: Event): void => {
      if (!meant.allows(event)) return;
      done();
      // The time of the press itself: a busy page may come to handle it later.
      resolve(performance.timeOrigin + event.timeStamp);
    };
    const go = button(t("start"), () => {});
    go.addEventListener("click", start, { signal });
    stage.below.replaceChildren(h("h1", { class: "ready" }, prompt), go, h("p", { class: "count" }, note));
    stage.element.querySelector(".clip")?.addEventListener("click", start, { signal });
    const pressed = (event: KeyboardEvent): void => {
      if (!isStartKey(event)) return;
      clickNothing(event);
      start(event);
    };
    listenKeys(pressed, signal, go);
    window.addEventListener("resize", stage.fit, { signal });
    stage.fit();
    go.focus({ preventScroll: true });
  });
}

/** Play the prepared clip once, with nothing else on the screen, and not before `kept`: the view is on disk first. */
export async function showOnce(
  session: Session,
  stage: Stage,
  sha256: string,
  key_at_ms: number,
  fixation_ms: number,
  kept: Promise<void>,
  label = "",
): Promise<Shown> {
  const { player, screen, t } = session;
  const { signal, done } = screenSignal(session);
  let early_keys = 0;
  document.addEventListener(
    "keydown",
    (event) => {
      // A key that is held down repeats by itself, which is one early press and not many.
      if (!event.repeat && event.key.length === 1) early_keys += 1;
      // The browser would scroll the page by a space.
      if (event.key === " ") event.preventDefault();
    },
    { signal },
  );
  stage.setPlaying(true);
  stage.below.replaceChildren(h("p", { class: label ? "count" : "spoken", role: "status" }, label || t("clip_playing")));
  const watched = watchDisturbances(player.element, stage.layout);
  const refresh_ms = screen.refresh_rate_hz ? 1000 / screen.refresh_rate_hz : FALLBACK_REFRESH_MS;
  try {
    const shown = await player.play(sha256, { fixation_ms, refresh_ms, ready: kept });
    const { counts, focus_lost, visible_share } = watched.stop();
    const dropped = screen.refresh_rate_hz !== null && refreshDropped(shown.refresh_ms, refresh_ms);
    const disturbances = { ...counts, ...(stage.isScaledDown() && { clip_scaled_down: 1 }), ...(dropped && { refresh_dropped: 1 }) };
    return { ...shown, key_at_ms, focus_lost, visible_share, disturbances, early_keys };
  } finally {
    // Also where the play has failed: nothing is watched beyond it.
    watched.stop();
    done();
    stage.setPlaying(false);
  }
}

// Above a scale that a reload has brought back: the clip is not shown a second time.

export function sayAlreadySeen(session: Session, stage: Stage): void {
  stage.element.querySelector(".above")?.replaceChildren(h("p", { role: "status" }, session.t("already_seen")));
}
