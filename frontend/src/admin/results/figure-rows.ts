/** The numbers of each figure of the results, as they are saved: labels where the figures have labels. */

import type { Schemas } from "../api";
import type { Row } from "../ui/figure-files";
import { type AnyResults, type Factors, labelsOf } from "./plots";
import { pointsOf } from "./trace-plots";

type Labels = ReadonlyMap<string, string>;

export function marginRows(margin: Schemas["Margin"], factors: Factors): Row[] {
  const named = margin.factors.map((name) => ({ name, ...labelsOf(factors, name) }));
  /** The place of a mean in declared order, the last factor fastest. */
  const rank = (levels: Record<string, string>) =>
    named.reduce((sum, { name, of, all }) => sum * (all.length + 1) + all.indexOf(of(levels[name] ?? "")), 0);
  return margin.means
    .toSorted((a, b) => rank(a.levels) - rank(b.levels))
    .map(({ levels, ...numbers }) => ({
      ...Object.fromEntries(named.map(({ name, title, of }) => [title, of(levels[name] ?? "")])),
      ...numbers,
    }));
}

export function cellRows({ cells, bins }: Schemas["Results"], labels: Labels): Row[] {
  const rank = new Map([...labels.keys()].map((cell, index) => [cell, index]));
  const inOrder = cells.toSorted((a, b) => (rank.get(a.cell) ?? 0) - (rank.get(b.cell) ?? 0));
  return inOrder.map(({ cell, ratings, counts }) => ({
    cell: labels.get(cell) ?? cell,
    ratings,
    ...Object.fromEntries(counts.map((count, bin) => [`answer ${bins[bin] ?? ""}`, count])),
  }));
}

export function timeRows({ response_times }: AnyResults): Row[] {
  return response_times.map(({ start_ms, answers }) => ({ from_ms: start_ms, answers }));
}

export function delayRows({ playback }: AnyResults): Row[] {
  return playback.key_to_first_frame_ms.map((plays, bin) => ({ from_ms: 10 * bin, plays }));
}

export function choiceRows({ pairs }: Schemas["PairResults"], labels: Labels): Row[] {
  return pairs.map(({ first, second, ...counts }) => ({
    first: labels.get(first) ?? first,
    second: labels.get(second) ?? second,
    ...counts,
  }));
}

export function levelRows(name: string, { levels }: Schemas["PairResults"], factors: Factors): Row[] {
  const { title, of } = labelsOf(factors, name);
  return levels.filter(({ factor }) => factor === name).map(({ level, n, share }) => ({ [title]: of(level), comparisons: n, share }));
}

export function seriesRows({ stimuli }: Schemas["SeriesResult"], along: string, second: string | undefined): Row[] {
  return stimuli.map((stimulus) => ({
    [along]: stimulus.value,
    ...(second === undefined ? {} : { [second]: stimulus.second }),
    answers: stimulus.n,
    positive: stimulus.positive,
  }));
}

export function traceRows(cells: readonly Schemas["TraceCell"][], labels: Labels): Row[] {
  return cells.flatMap((cell) => pointsOf(cell, labels.get(cell.cell) ?? cell.cell).map((point) => ({ ...point })));
}
