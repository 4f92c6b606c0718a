/** Charts: an Observable Plot drawn into the page, in the page's colors and as wide as its place. */

import { Button, Group } from "@mantine/core";
import { useElementSize } from "@mantine/hooks";
import * as Plot from "@observablehq/plot";
import { useEffect, useRef, useMemo } from "react";
import { allowStyles } from "../nonce";
import { download, downloadText } from "./useChange";
import { csvText, inPaperStyle, pngBlob, type Row, svgText } from "./figure-files";

// An Observable Plot drawn into the page, in the page's colors and as wide as its place.

const WIDEST_PX = 720;

interface PlotProps {
  options: Plot.PlotOptions;
  label: string;
  /** Where the figure can be saved: its numbers. */
  rows?: readonly Row[];
}

export function PlotFigure({ options, label, rows }: PlotProps) {
  const { ref: measured, width: room } = useElementSize();
  const figureBox = useRef<HTMLDivElement>(null);
  const width = Math.min(WIDEST_PX, Math.floor(room));
  useEffect(() => {
    if (width === 0) return;
    const style = { background: "none", color: "inherit", fontSize: "12px" };
    const figure = Plot.plot({ style, width, ...inPaperStyle(options) });
    allowStyles(figure);
    // Plot labels its inner groups, which may carry no label without a role; the figure has one as a whole.
    for (const group of figure.querySelectorAll("[aria-label]")) group.removeAttribute("aria-label");
    // A caption below is read as text, and then the picture above it is the image.
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

function Saving({ options, label, rows }: Required<PlotProps>) {
  const name = label.toLowerCase().replaceAll(/\W+/g, "-");
  const button = (kind: string, save: () => void) => (
    <Button size="compact-xs" variant="default" aria-label={`Save as ${kind}: ${label}`} onClick={save}>
      {kind}
    </Button>
  );
  return (
    <Group gap={6} mt={4} justify="flex-end">
      {button("SVG", () => downloadText(`${name}.svg`, svgText(options, label), "image/svg+xml"))}
      {button("PNG", () => void pngBlob(svgText(options, label)).then((png) => download(`${name}.png`, png)))}
      {button("CSV", () => downloadText(`${name}.csv`, csvText(rows)))}
    </Group>
  );
}

/** Closure over time at 300 samples a second, shut below; `other` is the right eye where both were measured. */
function closurePlot(closure: readonly number[], height = 110, other: readonly number[] = []): Plot.PlotOptions {
  const line = { x: (_: number, frame: number) => (frame * 1000) / 300, y: (value: number) => value, strokeWidth: 1.5 };
  return {
    height,
    x: { label: "time (ms)" },
    y: { domain: [1, 0], ticks: 3, label: "closure" },
    marks: [
      Plot.ruleY([0, 1], { strokeOpacity: 0.2 }),
      Plot.lineY(closure, line),
      ...(other.length > 0 ? [Plot.lineY(other, { ...line, strokeDasharray: "4 3" })] : []),
    ],
  };
}

// Closure of an eye over time, as a chart.

interface ClosureProps {
  closure: readonly number[];
  label: string;
  height?: number;
  /** The right eye's, where both were measured. */
  other?: readonly number[];
}

export function ClosureFigure({ closure, label, height, other }: ClosureProps) {
  const options = useMemo(() => closurePlot(closure, height, other), [closure, height, other]);
  return <PlotFigure options={options} label={label} />;
}
