/** A bank card drawn on the screen, to be made as large as a real one: gives CSS pixels per millimetre. */
import type { Translate } from "../../i18n";
import { h, uniqueId } from "../../ui/element";
import { randomStart } from "./spread";
import { button } from "../../ui/page";

/** ISO/IEC 7810 ID-1. */
const CARD_WIDTH_MM = 85.6;
const CARD_HEIGHT_MM = 53.98;
const SHAPE = CARD_HEIGHT_MM / CARD_WIDTH_MM;
const SMALLEST_PX = 120;
const LARGEST_PX = 1_600;
/** Shown lengths begin between these: a card on screens of 54 to 152 pixels an inch. */
const START_PX = [180, 510] as const;
/** What a screen of 96 pixels an inch needs. */
export const USUAL_PX = (CARD_WIDTH_MM * 96) / 25.4;
/** A narrower window (a phone) cannot hold a card lying down, so there it stands upright. */
const UPRIGHT_BELOW_PX = 600;

export interface CardView {
  element: HTMLElement;
  px_per_mm: () => number;
  /** False while it has the size that it was first shown in: nobody has held a card against it. */
  touched: () => boolean;
}

/** The card of measurement `round`, in a size of its own: what an earlier one (`last`, px a mm) ended with is not shown again. */
export function cardView(t: Translate, round: number, last: number | null): CardView {
  const upright = window.innerWidth < UPRIGHT_BELOW_PX;
  const largest = upright ? (window.innerWidth - 60) / SHAPE : Math.min(LARGEST_PX, window.innerWidth - 110);
  /** Of the long side. */
  let length = randomStart(START_PX[0], Math.min(START_PX[1], largest), last === null ? null : last * CARD_WIDTH_MM);
  let touched = false;
  const id = uniqueId("card");
  const slider = h("input", { type: "range", id, min: SMALLEST_PX, max: Math.round(largest), step: 1 });
  const corner = h("span", { class: "card-corner", "aria-hidden": "true" });
  const card = h(
    "div",
    { class: upright ? "card card-upright" : "card" },
    h("span", { class: "card-chip" }),
    h("span", { class: "card-lines" }),
    corner,
  );
  const set = (next: number): void => {
    length = Math.min(largest, Math.max(SMALLEST_PX, next));
    const sides = [length, length * SHAPE];
    const [width = 0, height = 0] = upright ? sides.reverse() : sides;
    Object.assign(card.style, { width: `${width}px`, height: `${height}px` });
    slider.value = String(Math.round(length));
  };
  const change = (next: number): void => {
    touched = true;
    set(next);
  };
  slider.addEventListener("input", () => change(Number(slider.value)));
  dragCorner(corner, card, (width) => change(upright ? width / SHAPE : width));
  set(length);
  const row = h(
    "div",
    { class: "row" },
    button(t("card_smaller"), () => change(length - 1), "quiet"),
    slider,
    button(t("card_larger"), () => change(length + 1), "quiet"),
  );
  const element = h(
    "div",
    { class: "card-area", "data-round": round },
    h("div", { class: "card-space" }, card),
    h("label", { for: id, class: "help" }, t("card_slider")),
    row,
    h("p", { class: "help" }, t("card_hint")),
  );
  return { element, px_per_mm: () => length / CARD_WIDTH_MM, touched: () => touched };
}

function dragCorner(corner: HTMLElement, card: HTMLElement, set: (width: number) => void): void {
  corner.addEventListener("pointerdown", (event) => {
    corner.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  corner.addEventListener("pointermove", (event) => {
    if (!corner.hasPointerCapture(event.pointerId)) return;
    const box = card.getBoundingClientRect();
    const from = getComputedStyle(card).direction === "rtl" ? box.right - event.clientX : event.clientX - box.left;
    set(from);
  });
}
