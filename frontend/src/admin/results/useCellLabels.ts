import { useMemo } from "react";
import { cellLabels, type Factors } from "./plots";

/** The labels of the cells of these rows. */
export function useCellLabels(rows: readonly { cell: string }[], factors: Factors): Map<string, string> {
  return useMemo(
    () =>
      cellLabels(
        rows.map(({ cell }) => cell),
        factors,
      ),
    [rows, factors],
  );
}
