/** How many pixels a millimeter has here: by card or ruler, more than once, checked, and large enough for the clip. */
import type { Translate } from "../../i18n";
import { h, uniqueId, button, showPage, statusLine, alertLine } from "../../ui/element";
import { randomStart, asTyped, measureDistance, mean, settled, spreadPercent, SPREAD_MAX_PERCENT } from "./distance";
import { plainNumber } from "../../ui/keys";
import type { CalibrationState, TrialInfo } from "../../api/schema";
import { untilMeasured } from "../screen/window";
import { calibrationBody, clipWidth, type Distance, isPlausible, type Measured, NO_DISTANCE } from "../screen/size";
import { choose, noDevice, saveShown, screenOut, stopButton } from "../screens/support";
import type { Session } from "../session";
import "./calibration.css";

// A bank card drawn on the screen, to be made as large as a real one: gives CSS pixels per millimeter.

/** ISO/IEC 7810 ID-1. */
const CARD_WIDTH_MM = 85.6;
const CARD_HEIGHT_MM = 53.98;
const SHAPE = CARD_HEIGHT_MM / CARD_WIDTH_MM;
const SMALLEST_PX = 120;
const LARGEST_PX = 1_600;
/** Shown lengths begin between these: a card on screens of 54 to 152 pixels per inch. */
const START_PX = [180, 510] as const;
/** What a screen of 96 pixels per inch needs. */
const USUAL_PX = (CARD_WIDTH_MM * 96) / 25.4;
/** A narrower window (a phone) cannot hold a card lying down, so there it stands upright. */
const UPRIGHT_BELOW_PX = 600;

export interface CardView {
  element: HTMLElement;
  px_per_mm: () => number;
  /** False while it has the size that it was first shown in: nobody has held a card against it. */
  touched: () => boolean;
}

