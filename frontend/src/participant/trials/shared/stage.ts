/** The place of the clip: at actual size, always at the same spot, with marks at its corners between plays. */
import { h } from "../../../ui/element";

export interface Stage {
  element: HTMLElement;
  /** Where the prompt, the scale and the feedback appear, below the clip. */
  below: HTMLElement;
  setPlaying(playing: boolean): void;
}

export function stage(clip: HTMLElement, width_px: number, height_px: number, name: string): Stage {
  const marks = ["tl", "tr", "bl", "br"].map((corner) => h("i", { class: `mark mark-${corner}` }));
  const frame = h("div", { class: "clip", role: "img", "aria-label": name }, clip, ...marks);
  frame.style.width = `${width_px}px`;
  frame.style.height = `${height_px}px`;
  const below = h("div", { class: "below" });
  const element = h("section", { class: "trial" }, h("div", { class: "above" }), frame, below);
  return { element, below, setPlaying: (playing) => element.classList.toggle("playing", playing) };
}
