/** The place of the clip: at actual size, always at the same spot, with marks at its corners between plays. */
import type { TrialInfo } from "../../../api/schema";
import type { MessageKey } from "../../../i18n";
import { h } from "../../../ui/element";
import { clipHeight, clipWidth } from "../../screen/size";
import { stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { layout, type Layout } from "../../views/disturbances";

export interface Size {
  width: number;
  height: number;
}
export interface Stage {
  element: HTMLElement;
  /** Where the prompt, the scale and the feedback appear, below the clip. */
  below: HTMLElement;
  setPlaying(playing: boolean): void;
  /** Give the clip its size in the window as it is now. */
  fit: () => void;
  layout: Layout;
}

function stage(clip: HTMLElement, size: () => Size, name: string): Stage {
  const marks = ["tl", "tr", "bl", "br"].map((corner) => h("i", { class: `mark mark-${corner}` }));
  const frame = h("div", { class: "clip", role: "img", "aria-label": name }, clip, ...marks);
  const fit = (): void => {
    const { width, height } = size();
    frame.style.width = `${width}px`;
    frame.style.height = `${height}px`;
  };
  fit();
  const below = h("div", { class: "below" });
  const element = h("section", { class: "trial" }, h("div", { class: "above" }), frame, below);
  return { element, below, setPlaying: (playing) => element.classList.toggle("playing", playing), fit, layout: layout() };
}

/** Actual size, whatever the window is; where no size was measured it is at most as wide as the window. */
export function inWindow({ screen }: Session, { width, height }: Size): Size {
  const scale = screen.px_per_mm === null ? Math.min(1, window.innerWidth / width) : 1;
  return { width: width * scale, height: height * scale };
}

/** The size of one clip. */
export function clipSize(session: Session, trial: TrialInfo): Size {
  const width = clipWidth(trial, session.run.display.inter_ocular_mm, session.screen.px_per_mm);
  return inWindow(session, { width, height: clipHeight(trial, width) });
}

/** The place of clips of this size, with the way out, as all that is on the screen. */
export function showStage(session: Session, display: HTMLElement, size: () => Size, name: MessageKey = "clip_name"): Stage {
  const clipStage = stage(session.player.element, size, session.t(name));
  clipStage.element.append(stopButton(session));
  display.replaceChildren(clipStage.element);
  return clipStage;
}