/** The card of measurement `round`, in a new size: the final size of an earlier one (`last`, px per mm) is not shown again. */
function cardView(t: Translate, round: number, last: number | null): CardView {
  const upright = window.innerWidth < UPRIGHT_BELOW_PX;
  const largest = upright ? (window.innerWidth - 60) / SHAPE : Math.min(LARGEST_PX, window.innerWidth - 110);
  /** Length of the long side. */
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

// A hand that holds a card flat against a screen: line art in the page's own ink, so that it reads on any surround.

const SVG = "http://www.w3.org/2000/svg";

function shape(tag: string, attributes: Record<string, string | number>): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

/** The four fingers lie behind the card's lower edge, the thumb in front of it. */
const FINGERS = [
  "M118 158 C112 140 108 126 108 112 a7 7 0 0 1 14 -2 l5 22",
  "M127 132 l-3 -28 a7 7 0 0 1 14 -1 l5 27",
  "M143 130 l-1 -24 a7 7 0 0 1 14 0 l2 26",
  "M158 132 l1 -18 a6.5 6.5 0 0 1 13 1 l-1 27",
];
const PALM = "M118 158 C122 170 126 178 132 186 L132 196 M171 142 C173 160 170 176 164 186 L164 196";
const THUMB = "M118 158 C108 150 96 142 86 138 a7 7 0 0 1 5 -13 C102 128 112 134 120 141";

function handWithCard(label: string): SVGElement {
  const picture = shape("svg", { class: "hand", viewBox: "0 0 200 200", role: "img", "aria-label": label });
  const line = { fill: "none", stroke: "currentColor", "stroke-width": 2.5, "stroke-linecap": "round", "stroke-linejoin": "round" };
  const skin = { ...line, fill: "var(--panel)" };
  picture.append(
    shape("rect", { ...line, x: 8, y: 8, width: 184, height: 122, rx: 5 }),
    shape("path", { ...line, d: "M84 130 v18 M70 150 h28" }),
    // The drawn card, dashed, and the real one laid on it.
    shape("rect", { ...line, x: 40, y: 34, width: 96, height: 61, rx: 5, "stroke-dasharray": "5 5" }),
    ...FINGERS.map((d) => shape("path", { ...skin, d })),
    shape("rect", { ...skin, class: "hand-card", x: 46, y: 40, width: 96, height: 61, rx: 5 }),
    shape("rect", { ...line, x: 56, y: 58, width: 15, height: 11, rx: 2 }),
    shape("path", { ...line, d: "M56 86 h46" }),
    shape("path", { ...skin, d: PALM }),
    shape("path", { ...skin, d: THUMB }),
  );
  return picture;
}

// A line of known pixels to be measured, or of known millimeters to be checked.

const MEASURED_LINE_PX = 378;
const CHECK_LINE_MM = 100;
const SHORTEST_SHARE = 0.6;
const SHORTEST_MM = 20;
const LONGEST_MM = 400;

/** Length of a line to be measured, another one each time: with its end marks inside the window, also on a phone. */
function measuredLinePx(last: number | null): number {
  const longest = Math.min(MEASURED_LINE_PX, window.innerWidth - 80);
  return Math.round(randomStart(SHORTEST_SHARE * longest, longest, last));
}

function rulerLine(length_px: number): HTMLElement {
  const line = h("div", { class: "ruler-line", role: "img", "aria-label": "|—|" });
  line.style.width = `${length_px}px`;
  return h("div", { class: "ruler-space" }, line);
}

export interface LengthField {
  element: HTMLElement;
  value: () => number | null;
}

/** A field for a length in mm; `value` is null, and the reason is shown, where it cannot be one. */
function lengthField(t: Translate): LengthField {
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

type Occasion = CalibrationState["occasion"];
type Method = CalibrationState["method"];
interface Done {
  px_per_mm: number | null;
  method: string;
  checked: boolean;
}
/** One measurement, or what was chosen instead. */
type Once = number | "other" | "skip";

/** One place on the way: where it is shown, and which measurement of how many it is. */
interface Turn {
  session: Session;
  display: HTMLElement;
  eyebrow: string;
  round: number;
  times: number;
  /** px per mm of the measurement before. */
  last: number | null;
  /** What is to be said first, such as that the last two differ. */
  remark: string;
}

const SIMULATED_PX_PER_MM = 96 / 25.4;
const SIMULATED_DISTANCE_MM = 600;

export async function simulate({ screen, run, api }: Session): Promise<Done> {
  const measured: Measured = {
    px_per_mm: SIMULATED_PX_PER_MM,
    method: "card",
    repeats: run.display.calibration_repeats,
    spread_percent: 0,
    ruler_check: null,
  };
  const distance = run.display.viewing_distance ? asTyped(SIMULATED_DISTANCE_MM) : NO_DISTANCE;
  screen.calibration = calibrationBody(measured, distance, "first");
  await api.calibration(screen.calibration);
  return { px_per_mm: screen.calibration.px_per_mm, method: measured.method, checked: false };
}

/** Presses what goes on, page after page, as long as this screen lasts. */
export function act(display: HTMLElement): void {
  const timer = setInterval(() => {
    // Nobody sits there whose blind spot could be found, so the distance is typed in.
    const typed = display.querySelector(".blind-field") && display.querySelector<HTMLButtonElement>(".actions .plain");
    const primary = typed || display.querySelector<HTMLButtonElement>(".calibration .primary");
    const slider = display.querySelector<HTMLInputElement>(".card-area input");
    if (slider) slider.value = String(Math.round(USUAL_PX));
    slider?.dispatchEvent(new Event("input"));
    if (primary) primary.click();
    else clearInterval(timer);
  }, 200);
}

export async function calibrate(session: Session, display: HTMLElement, eyebrow: string, occasion: Occasion): Promise<Done> {
  const before = session.screen.calibration;
  let recheck_percent: number | null = null;
  if (occasion === "recheck" && before) {
    recheck_percent = await lookAgain(session, display, before);
    const holds = recheck_percent <= SPREAD_MAX_PERCENT;
    if (holds) return keep(session, display, { ...before, occasion, recheck_percent }, true);
    await showNotice(session, display, "recheck_title", session.t("recheck_differs", { percent: Math.round(recheck_percent) }));
  }
  if (occasion === "screen_changed") {
    await showNotice(session, display, "screen_changed_title", session.t("screen_changed"));
    // While the card is measured, which takes longer: the other screen may refresh at another rate.
    void untilMeasured(document, (rate) => (session.screen.refresh_rate_hz = rate), session.over.signal);
  }
  const measured = await measureUntilItFits(session, display, eyebrow);
  if (!measured) return { px_per_mm: null, method: "", checked: false };
  const known = before?.viewing_distance_mm != null ? distanceOf(before) : null;
  const wants = session.run.display.viewing_distance;
  const distance = wants ? (known ?? (await measureDistance(session, display, measured.px_per_mm))) : NO_DISTANCE;
  return keep(session, display, { ...calibrationBody(measured, distance, occasion), recheck_percent }, false);
}

function distanceOf(before: CalibrationState): Distance {
  const { viewing_distance_mm, distance_method, distance_spread_mm, distance_typed_mm } = before;
  return { viewing_distance_mm, distance_method, distance_spread_mm, distance_typed_mm };
}

async function keep(session: Session, display: HTMLElement, body: CalibrationState, checked: boolean): Promise<Done> {
  session.screen.calibration = body;
  await saveShown(session, display.querySelector<HTMLElement>(".status") ?? statusLine(), session.api.calibration(body));
  return { px_per_mm: body.px_per_mm, method: body.method, checked };
}

async function showNotice(session: Session, display: HTMLElement, title: TitleKey, text: string): Promise<void> {
  const footer = h("footer", { class: "actions" });
  page({ session, display, eyebrow: "" }, title, [h("p", {}, text), footer]);
  await choose(session, footer, [{ label: session.t("measure_again"), value: true }]);
}

/** One measurement by the earlier method; by how much it differs, in percent. */
async function lookAgain(session: Session, display: HTMLElement, before: CalibrationState): Promise<number> {
  const turn: Turn = { session, display, eyebrow: "", round: 1, times: 1, last: before.px_per_mm, remark: "" };
  for (let method = before.method; ; method = method === "card" ? "ruler" : "card") {
    const once = await (method === "card" ? byCard(turn) : byRuler(turn));
    if (once === "skip") return 0;
    if (once !== "other") return (Math.abs(once - before.px_per_mm) / before.px_per_mm) * 100;
  }
}

async function measureUntilItFits(session: Session, display: HTMLElement, eyebrow: string): Promise<Measured | null> {
  for (let method: Method = "card"; ;) {
    const measured = await repeated(session, display, eyebrow, method);
    if (measured === "skip") return null;
    if (measured === "other") method = method === "card" ? "ruler" : "card";
    else {
      const ruler_check = method === "card" ? await checkedByRuler(session, display, eyebrow, measured.px_per_mm) : null;
      // Somebody with a ruler measures with it: a second card would only differ from the first.
      if (ruler_check === "differs") method = "ruler";
      else if (await fits(session, display, measured)) return { ...measured, ruler_check };
    }
  }
}

/** As many measurements as declared, and further ones as long as they differ. */
async function repeated(session: Session, display: HTMLElement, eyebrow: string, method: Method): Promise<Measured | "other" | "skip"> {
  const { calibration_repeats: repeats } = session.run.display;
  const all: number[] = [];
  let remark = "";
  for (;;) {
    const times = Math.max(repeats, all.length + 1);
    const turn: Turn = { session, display, eyebrow, round: all.length + 1, times, last: all.at(-1) ?? null, remark };
    const once = await (method === "card" ? byCard(turn) : byRuler(turn));
    if (typeof once === "string") return once;
    all.push(once);
    const counting = settled(all, repeats);
    const spread_percent = Math.round(spreadPercent(counting ?? all) * 100) / 100;
    if (counting) return { px_per_mm: mean(counting), method, repeats: all.length, spread_percent, ruler_check: null };
    remark = session.t(all.length < repeats ? "size_again" : "size_differs", { percent: Math.round(spreadPercent(all.slice(-repeats))) });
  }
}

async function byCard(turn: Turn): Promise<Once> {
  const { session, round, last } = turn;
  const { t, run } = session;
  const card = cardView(t, round, last);
  const footer = h("footer", { class: "actions" });
  const alert = alertLine();
  const intro =
    round > 1
      ? h("p", { role: "status" }, turn.remark)
      : h(
          "div",
          { class: "card-intro" },
          handWithCard(t("card_picture")),
          h("div", {}, h("p", {}, t("card_text")), h("p", { class: "help" }, t("card_why"))),
        );
  page(turn, "card_title", [intro, card.element, alert, footer]);
  const skip = run.display.calibrate === "optional" ? [{ label: t("skip"), value: "skip" as const, kind: "plain" as const }] : [];
  const other = { label: t("card_none"), value: "other" as const };
  for (;;) {
    footer.replaceChildren();
    const step = await choose<"fits" | "other" | "skip">(session, footer, [{ label: t("card_fits"), value: "fits" }, other, ...skip]);
    if (step !== "fits") return step;
    if (!card.touched()) alert.textContent = t("card_untouched");
    else if (!isPlausible(card.px_per_mm())) alert.textContent = implausible(session, card.px_per_mm());
    else return card.px_per_mm();
  }
}

async function byRuler(turn: Turn): Promise<Once> {
  const { session, last, remark } = turn;
  const { t } = session;
  const field = lengthField(t);
  const line_px = measuredLinePx(null);
  const alert = alertLine();
  const footer = h("footer", { class: "actions" });
  const intro = last === null || !remark ? h("p", {}, t("ruler_text")) : h("p", { role: "status" }, remark);
  page(turn, "ruler_title", [intro, rulerLine(line_px), field.element, alert, footer]);
  for (;;) {
    footer.replaceChildren();
    const step = await choose(session, footer, [
      { label: t("continue"), value: "measured" },
      { label: t("use_card"), value: "other" },
    ]);
    if (step === "other") return "other";
    const length_mm = field.value();
    if (length_mm === null) continue;
    if (isPlausible(line_px / length_mm)) return line_px / length_mm;
    alert.textContent = implausible(session, line_px / length_mm);
  }
}

/** A second look with a ruler, for people who have one. */
async function checkedByRuler(
  session: Session,
  display: HTMLElement,
  eyebrow: string,
  px_per_mm: number,
): Promise<NonNullable<Measured["ruler_check"]>> {
  const { t } = session;
  const length_mm = Math.min(CHECK_LINE_MM, Math.floor((window.innerWidth - 80) / px_per_mm / 10) * 10);
  const footer = h("footer", { class: "actions" });
  const text = h("p", {}, t("ruler_check_text", { length: length_mm }));
  page({ session, display, eyebrow }, "ruler_check_title", [text, rulerLine(length_mm * px_per_mm), footer]);
  return choose<NonNullable<Measured["ruler_check"]>>(session, footer, [
    { label: t("ruler_ok"), value: "agrees" },
    { label: t("ruler_none"), value: "no_ruler" },
    { label: t("ruler_differs"), value: "differs" },
  ]);
}

function implausible({ t }: Session, px_per_mm: number): string {
  return t("size_implausible", { width: Math.round(window.screen.width / px_per_mm / 10) });
}

/** The widest clip must fit the window at its real size; says so and offers ways out where it does not. */
async function fits(session: Session, display: HTMLElement, measured: Measured): Promise<boolean> {
  const { t, run } = session;
  const width = widestClip(run.trials, run.display.inter_ocular_mm, measured.px_per_mm);
  if (width <= window.innerWidth) return true;
  const footer = h("footer", { class: "actions" });
  const values = { width: Math.round(width), have: window.innerWidth };
  const alert = alertLine();
  page({ session, display, eyebrow: "" }, "clip_too_large_title", [alert, footer]);
  alert.textContent = t("clip_too_large", values);
  session.events.add("unsupported", { reason: "clip_too_large", ...values });
  const choices = [{ label: t("measure_again"), value: true }, ...noDevice(session, false)];
  if (!(await choose(session, footer, choices))) await screenOut(session, "clip_too_large", values);
  return false;
}

function widestClip(trials: readonly TrialInfo[], inter_ocular_mm: number, px_per_mm: number): number {
  const clips = trials.filter((trial) => trial.clip_sha256 !== null);
  return clips.reduce((widest, trial) => Math.max(widest, clipWidth(trial, inter_ocular_mm, px_per_mm)), 0);
}

function page(
  { session, display, eyebrow, round, times }: Pick<Turn, "session" | "display" | "eyebrow"> & Partial<Turn>,
  title: TitleKey,
  body: HTMLElement[],
): void {
  const { t } = session;
  const counted = round && times && times > 1 ? t("size_round", { round, times }) : "";
  const above = [eyebrow, counted].filter(Boolean).join(" · ");
  const section = showPage(display, { title: t(title), eyebrow: above, body: [...body, statusLine()], wide: true });
  section.classList.add("calibration");
  section.append(stopButton(session));
}
type TitleKey = "card_title" | "ruler_title" | "ruler_check_title" | "clip_too_large_title" | "recheck_title" | "screen_changed_title";
