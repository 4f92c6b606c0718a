/** Points side by side: a press, a digit or the arrow keys; the two ends labeled, or every point. */
import type { Points } from "../../../api/schema";
import { pick } from "../../../i18n";
import { h } from "../../../ui/element";
import { digitValue, scaleDirection } from "../../../ui/keys";
import type { Ask, Widget } from "../../kinds/clip_rating/answer";
import "./points.css";

export function widget({ scale, language, t, meant, choose }: Ask): Widget {
  if (scale.type !== "points") throw new Error(`expected points, got ${scale.type}`);
  const { minimum, maximum, labels, low, high } = scale;
  const textOf = (index: number): string => {
    const end = index === 0 ? low : index === maximum - minimum ? high : null;
    const text = labels[index] ?? end;
    return text ? pick(text, language) : "";
  };
  const keys = Array.from({ length: maximum - minimum + 1 }, (_, index) => {
    const value = minimum + index;
    const text = textOf(index);
    const onclick = (event: Event): void => {
      if (meant.allows(event)) choose(value, event.timeStamp);
    };
    // A key that shows its label is named by what it shows.
    const name = labels.length ? null : t("rating_key", { value, maximum }) + (text ? `, ${text}` : "");
    const attributes = { type: "button", class: "key", "aria-label": name, "aria-pressed": "false", "data-value": value, onclick };
    return h("button", attributes, labels.length ? `${value} ` : value, labels.length ? h("span", { class: "key-label" }, text) : null);
  });
  const dir = scaleDirection();
  const row = h("div", { class: labels.length ? "keys keys-labelled" : "keys", dir }, ...keys);
  // Hidden from screen readers: the keys at the ends have these words in their names.
  const ends = h("div", { class: "ends", "aria-hidden": "true", dir }, h("span", {}, textOf(0)), h("span", {}, textOf(maximum - minimum)));
  row.style.setProperty("--points", String(keys.length));

  /** Arrow keys go along the scale; Enter or Space then presses. */
  function move(step: -1 | 0 | 1): void {
    if (step === 0) return;
    const now = keys.findIndex((key) => key === document.activeElement);
    // From outside the row the first arrow key goes to the nearer end.
    const next = now < 0 ? (step > 0 ? 0 : keys.length - 1) : Math.min(keys.length - 1, Math.max(0, now + step));
    keys[next]?.focus();
  }

  return {
    parts: labels.length ? [row] : [row, ends],
    settles: true,
    show: (value) => keys.forEach((key) => key.setAttribute("aria-pressed", String(Number(key.dataset["value"]) === value))),
    pressed(key) {
      const value = valueOf(key, scale);
      if (value === null) move(keyFor(key, dir === "rtl"));
      return value;
    },
  };
}

// Which keys mean what on the scale.

type Range = Pick<Points, "minimum" | "maximum">;

/** The value a key stands for, or null. 0 means ten on a scale that ends there and does not begin at zero. */
export function valueOf(key: string, { minimum, maximum }: Range): number | null {
  const digit = digitValue(key);
  if (digit === null) return null;
  if (digit >= minimum && digit <= maximum) return digit;
  return digit === 0 && minimum > 0 && maximum === 10 ? 10 : null;
}

/** Step along the scale for an arrow key, in the direction of reading. */
export function keyFor(key: string, right_to_left: boolean): -1 | 0 | 1 {
  const forward = right_to_left ? "ArrowLeft" : "ArrowRight";
  const backward = right_to_left ? "ArrowRight" : "ArrowLeft";
  if (key === forward || key === "ArrowUp") return 1;
  return key === backward || key === "ArrowDown" ? -1 : 0;
}
