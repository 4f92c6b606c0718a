/** The rating scale: keys, mouse and touch; optional confirmation and comment. */
import type { ShownClipRating } from "../../../api/schema";
import { pick, type Translate } from "../../../i18n";
import { h, uniqueId } from "../../../ui/element";
import { listenKeys } from "../../../ui/keys";
import { MeantPress } from "../../../ui/meant-press";
import { button } from "../../../ui/page";
import { keyFor, valueOf } from "./scale-keys";

export interface Rated {
  response: number;
  answered_at_ms: number;
  changes: number;
  comment: string | null;
}
export interface ScaleOptions {
  trial: ShownClipRating;
  language: string;
  t: Translate;
  signal: AbortSignal;
  question: HTMLElement;
}

const SEEN_MS = 140;

/** Show the scale in `place`; resolves with the answer. Its time is that of the press that chose it. */
export function askScale(place: HTMLElement, options: ScaleOptions): Promise<Rated> {
  return new Promise((resolve) => new ScaleView(place, options, resolve));
}

class ScaleView {
  private readonly keys: HTMLButtonElement[];
  private readonly comment: HTMLTextAreaElement | null;
  private readonly confirm: HTMLButtonElement | null;
  private readonly meant: MeantPress;
  private chosen: { value: number; at_ms: number } | null = null;
  private changes = 0;
  private over = false;

  constructor(
    place: HTMLElement,
    private readonly options: ScaleOptions,
    private readonly resolve: (rated: Rated) => void,
  ) {
    const { trial, t, signal } = options;
    this.meant = new MeantPress(trial.pointer_delay_ms, signal);
    this.keys = this.makeKeys();
    this.comment = trial.comment ? h("textarea", { rows: 2, maxlength: 2000, id: uniqueId("comment") }) : null;
    this.confirm = trial.confirm || trial.comment ? button(t("confirm"), () => this.finish()) : null;
    if (this.confirm) this.confirm.disabled = true;
    place.replaceChildren(...this.layout());
    listenKeys((event) => this.pressed(event), signal);
    // The scale has the focus, so that Tab and screen readers go on from here, yet no key looks chosen.
    place.querySelector<HTMLElement>(".scale")?.focus({ preventScroll: true });
  }

  private makeKeys(): HTMLButtonElement[] {
    const { scale } = this.options.trial;
    const { t, language } = this.options;
    return Array.from({ length: scale.maximum - scale.minimum + 1 }, (_, place) => {
      const value = scale.minimum + place;
      const end = value === scale.minimum ? pick(scale.low, language) : value === scale.maximum ? pick(scale.high, language) : "";
      const label = t("rating_key", { value, maximum: scale.maximum }) + (end ? `, ${end}` : "");
      const onclick = (event: Event): void => {
        if (this.meant.allows(event)) this.choose(value, event.timeStamp);
      };
      return h(
        "button",
        { type: "button", class: "key", "aria-label": label, "aria-pressed": "false", "data-value": value, onclick },
        value,
      );
    });
  }

  private layout(): HTMLElement[] {
    const {
      trial: { scale },
      language,
      question,
      t,
    } = this.options;
    question.id = uniqueId("question");
    const ends = h(
      "div",
      { class: "ends", "aria-hidden": "true" },
      h("span", {}, pick(scale.low, language)),
      h("span", {}, pick(scale.high, language)),
    );
    const group = h(
      "div",
      { class: "scale", role: "group", "aria-labelledby": question.id, tabindex: -1 },
      h("div", { class: "keys" }, ...this.keys),
      ends,
    );
    group.style.setProperty("--points", String(this.keys.length));
    const more = this.comment && h("div", { class: "field comment" }, h("label", { for: this.comment.id }, t("comment")), this.comment);
    const confirm = this.confirm && h("div", { class: "actions" }, this.confirm);
    return [question, group, more, confirm].filter((node): node is HTMLElement => node instanceof HTMLElement);
  }

  private pressed(event: KeyboardEvent): void {
    const { scale } = this.options.trial;
    const value = valueOf(event.key, scale);
    if (value !== null) this.choose(value, event.timeStamp);
    else if (event.key === "Enter" && this.chosen) this.finish();
    else this.move(keyFor(event.key, document.dir === "rtl"));
  }

  /** Arrow keys go along the scale; Enter or Space then presses. */
  private move(step: -1 | 0 | 1): void {
    if (step === 0) return;
    const now = this.keys.findIndex((key) => key === document.activeElement);
    const next = now < 0 ? (step > 0 ? 0 : this.keys.length - 1) : Math.min(this.keys.length - 1, Math.max(0, now + step));
    this.keys[next]?.focus();
  }

  private choose(value: number, time_stamp: number): void {
    if (this.over) return;
    if (this.chosen && this.chosen.value !== value) this.changes += 1;
    if (this.chosen?.value !== value) this.chosen = { value, at_ms: performance.timeOrigin + time_stamp };
    this.keys.forEach((key) => key.setAttribute("aria-pressed", String(Number(key.dataset["value"]) === value)));
    if (!this.confirm) return this.finish();
    this.confirm.disabled = false;
  }

  private finish(): void {
    const chosen = this.chosen;
    if (!chosen || this.over) return;
    this.over = true;
    const rated = {
      response: chosen.value,
      answered_at_ms: chosen.at_ms,
      changes: this.changes,
      comment: this.comment?.value.trim() || null,
    };
    // Long enough to see the key go down; the time of the answer is already taken.
    setTimeout(() => this.resolve(rated), SEEN_MS);
  }
}
