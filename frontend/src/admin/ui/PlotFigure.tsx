/** An Observable Plot drawn into the page, in the page's colours and as wide as its place. */

import { Button, Group } from "@mantine/core";
import { useElementSize } from "@mantine/hooks";
import * as Plot from "@observablehq/plot";
import { useEffect, useRef } from "react";
import { allowStyles } from "../nonce";
import { downloadText } from "./download";
import { csvText, type Row, svgText } from "./figure-files";

const WIDEST_PX = 720;

interface Props {
  options: Plot.PlotOptions;
  label: string;
  /** Where the figure can be saved: its numbers. */
  rows?: readonly Row[];
}

export function PlotFigure({ options, label, rows }: Props) {
  const { ref: measured, width: room } = useElementSize();
  const figureBox = useRef<HTMLDivElement>(null);
  const width = Math.min(WIDEST_PX, Math.floor(room));
  useEffect(() => {
    if (width === 0) return;
    const style = { background: "none", color: "inherit", fontSize: "12px" };
    const figure = Plot.plot({ style, width, ...options });
    allowStyles(figure);
    // Plot labels its inner groups, which may carry no label without a role; the figure has one as a whole.
    for (const group of figure.querySelectorAll("[aria-label]")) group.removeAttribute("aria-label");
    // Where a caption stands below, it is read as text, and the picture above it is the image.
    const picture = figure.querySelector("figcaption") === null ? figure : (figure.querySelector(":scope > svg:last-of-type") ?? figure);
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", label);
    figureBox.current?.replaceChildren(figure);
    return () => figure.remove();
  }, [options, label, width]);
  return (
    <div className="plot" ref={measured}>
      <div ref={figureBox} />
      {rows !== undefined && <Saving options={options} label={label} rows={rows} />}
    </div>
  );
}

function Saving({ options, label, rows }: Required<Props>) {
  const name = label.toLowerCase().replaceAll(/\W+/g, "-");
  const button = (kind: string, save: () => void) => (
    <Button size="compact-xs" variant="default" aria-label={`Save as ${kind}: ${label}`} onClick={save}>
      {kind}
    </Button>
  );
  return (
    <Group gap={6} mt={4} justify="flex-end">
      {button("SVG", () => downloadText(`${name}.svg`, svgText(options, label), "image/svg+xml"))}
      {button("CSV", () => downloadText(`${name}.csv`, csvText(rows)))}
    </Group>
  );
}
