/** The answer to a clip: its scales on the screen, by keys, mouse and touch, and what the server is sent of them. */
import type { ShownClipRating, RatingAnswer } from "../../../api/schema";
import type { Session, RatingBody } from "../../session";
import { playbackRecord } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import { spanOf, timesOf } from "../../views/ledger";
import { ratingBody } from "../../trials/rating";
import type { TrialParameters } from "../../trials/trial";
import { type Shown, waitForStart, type Stage } from "../../trials/showing";
import { duration } from "../../measured";
import { type Translate, pick } from "../../../i18n";
import { loadModule } from "../../../ui/load-module";
import { MeantPress, keyOf, listenKeys } from "../../../ui/keys";
import { h, uniqueId, button } from "../../../ui/element";

// The declaration of a run whose trials are ratings of single clips.

export function declaredRating({ run }: Session): ShownClipRating {
  if (run.trial.kind !== "clip_rating") throw new Error(`expected ratings of single clips, got ${run.trial.kind}`);
  return run.trial;
}

// What a type of scale draws: a file of its name in ../../trials/scales, which exports `widget`. Found by the name.

export type Scale = ShownClipRating["scales"][number];

export interface Ask {
  scale: Scale;
  /** The id of the question, which names the widget. */
  question: string;
  language: string;
  t: Translate;
  meant: MeantPress;
  choose: (value: number, time_stamp: number) => void;
  /** Enter was pressed where the page's own keys do not hear it. */
  enter: () => void;
}
export interface Widget {
  parts: HTMLElement[];
  /** False where an answer is moved to its place, and so counts only once it is confirmed. */
  settles: boolean;
  /** Show this answer as the one chosen; null takes it back. */
  show(value: number | null): void;
  /** A key pressed where this scale has the focus: the answer it stands for, if any. */
  pressed(key: string): number | null;
  focus?(): void;
}
type MakeWidget = (ask: Ask) => Widget;

const files = import.meta.glob<MakeWidget>("../../trials/scales/*.ts", { import: "widget" });
const makers = new Map<string, MakeWidget>();

/** Fetch what draws these scales. The kind asks for it before its first trial, so that no scale waits. */
export async function loadWidgets(scales: readonly Scale[]): Promise<void> {
  for (const { type } of scales) {
    // Several scales of one type share what draws them.
    if (makers.has(type)) continue;
    const load = files[`../../trials/scales/${type}.ts`];
    if (!load) throw new Error(`expected a scale this page knows, got ${type}; load the page again`);
    makers.set(type, await loadModule(load));
  }
}

/** The widget of a scale that `loadWidgets` has fetched. */
function makeWidget(ask: Ask): Widget {
  const make = makers.get(ask.scale.type);
  if (!make) throw new Error(`expected the scale ${ask.scale.type} to be loaded`);
  return make(ask);
}

type Answers = RatingAnswer["answers"];
export interface Rated {
  answers: Answers;
  /** The latest press that chose an answer, in absolute ms; and that of each scale. */
  answered_at_ms: number;
  at_ms: Record<string, number>;
  changes: number;
  comment: string | null;
}
export interface ScaleOptions {
  scales: readonly Scale[];
  pointer_delay_ms: number;
  confirm: boolean;
  comment: boolean;
  language: string;
  t: Translate;
  signal: AbortSignal;
  /** Shown above the scale instead of the scale's question. */
  question?: HTMLElement;
}

const SEEN_MS = 140;
/** An answer that is moved on after so long at rest was changed, not still on its way. */
const REST_MS = 500;

type Shared = Pick<ScaleOptions, "language" | "t" | "signal">;

/** The declared scales on one screen, or a screen each in their order, with the comment on the last. */
async function askInOrder(container: HTMLElement, trial: ShownClipRating, shared: Shared): Promise<Rated> {
  const { scales, arrangement, comment } = trial;
  if (arrangement === "one_screen" || scales.length < 2) return askScales(container, { ...trial, ...shared });
  const all: Rated = { answers: {}, at_ms: {}, answered_at_ms: 0, changes: 0, comment: null };
  for (const [number, scale] of scales.entries()) {
    const screen = { ...trial, ...shared, scales: [scale], comment: comment && number === scales.length - 1 };
    const rated = await withOwnKeys(shared.signal, (signal) => askScales(container, { ...screen, signal }));
    Object.assign(all.answers, rated.answers);
    Object.assign(all.at_ms, rated.at_ms);
    // The last screen decides when the trial was answered; only it has the comment.
    Object.assign(all, { answered_at_ms: rated.answered_at_ms, changes: all.changes + rated.changes, comment: rated.comment });
  }
  return all;
}

