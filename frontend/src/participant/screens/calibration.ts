/** How many pixels a millimetre has here: by card or ruler, checked, and large enough for the clip. */
import type { CalibrationState, TrialInfo } from "../../api/schema";
import { h } from "../../ui/element";
import { showPage, statusLine, alertLine } from "../../ui/page";
import { plugin, BOOL, FLOAT, STRING, type PluginClass } from "../jspsych";
import { calibrationBody, clipWidth, isPlausible } from "../screen/size";
import type { Session } from "../session";
import { cardView } from "./card";
import { measureDistance } from "./distance";
import { CHECK_LINE_MM, lengthField, measuredLinePx, rulerLine } from "./ruler";
import { choose, noDevice, saveShown, screenOut, stopButton } from "./support";

interface Parameters {
  eyebrow: string;
  changed: boolean;
}
interface Data {
  px_per_mm: number | null;
  method: string;
}
interface Measured {
  px_per_mm: number;
  method: CalibrationState["method"];
}

const SIMULATED_PX_PER_MM = 96 / 25.4;

export function calibration(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "calibration",
    parameters: {
      eyebrow: { type: STRING, description: "small line above the title" },
      changed: { type: BOOL, description: "true where the screen changed after an earlier calibration" },
    },
    data: {
      px_per_mm: { type: FLOAT, description: "CSS pixels per millimetre, null where skipped" },
      method: { type: STRING, description: "card or ruler" },
    },
    show: (display, { eyebrow, changed }) => calibrate(session, display, eyebrow, changed),
    async simulate() {
      const body = calibrationBody(SIMULATED_PX_PER_MM, "card", session.run.display.viewing_distance ? 600 : null);
      session.screen.calibration = body;
      await session.api.calibration(body);
      return { px_per_mm: body.px_per_mm, method: body.method };
    },
    act: pressPrimary,
  });
}

/** Presses what goes on, page after page, as long as this screen lasts. */
function pressPrimary(display: HTMLElement): void {
  const timer = setInterval(() => {
    // Nobody sits there whose blind spot could be found, so the distance is typed in.
    const typed = display.querySelector(".blind-field") && display.querySelector<HTMLButtonElement>(".actions .plain");
    const primary = typed || display.querySelector<HTMLButtonElement>(".calibration .primary");
    display.querySelector<HTMLInputElement>(".card-area input")?.dispatchEvent(new Event("input"));
    if (primary) primary.click();
    else clearInterval(timer);
  }, 200);
}

async function calibrate(session: Session, display: HTMLElement, eyebrow: string, changed: boolean): Promise<Data> {
  if (changed) await tellChanged(session, display);
  const measured = await measureUntilItFits(session, display, eyebrow);
  if (!measured) return { px_per_mm: null, method: "" };
  const wants = session.run.display.viewing_distance;
  const known = session.screen.calibration?.viewing_distance_mm ?? null;
  const distance = wants && known === null ? await measureDistance(session, display, measured.px_per_mm) : known;
  const body = calibrationBody(measured.px_per_mm, measured.method, distance);
  session.screen.calibration = body;
  await saveShown(session, display.querySelector<HTMLElement>(".status") ?? statusLine(), session.api.calibration(body));
  return { px_per_mm: body.px_per_mm, method: body.method };
}

async function tellChanged(session: Session, display: HTMLElement): Promise<void> {
  const footer = h("footer", { class: "actions" });
  showPage(display, { title: session.t("screen_changed_title"), body: [h("p", {}, session.t("screen_changed")), footer] });
  await choose(session, footer, [{ label: session.t("measure_again"), value: true }]);
}

async function measureUntilItFits(session: Session, display: HTMLElement, eyebrow: string): Promise<Measured | null> {
  let method: CalibrationState["method"] = "card";
  for (;;) {
    const measured = await (method === "card" ? byCard(session, display, eyebrow) : byRuler(session, display, eyebrow));
    if (measured === "skip") return null;
    if (measured === "other" || measured === "again") {
      if (measured === "other") method = method === "card" ? "ruler" : "card";
    } else if (await fits(session, display, measured)) return measured;
  }
}

type Step = Measured | "other" | "again" | "skip";

async function byCard(session: Session, display: HTMLElement, eyebrow: string): Promise<Step> {
  const { t, run } = session;
  const card = cardView(t, session.screen.px_per_mm);
  const footer = h("footer", { class: "actions" });
  const alert = alertLine();
  page(session, display, eyebrow, "card_title", [h("p", {}, t("card_text")), card.element, alert, footer]);
  const skip = run.display.calibrate === "optional" ? [{ label: t("skip"), value: "skip" as const, kind: "plain" as const }] : [];
  const other = { label: t("card_none"), value: "other" as const };
  for (;;) {
    footer.replaceChildren();
    const step = await choose<"fits" | "other" | "skip">(session, footer, [{ label: t("card_fits"), value: "fits" }, other, ...skip]);
    if (step !== "fits") return step;
    if (!card.touched()) alert.textContent = t("card_untouched");
    else if (!isPlausible(card.px_per_mm())) alert.textContent = implausible(session, card.px_per_mm());
    else return checked(session, display, eyebrow, { px_per_mm: card.px_per_mm(), method: "card" });
  }
}

/** A second look with a ruler, for who has one. */
async function checked(session: Session, display: HTMLElement, eyebrow: string, measured: Measured): Promise<Step> {
  const { t } = session;
  const length_mm = Math.min(CHECK_LINE_MM, Math.floor((window.innerWidth - 80) / measured.px_per_mm / 10) * 10);
  const footer = h("footer", { class: "actions" });
  const text = h("p", {}, t("ruler_check_text", { length: length_mm }));
  page(session, display, eyebrow, "ruler_check_title", [text, rulerLine(length_mm * measured.px_per_mm), footer]);
  const choices = [
    { label: t("ruler_ok"), value: "ok" },
    { label: t("ruler_none"), value: "ok" },
    { label: t("ruler_differs"), value: "no" },
  ];
  return (await choose(session, footer, choices)) === "ok" ? measured : "again";
}

async function byRuler(session: Session, display: HTMLElement, eyebrow: string): Promise<Step> {
  const { t } = session;
  const field = lengthField(t);
  const line_px = measuredLinePx();
  const alert = alertLine();
  const footer = h("footer", { class: "actions" });
  page(session, display, eyebrow, "ruler_title", [h("p", {}, t("ruler_text")), rulerLine(line_px), field.element, alert, footer]);
  for (;;) {
    footer.replaceChildren();
    const step = await choose(session, footer, [
      { label: t("continue"), value: "measured" },
      { label: t("use_card"), value: "other" },
    ]);
    if (step === "other") return "other";
    const length_mm = field.value();
    if (length_mm === null) continue;
    if (isPlausible(line_px / length_mm)) return { px_per_mm: line_px / length_mm, method: "ruler" };
    alert.textContent = implausible(session, line_px / length_mm);
  }
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
  page(session, display, "", "clip_too_large_title", [alert, footer]);
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

function page(session: Session, display: HTMLElement, eyebrow: string, title: TitleKey, body: HTMLElement[]): void {
  const section = showPage(display, { title: session.t(title), eyebrow, body: [...body, statusLine()], wide: true });
  section.classList.add("calibration");
  section.append(stopButton(session));
}
type TitleKey = "card_title" | "ruler_title" | "ruler_check_title" | "clip_too_large_title";
