/** An Observable Plot drawn into the page, in the page's colours. */

import * as Plot from "@observablehq/plot";
import { useEffect, useRef } from "react";
import { allowStyles } from "../nonce";

export function PlotFigure({ options, label }: { options: Plot.PlotOptions; label: string }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const figure = Plot.plot({ style: { background: "none", color: "inherit" }, ...options });
    allowStyles(figure);
    // Plot labels its inner groups, which may carry no label without a role; the figure has one as a whole.
    for (const group of figure.querySelectorAll("[aria-label]")) group.removeAttribute("aria-label");
    figure.setAttribute("role", "img");
    figure.setAttribute("aria-label", label);
    place.current?.replaceChildren(figure);
    return () => figure.remove();
  }, [options, label]);
  return <div className="plot" ref={place} />;
}
