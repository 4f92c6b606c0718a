/** Language, direction and surround of the whole document. */
import { direction } from "../../i18n";

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
