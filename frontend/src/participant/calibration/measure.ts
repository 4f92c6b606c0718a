/** How many pixels a millimetre has here: by card or ruler, more than once, checked, and large enough for the clip. */
import type { CalibrationState, TrialInfo } from "../../api/schema";
import { h } from "../../ui/element";
import { showPage, statusLine, alertLine } from "../../ui/page";
import { untilMeasured } from "../screen/refresh-rate";
import { calibrationBody, clipWidth, type Distance, isPlausible, type Measured, NO_DISTANCE } from "../screen/size";
import { choose, noDevice, saveShown, screenOut, stopButton } from "../screens/support";
import type { Session } from "../session";
import { cardView, USUAL_PX } from "./card";
import "./calibration.css";
import { asTyped, measureDistance } from "./distance";
import { handWithCard } from "./hand";
import { CHECK_LINE_MM, lengthField, measuredLinePx, rulerLine } from "./ruler";
import { mean, settled, spreadPercent, SPREAD_MAX_PERCENT } from "./spread";

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
  /** px a mm of the measurement before. */
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
    await tell(session, display, "recheck_title", session.t("recheck_differs", { percent: Math.round(recheck_percent) }));
  }
  if (occasion === "screen_changed") {
    await tell(session, display, "screen_changed_title", session.t("screen_changed"));
    // Beside the card, which takes longer: the other screen may refresh at another rate.
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

async function tell(session: Session, display: HTMLElement, title: TitleKey, text: string): Promise<void> {
  const footer = h("footer", { class: "actions" });
  page({ session, display, eyebrow: "" }, title, [h("p", {}, text), footer]);
  await choose(session, footer, [{ label: session.t("measure_again"), value: true }]);
}

/** One measurement by the method of before; by how much it differs, in percent. */
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
      // Who has a ruler measures with it: a second card would only differ from the first.
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

/** A second look with a ruler, for who has one. */
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
