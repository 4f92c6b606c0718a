/** Closure of an eye over time, as a chart. */

import { useMemo } from "react";
import { closurePlot } from "./closurePlot";
import { PlotFigure } from "./PlotFigure";

interface Props {
  closure: readonly number[];
  label: string;
  height?: number;
  /** The right eye's, where both were measured. */
  other?: readonly number[];
}

export function ClosureFigure({ closure, label, height, other }: Props) {
  const options = useMemo(() => closurePlot(closure, height, other), [closure, height, other]);
  return <PlotFigure options={options} label={label} />;
}