/** The keys of a screen end with it. */
async function withOwnKeys<T>(signal: AbortSignal, ask: (signal: AbortSignal) => Promise<T>): Promise<T> {
  const own = new AbortController();
  // The listener ends with its screen, or each screen would leave one on the shared signal.
  signal.addEventListener("abort", () => own.abort(), { signal: own.signal });
  try {
    return await ask(own.signal);
  } finally {
    own.abort();
  }
}

/** Show the scales in `container`; resolves with the answers. Their times are those of the presses that chose them. */
export async function askScales(container: HTMLElement, options: ScaleOptions): Promise<Rated> {
  await loadWidgets(options.scales);
  return new Promise((resolve) => new ScalesView(container, options, resolve));
}

interface Block {
  scale: Scale;
  element: HTMLElement;
  group: HTMLElement;
  widget: Widget;
  not_applicable: HTMLButtonElement | null;
  chosen: { value: number | null; at_ms: number } | null;
}

class ScalesView {
  private readonly blocks: Block[];
  private readonly comment: HTMLTextAreaElement | null;
  private readonly confirm: HTMLButtonElement | null;
  private readonly meant: MeantPress;
  private changes = 0;
  private over = false;

  constructor(
    container: HTMLElement,
    private readonly options: ScaleOptions,
    private readonly resolve: (rated: Rated) => void,
  ) {
    const { scales, comment, confirm, t, signal, pointer_delay_ms } = options;
    this.meant = new MeantPress(pointer_delay_ms, signal);
    this.blocks = scales.map((scale, number) => this.block(scale, number));
    this.comment = comment ? h("textarea", { rows: 2, maxlength: 2000, id: uniqueId("comment") }) : null;
    // With one settled scale the press itself ends the trial; anything else needs a button.
    const asks = confirm || comment || scales.length > 1 || this.blocks.some(({ widget }) => !widget.settles);
    this.confirm = asks ? button(t("confirm"), () => this.finish()) : null;
    if (this.confirm) this.confirm.disabled = true;
    container.replaceChildren(...this.layout());
    listenKeys((event) => this.pressed(event), signal);
    // The scale has the focus, so that Tab and screen readers go on from here, yet no key looks chosen.
    if (this.blocks[0]) this.goTo(this.blocks[0]);
  }

  private block(scale: Scale, number: number): Block {
    const { language, t, question: given } = this.options;
    const question = given ?? h(number === 0 ? "h1" : "h2", { class: "question" }, pick(scale.question, language));
    question.id = uniqueId("question");
    const choose = (value: number | null, time_stamp: number): void => this.choose(block, value, time_stamp);
    const widget = makeWidget({ scale, question: question.id, language, t, meant: this.meant, choose, enter: () => this.finish() });
    const onclick = (event: Event): void => {
      if (this.meant.allows(event)) choose(null, event.timeStamp);
    };
    const label = scale.not_applicable && pick(scale.not_applicable, language);
    const not_applicable = label ? h("button", { type: "button", class: "button beside", "aria-pressed": "false", onclick }, label) : null;
    const group = h(
      "div",
      { class: "scale", role: "group", "aria-labelledby": question.id, tabindex: -1 },
      ...widget.parts,
      not_applicable,
    );
    // The width follows from the number of points; other scales take that of eight.
    group.style.setProperty("--points", String(scale.type === "points" ? scale.maximum - scale.minimum + 1 : 8));
    const element = h("div", { class: "scale-block" }, question, group);
    const block: Block = { scale, element, group, widget, not_applicable, chosen: null };
    return block;
  }

  private layout(): HTMLElement[] {
    const { comment, confirm, blocks } = this;
    const more = comment && h("div", { class: "field comment" }, h("label", { for: comment.id }, this.options.t("comment")), comment);
    const several = h("div", { class: "scales" }, ...blocks.map(({ element }) => element));
    const asked = blocks.length > 1 ? [several] : blocks.flatMap(({ element }) => [...element.children]);
    return [...asked, more, confirm && h("div", { class: "actions" }, confirm)].filter((node) => node instanceof HTMLElement);
  }

  /** The scale that keys are meant for: that with the focus, else the first without an answer. */
  private current(): Block | undefined {
    const focused = this.blocks.find(({ group }) => group.contains(document.activeElement));
    return focused ?? this.blocks.find(({ chosen }) => !chosen) ?? this.blocks[0];
  }

  private pressed(event: KeyboardEvent): void {
    const key = keyOf(event);
    if (key === "Enter") return this.finish();
    const block = this.current();
    const value = block?.widget.pressed(key) ?? null;
    if (!block || value === null) return;
    this.choose(block, value, event.timeStamp);
    const next = this.blocks.find(({ chosen }) => !chosen);
    if (next && next !== block) this.goTo(next);
    else if (!next && this.blocks.length > 1) this.confirm?.focus({ preventScroll: true });
  }

