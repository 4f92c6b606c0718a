/** A line of known pixels to be measured, or of known millimetres to be checked. */
import { plainNumber } from "../../ui/digits";
import type { Translate } from "../../i18n";
import { h, uniqueId } from "../../ui/element";
import { randomStart } from "./spread";

const MEASURED_LINE_PX = 378;
export const CHECK_LINE_MM = 100;
const SHORTEST_SHARE = 0.6;
const SHORTEST_MM = 20;
const LONGEST_MM = 400;

/** Length of a line to be measured, another one each time: with its end marks inside the window, also on a phone. */
export function measuredLinePx(last: number | null): number {
  const longest = Math.min(MEASURED_LINE_PX, window.innerWidth - 80);
  return Math.round(randomStart(SHORTEST_SHARE * longest, longest, last));
}

export function rulerLine(length_px: number): HTMLElement {
  const line = h("div", { class: "ruler-line", role: "img", "aria-label": "|—|" });
  line.style.width = `${length_px}px`;
  return h("div", { class: "ruler-space" }, line);
}

export interface LengthField {
  element: HTMLElement;
  value: () => number | null;
}

/** A field for a length in mm; `value` is null, and the reason is shown, where it cannot be one. */
export function lengthField(t: Translate): LengthField {
  const id = uniqueId("length");
  const fault = h("p", { class: "fault", id: `${id}-fault`, role: "alert" });
  const input = h("input", {
    id,
    type: "text",
    inputmode: "decimal",
    class: "short",
    autocomplete: "off",
    "aria-describedby": `${id}-fault`,
  });
  const element = h("div", { class: "field" }, h("label", { for: id }, t("ruler_length")), input, fault);
  return {
    element,
    value() {
      const length = Number(plainNumber(input.value).replace(",", "."));
      const good = length >= SHORTEST_MM && length <= LONGEST_MM;
      fault.textContent = good ? "" : t("ruler_bad", { minimum: SHORTEST_MM, maximum: LONGEST_MM });
      return good ? length : null;
    },
  };
}
