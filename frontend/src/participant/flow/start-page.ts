/** The first page: what this is, how long it takes, in which language. */
import { direction, languageName, loadMessages, pick, translator } from "../../i18n";
import type { LinkState } from "../../api/schema";
import { h, uniqueId, button, showPage } from "../../ui/element";
import { emptied } from "../screens/support";

// Language, direction and surround of the whole document.

export function setLanguage(language: string): void {
  document.documentElement.lang = language;
  document.documentElement.dir = direction(language);
  document.dir = direction(language);
}

/** Which way scales run, as declared for pages that are read from right to left. */
export function setScales(order: "mirrored" | "same"): void {
  document.documentElement.dataset["scales"] = order;
}

/** The surround as declared, and ink that reads on it (WCAG relative luminance). */
export function setSurround(background: string): void {
  const root = document.documentElement;
  root.style.setProperty("--surround", background);
  root.style.setProperty("--ink", luminance(background) > 0.18 ? "#000" : "#fff");
}

export function luminance(colour: string): number {
  const parts = [1, 3, 5].map((digit) => parseInt(colour.slice(digit, digit + 2), 16) / 255);
  const [r = 0, g = 0, b = 0] = parts.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

export interface Beginning {
  language: string;
  /** The visit began elsewhere, and its resume code is at hand. */
  has_code: boolean;
}

/** Resolves with what was chosen when the participant starts. */
export function startPage(root: HTMLElement, link: LinkState, language: string): Promise<Beginning> {
  return new Promise((resolve) => {
    const display = emptied(root);
    const draw = async (chosen: string): Promise<void> => {
      await loadMessages(chosen);
      setLanguage(chosen);
      const t = translator(chosen);
      const picker =
        link.study.languages.length > 1
          ? languagePicker(link.study.languages, chosen, t("choose_language"), (one) => void draw(one))
          : null;
      const preview = link.kind === "preview" ? h("p", { class: "help" }, t("preview_note")) : null;
      const start = button(t("start_study"), () => resolve({ language: chosen, has_code: false }));
      const code = link.kind === "general" ? button(t("code_open"), () => resolve({ language: chosen, has_code: true }), "plain") : null;
      showPage(display, {
        title: titleOf(link, chosen),
        body: [h("p", { class: "lead" }, t("minutes", { minutes: Math.ceil(link.study.expected_minutes) })), preview, picker],
        actions: [start, code],
      });
    };
    void draw(language);
  });
}

function languagePicker(languages: string[], chosen: string, label: string, pick: (language: string) => void): HTMLElement {
  const name = uniqueId("language");
  const rows = languages.map((language) => {
    const input = h("input", { type: "radio", name, value: language, checked: language === chosen, onchange: () => pick(language) });
    return h("label", { class: "tick", lang: language }, input, h("span", {}, languageName(language)));
  });
  return h("fieldset", { class: "field" }, h("legend", {}, label), h("div", { class: "choices choices-row" }, ...rows));
}

/** What the study is called in this language. A visit that an earlier page has kept knows one title. */
export function titleOf({ study }: LinkState, language: string): string {
  const titles = (study as Partial<LinkState["study"]>).titles;
  return titles ? pick(titles, language) : study.title;
}
