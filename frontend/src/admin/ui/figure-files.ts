/** A figure of the page as files: its picture as SVG, its numbers as CSV. */

import * as Plot from "@observablehq/plot";

import { guardedText } from "../../labelling/csv";

type Cell = string | number | null | undefined;
export type Row = Record<string, Cell>;

const SVG = "http://www.w3.org/2000/svg";
const WIDTH_PX = 640;
const LINE_PX = 20;
const GLYPH_PX = 7;
const PNG_SCALE = 3;
const INK = { background: "white", color: "black", fontFamily: "sans-serif", fontSize: "12px" };

/** The one style of all figures: titles in the middle of their axes, axis lines, room for both. */
export function inPaperStyle(options: Plot.PlotOptions): Plot.PlotOptions {
  const titles = { labelAnchor: "center", labelArrow: "none" } as const;
  const line = { stroke: "currentColor", strokeOpacity: 0.6 };
  return {
    marginLeft: 52,
    marginBottom: 42,
    ...options,
    x: { ...titles, ...options.x },
    y: { ...titles, ...options.y },
    marks: [Plot.frame({ ...line, anchor: "bottom" }), Plot.frame({ ...line, anchor: "left" }), ...(options.marks ?? [])],
  };
}

/** The picture of `svgText` as PNG, three times as large: about 300 dots per printed inch. */
export async function pngBlob(svg: string): Promise<Blob> {
  const address = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [PNG_SCALE * image.naturalWidth, PNG_SCALE * image.naturalHeight];
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    const blob = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve));
    if (blob === null) throw new Error("This browser cannot make a PNG. Save the figure as SVG.");
    return blob;
  } finally {
    URL.revokeObjectURL(address);
  }
}

/** The picture, dark on white whatever the page's colors are; its legend and caption, which the page has as HTML, are drawn into it. */
export function svgText(options: Plot.PlotOptions, label: string): string {
  const drawn = Plot.plot({ ...inPaperStyle(options), width: WIDTH_PX, style: INK });
  const parts = drawn instanceof SVGSVGElement ? [drawn] : [...drawn.querySelectorAll<SVGSVGElement>(":scope > svg")];
  const whole = element("svg", { xmlns: SVG, "font-family": "sans-serif", "font-size": 12 });
  whole.append(element("title", {}, label));
  const paper = element("rect", { width: WIDTH_PX, fill: "white" });
  whole.append(paper);
  let top = 0;
  for (const line of [...swatches(drawn)]) {
    line.setAttribute("transform", `translate(8 ${top})`);
    whole.append(line);
    top += LINE_PX;
  }
  for (const part of parts) {
    part.setAttribute("y", String(top));
    top += Number(part.getAttribute("height"));
    whole.append(part);
  }
  if (typeof options.caption === "string") {
    for (const line of linesOf(options.caption)) {
      whole.append(element("text", { x: 8, y: top + 14 }, line));
      top += LINE_PX;
    }
  }
  for (const [name, value] of Object.entries({ width: WIDTH_PX, height: top, viewBox: `0 0 ${WIDTH_PX} ${top}` }))
    whole.setAttribute(name, String(value));
  paper.setAttribute("height", String(top));
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(whole)}\n`;
}

/** A text in lines that are no longer than the figure. */
function linesOf(text: string): string[] {
  const lines = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1) ?? ""} ${word}`.trim();
    if (longer.length * GLYPH_PX > WIDTH_PX - 16) lines.push(word);
    else lines[lines.length - 1] = longer;
  }
  return lines;
}

/** A legend of colors by name, in lines no longer than the figure. */
function swatches(drawn: ReturnType<typeof Plot.plot>): Element[] {
  const colours = drawn.querySelector(":scope > div") === null ? undefined : drawn.scale("color");
  const lines: Element[] = [];
  let x = WIDTH_PX;
  for (const value of (colours?.domain ?? []) as readonly unknown[]) {
    const name = String(value);
    const room = 26 + GLYPH_PX * name.length;
    if (x + room > WIDTH_PX - 16) {
      lines.push(element("g", {}));
      x = 0;
    }
    const fill = String(colours?.apply(value));
    lines.at(-1)?.append(element("rect", { x, y: 4, width: 12, height: 12, fill }), element("text", { x: x + 16, y: 14 }, name));
    x += room;
  }
  return lines;
}

function element(name: string, attributes: Record<string, string | number>, text = ""): Element {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  if (text !== "") made.textContent = text;
  return made;
}

/** The numbers of a figure, one line per row; a text that a spreadsheet would run begins with an apostrophe. */
export function csvText(rows: readonly Row[]): string {
  const names = [...new Set(rows.flatMap((row) => Object.keys(row)))];
  const lines = [names, ...rows.map((row) => names.map((name) => row[name]))];
  return lines.map((line) => `${line.map(cellText).join(",")}\r\n`).join("");
}

function cellText(cell: Cell): string {
  if (cell === null || cell === undefined || Number.isNaN(cell)) return "";
  if (typeof cell === "number") return String(cell);
  const safe = guardedText(cell);
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}
