import * as Plot from "@observablehq/plot";

/** Closure over time at 300 samples a second, shut below; `other` is the right eye where both were measured. */
export function closurePlot(closure: readonly number[], height = 110, other: readonly number[] = []): Plot.PlotOptions {
  const line = { x: (_: number, frame: number) => (frame * 1000) / 300, y: (value: number) => value, strokeWidth: 1.5 };
  return {
    height,
    marginBottom: 34,
    marginLeft: 34,
    x: { label: "time (ms)" },
    y: { domain: [1, 0], ticks: 3, label: "closure" },
    marks: [
      Plot.ruleY([0, 1], { strokeOpacity: 0.2 }),
      Plot.lineY(closure, line),
      ...(other.length > 0 ? [Plot.lineY(other, { ...line, strokeDasharray: "4 3" })] : []),
    ],
  };
}
