/** A bank card drawn on the screen, to be made as large as a real one: gives CSS pixels per millimetre. */
import type { Translate } from "../../i18n";
import { h, uniqueId } from "../../ui/element";
import { button } from "../../ui/page";

/** ISO/IEC 7810 ID-1. */
export const CARD_WIDTH_MM = 85.6;
export const CARD_HEIGHT_MM = 53.98;
const SMALLEST_PX = 120;
const START_PX = (CARD_WIDTH_MM * 96) / 25.4;

export interface CardView { element: HTMLElement; px_per_mm: () => number }

export function cardView(t: Translate, start_px_per_mm: number | null): CardView {
  const largest = Math.max(400, Math.min(1_600, window.innerWidth - 110));
  let width = start_px_per_mm ? start_px_per_mm * CARD_WIDTH_MM : START_PX;
  const id = uniqueId("card");
  const slider = h("input", { type: "range", id, min: SMALLEST_PX, max: Math.round(largest), step: 1 });
  const corner = h("span", { class: "card-corner", "aria-hidden": "true" });
  const card = h("div", { class: "card" }, h("span", { class: "card-chip" }), h("span", { class: "card-lines" }), corner);
  const set = (next: number): void => {
    width = Math.min(largest, Math.max(SMALLEST_PX, next));
    card.style.width = `${width}px`;
    card.style.height = `${(width * CARD_HEIGHT_MM) / CARD_WIDTH_MM}px`;
    slider.value = String(Math.round(width));
  };
  slider.addEventListener("input", () => set(Number(slider.value)));
  dragCorner(corner, card, set);
  set(width);
  const row = h("div", { class: "row" }, button(t("card_smaller"), () => set(width - 1), "quiet"), slider, button(t("card_larger"), () => set(width + 1), "quiet"));
  const element = h("div", { class: "card-area" }, h("div", { class: "card-space" }, card),
    h("label", { for: id, class: "help" }, t("card_slider")), row, h("p", { class: "help" }, t("card_hint")));
  return { element, px_per_mm: () => width / CARD_WIDTH_MM };
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
