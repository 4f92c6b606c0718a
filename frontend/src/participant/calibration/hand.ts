/** A hand that holds a card flat against a screen: line art in the page's own ink, so that it reads on any surround. */

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

export function handWithCard(label: string): SVGElement {
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