  private goTo({ widget, group, element }: Block): void {
    if (widget.focus) widget.focus();
    else group.focus({ preventScroll: true });
    element.scrollIntoView({ block: "nearest" });
  }

  private choose(block: Block, value: number | null, time_stamp: number): void {
    if (this.over) return;
    // Event times count from the page's time origin; stored times are absolute.
    const at_ms = performance.timeOrigin + time_stamp;
    const { chosen, widget, not_applicable } = block;
    if (chosen && chosen.value !== value) this.changes += Number(widget.settles || value === null || at_ms - chosen.at_ms > REST_MS);
    // The same answer pressed again keeps the time of its first press.
    if (!chosen || chosen.value !== value) block.chosen = { value, at_ms };
    widget.show(value);
    not_applicable?.setAttribute("aria-pressed", String(value === null));
    if (!this.confirm) return this.finish();
    this.confirm.disabled = this.blocks.some((one) => !one.chosen);
  }

  /** All answers where there are all; else the first scale without one has the focus. */
  private finish(): void {
    const open = this.blocks.find(({ chosen }) => !chosen);
    if (open) return this.goTo(open);
    // A second Enter within the delay below must not answer again.
    if (this.over) return;
    const answers: Answers = {};
    const at_ms: Record<string, number> = {};
    for (const { scale, chosen } of this.blocks) {
      if (!chosen) return;
      answers[scale.name] = { response: chosen.value, not_applicable: chosen.value === null };
      at_ms[scale.name] = chosen.at_ms;
    }
    this.over = true;
    const comment = this.comment?.value.trim() || null;
    const rated = { answers, at_ms, answered_at_ms: Math.max(...Object.values(at_ms)), changes: this.changes, comment };
    // Long enough to see the key go down; the time of the answer is already taken.
    setTimeout(() => this.resolve(rated), SEEN_MS);
  }
}

// The answers to one clip as the server is sent them.

/** What jsPsych's own data hold of a trial. */
export interface ClipRatingData {
  response: number | null;
  rt: number | null;
  frames_missing: number | null;
  key_to_first_frame_ms: number | null;
  again: boolean;
}

/** The ready screen before a view of the clip. */
export function ready(session: Session, stage: Stage, { number, total, play, trial }: TrialParameters, view: number): Promise<number> {
  const { t } = session;
  const { views, pointer_delay_ms } = declaredRating(session);
  // Asked for at each view: a tablet may have a mouse by now.
  const touch = matchMedia("(pointer: coarse)").matches;
  const first = t(touch ? "ready_touch" : "ready");
  const prompt = view > 1 ? t(touch ? "ready_again_touch" : "ready_again", { view, views }) : first;
  const key = trial.kind === "practice" ? "practice_note" : "trial_of";
  // A repeated clip is announced, or it would seem to be a mistake.
  const note = play > 1 && trial.kind !== "practice" ? t("ready_replay") : t(key, { number, total });
  return waitForStart(session, stage, prompt, note, pointer_delay_ms);
}

export async function rate(session: Session, stage: Stage): Promise<Rated> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const rated = await askInOrder(stage.below, declaredRating(session), { language, t, signal });
  done();
  return rated;
}

export function bodyOf(session: Session, { trial, play }: TrialParameters, showings: Shown[], rated: Rated): RatingBody {
  const { answered_at_ms, changes, comment } = rated;
  const span = spanOf(showings);
  const playback = playbackRecord(trial.clip_sha256, showings, session.screen.record());
  const given = { ...timesOf(span, answered_at_ms), changes, comment };
  return ratingBody(session, trial, play, answerOf(rated, span.ended_at_ms), playback, given);
}

/** `from_ms` is when the clip's last frame was drawn, where it is known. */
function answerOf({ answers, at_ms }: Rated, from_ms: number | undefined): RatingAnswer {
  const timed = Object.entries(answers).map(([name, given]) => {
    const at = at_ms[name];
    // Without a drawn last frame there is no moment to count from.
    const rt = at === undefined || from_ms === undefined ? null : duration(at - from_ms);
    return [name, { ...given, rt }];
  });
  return { kind: "clip_rating", answers: Object.fromEntries(timed) as RatingAnswer["answers"] };
}

/** No answer on any scale: the clip could not be shown. */
export function noAnswer({ scales }: ShownClipRating): RatingAnswer {
  const none = scales.map(({ name }) => [name, { response: null }]);
  return { kind: "clip_rating", answers: Object.fromEntries(none) as RatingAnswer["answers"] };
}

/** The one number where there is one scale; jsPsych's own data hold it. */
export function onlyResponse(answers: RatingAnswer["answers"]): number | null {
  const [first, ...more] = Object.values(answers);
  return first && more.length === 0 ? first.response : null;
}
