/** An Observable Plot drawn into the page, in the page's colours and as wide as its place. */

import { useElementSize } from "@mantine/hooks";
import * as Plot from "@observablehq/plot";
import { useEffect, useRef } from "react";
import { allowStyles } from "../nonce";

const WIDEST_PX = 720;

export function PlotFigure({ options, label }: { options: Plot.PlotOptions; label: string }) {
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
    figure.setAttribute("role", "img");
    figure.setAttribute("aria-label", label);
    figureBox.current?.replaceChildren(figure);
    return () => figure.remove();
  }, [options, label, width]);
  return (
    <div className="plot" ref={measured}>
      <div ref={figureBox} />
    </div>
  );
}
