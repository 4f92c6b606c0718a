/**
 * Viewing distance by the blind spot ("virtual chinrest", Li, Joo, Yeatman & Reinecke 2020,
 * doi:10.1038/s41598-019-57204-1): with the left eye on the square, a dot going left vanishes at 13.5 degrees.
 */
import { plainNumber, isStartKey, listenKeys } from "../../ui/keys";
import { h, uniqueId, button, showPage, statusLine } from "../../ui/element";
import type { Session } from "../session";
import { choose, screenSignal, stopButton } from "../screens/support";

// How well repeated measurements agree, and where the next one begins.

/** Repeats that differ by more, in percent of their mean, are followed by one more. */
export const SPREAD_MAX_PERCENT = 4;
/** So many more than declared; then the spread is what it is, and stored. */
const FURTHER = 2;

export function mean(values: readonly number[]): number {
  return values.reduce((total, value) => total + value, 0) / values.length;
}

/** Largest less smallest, in percent of the mean. */
export function spreadPercent(values: readonly number[]): number {
  return ((Math.max(...values) - Math.min(...values)) / mean(values)) * 100;
}

/** Standard deviation (n - 1); 0 of fewer than two. */
export function deviation(values: readonly number[]): number {
  if (values.length < 2) return 0;
  const middle = mean(values);
  return Math.sqrt(values.reduce((total, value) => total + (value - middle) ** 2, 0) / (values.length - 1));
}

/** The measurements that count: the last `repeats`. Null where one more is needed. */
export function settled(values: readonly number[], repeats: number): number[] | null {
  const last = values.slice(-repeats);
  if (last.length < repeats) return null;
  return spreadPercent(last) <= SPREAD_MAX_PERCENT || values.length >= repeats + FURTHER ? last : null;
}

/** A length to begin with, anywhere from `smallest` to `largest` but at least a tenth away from where the last one ended. */
export function randomStart(smallest: number, largest: number, last: number | null, random: () => number = Math.random): number {
  for (let tries = 0; tries < 20; tries += 1) {
    const start = smallest + (largest - smallest) * random();
    if (last === null || Math.abs(start - last) > last / 10) return start;
  }
  return smallest;
}

const BLIND_SPOT_DEGREES = 13.5;
const ROUNDS = 5;
const SPEED_PX_PER_MS = 0.1;
const NEAREST_MM = 200;
const FURTHEST_MM = 2_000;
/** The window must let the dot vanish at least for somebody who sits this near; a phone's does not. */
const NEEDED_MM = 400;
const SIDES_PX = 100;
/** The dot starts this far from the square, well inside the blind spot's near edge. */
const START_MM = 40;

export function distanceFrom(separation_px: number, px_per_mm: number): number {
  return separation_px / px_per_mm / Math.tan((BLIND_SPOT_DEGREES * Math.PI) / 180);
}

/** Distance from the eyes to the screen, in mm. */
export interface Distance {
  viewing_distance_mm: number;
  distance_method: "blind_spot" | "typed";
  /** Standard deviation of the rounds; null where it was typed in. */
  distance_spread_mm: number | null;
  distance_typed_mm: number | null;
}

/** The median of the rounds, or as typed in, where the window is too narrow at once. */
export async function measureDistance(session: Session, display: HTMLElement, px_per_mm: number): Promise<Distance> {
  if (distanceFrom(window.innerWidth - SIDES_PX, px_per_mm) < NEEDED_MM) return typed(session, display);
  const distances_mm: number[] = [];
  for (let remark = ""; distances_mm.length < ROUNDS;) {
    const separation = await oneRound(session, display, px_per_mm, distances_mm.length + 1, remark);
    if (separation === "type") return typed(session, display);
    const distance = separation === null ? 0 : distanceFrom(separation, px_per_mm);
    const counts = distance >= NEAREST_MM && distance <= FURTHEST_MM;
    if (counts) distances_mm.push(distance);
    remark = counts ? "" : session.t("distance_missed");
  }
  const viewing_distance_mm = Math.round(distances_mm.sort((a, b) => a - b)[Math.floor(ROUNDS / 2)] ?? 0);
  const distance_spread_mm = Math.round(deviation(distances_mm) * 10) / 10;
  return { viewing_distance_mm, distance_method: "blind_spot", distance_spread_mm, distance_typed_mm: null };
}

async function oneRound(
  session: Session,
  display: HTMLElement,
  px_per_mm: number,
  round: number,
  remark: string,
): Promise<number | "type" | null> {
  const { t } = session;
  const dot = h("span", { class: "blind-dot" });
  const field = h("div", { class: "blind-field", dir: "ltr", "aria-hidden": "true" }, dot, h("span", { class: "blind-square" }));
  const footer = h("footer", { class: "actions" });
  const status = statusLine();
  status.textContent = remark;
  const body = [h("p", {}, t("distance_text", { times: ROUNDS })), field, status, footer];
  const section = showPage(display, {
    title: t("distance_title"),
    eyebrow: t("distance_round", { round, times: ROUNDS }),
    body,
    wide: true,
  });
  section.classList.add("calibration");
  section.append(stopButton(session));
  const step = await choose(
    session,
    footer,
    [
      { label: t("distance_start"), value: "go" },
      { label: t("distance_type"), value: "type", kind: "plain" },
    ],
    "always",
  );
  if (step === "type") return "type";
  footer.replaceChildren();
  return moveDot(session, dot, field, footer, START_MM * px_per_mm);
}

/** The dot goes left until a press; resolves with its distance from the square, or null at the edge. */
function moveDot(session: Session, dot: HTMLElement, field: HTMLElement, footer: HTMLElement, start_px: number): Promise<number | null> {
  const { signal, done } = screenSignal(session);
  return new Promise((resolve) => {
    const room = field.clientWidth - 40;
    const began = performance.now();
    const separation = (): number => start_px + (performance.now() - began) * SPEED_PX_PER_MS;
    const end = (value: number | null): void => {
      done();
      resolve(value);
    };
    const move = (): void => {
      if (signal.aborted) return;
      if (separation() > room) return end(null);
      dot.style.insetInlineEnd = `${separation()}px`;
      requestAnimationFrame(move);
    };
    footer.append(button(session.t("distance_gone"), () => end(separation())));
    listenKeys((event) => {
      if (!isStartKey(event)) return;
      event.preventDefault();
      end(separation());
    }, signal);
    move();
  });
}

async function typed(session: Session, display: HTMLElement): Promise<Distance> {
  const { t } = session;
  const id = uniqueId("distance");
  const fault = h("p", { class: "fault", id: `${id}-fault`, role: "alert" });
  const input = h("input", { id, type: "text", inputmode: "numeric", class: "short", "aria-describedby": `${id}-fault`, value: "60" });
  const footer = h("footer", { class: "actions" });
  const field = h("div", { class: "field" }, h("label", { for: id }, t("distance_cm")), input, fault);
  showPage(display, { title: t("distance_title"), body: [field, footer] }).classList.add("calibration");
  for (;;) {
    footer.replaceChildren();
    await choose(session, footer, [{ label: t("continue"), value: true }]);
    const distance_mm = Number(plainNumber(input.value).replace(",", ".")) * 10;
    if (distance_mm >= NEAREST_MM && distance_mm <= FURTHEST_MM) return asTyped(Math.round(distance_mm));
    fault.textContent = t("distance_bad", { minimum: NEAREST_MM / 10, maximum: FURTHEST_MM / 10 });
  }
}

export function asTyped(distance_mm: number): Distance {
  return { viewing_distance_mm: distance_mm, distance_method: "typed", distance_spread_mm: null, distance_typed_mm: distance_mm };
}
