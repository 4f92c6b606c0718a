import * as Plot from "@observablehq/plot";

/** A closure curve at 300 fps: 0 open at the top, 1 closed at the bottom, as a lid moves. */
export function closurePlot(closure: readonly number[], height = 110): Plot.PlotOptions {
  return {
    height,
    marginLeft: 34,
    x: { label: "time (ms)" },
    y: { domain: [1, 0], ticks: 3, label: "closure" },
    marks: [
      Plot.ruleY([0, 1], { strokeOpacity: 0.2 }),
      Plot.lineY(closure, { x: (_, frame: number) => (frame * 1000) / 300, y: (value: number) => value, strokeWidth: 1.5 }),
    ],
  };
}
