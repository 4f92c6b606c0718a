/** A line between two labels: the browser's own slider, whose handle appears when it is first touched. */
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { scaleDirection } from "../../../ui/keys";
import type { Ask, Widget } from "../../kinds/clip_rating/answer";
import "./slider.css";

export function widget({ scale, question, language, t, meant, choose, enter }: Ask): Widget {
  if (scale.type !== "slider") throw new Error(`expected a slider, got ${scale.type}`);
  const { minimum, maximum, step, low, high, show_value } = scale;
  const dir = scaleDirection();
  const input = h("input", { type: "range", class: "slider", dir, min: minimum, max: maximum, step, "aria-labelledby": question });
  const ends = [pick(low, language), pick(high, language)];
  const number = h("b", { class: "slider-value" });

  function show(value: number | null): void {
    input.classList.toggle("untouched", value === null);
    if (value !== null) input.valueAsNumber = value;
    else input.value = String((minimum + maximum) / 2);
    const shown = value === null ? t("slider_untouched") : String(value);
    input.setAttribute("aria-valuetext", `${shown} (${minimum} ${ends[0]}, ${maximum} ${ends[1]})`);
    number.textContent = value === null ? "" : String(value);
  }
  const moved = (event: Event): void => choose(input.valueAsNumber, event.timeStamp);
  input.addEventListener("input", moved);
  // Without the press the browser does not move the handle; its release, wherever it is by then, answers nothing either.
  let refused = false;
  input.addEventListener("pointerdown", (event) => {
    refused = !meant.allows(event);
    if (refused) event.preventDefault();
  });
  // A press exactly where the hidden handle lies moves nothing, yet is an answer.
  input.addEventListener("click", (event) => {
    if (!refused) moved(event);
  });
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") enter();
  });
  show(null);
  return {
    parts: [
      input,
      h("div", { class: "ends", "aria-hidden": "true", dir }, h("span", {}, ends[0]), show_value ? number : null, h("span", {}, ends[1])),
    ],
    settles: false,
    show,
    pressed: () => null,
    focus: () => input.focus({ preventScroll: true }),
  };
}
