/** Long waits, such as ten minutes before an answer, are drawn and played as short ones: a time line of knots. */

/** Waits longer than this are folded to it. */
const FOLDED_MS = 1_500;

type Knot = readonly [real_ms: number, folded_ms: number];

export interface Folding {
  knots: readonly Knot[];
  length_ms: number;
  fold(real_ms: number): number;
  unfold(folded_ms: number): number;
}

/** Fold whatever is between these spans, up to `end_ms`; spans ascend and do not overlap. */
export function folding(spans: readonly { start_ms: number; end_ms: number }[], end_ms: number): Folding {
  const knots: Knot[] = [[0, 0]];
  const add = (real_ms: number, is_wait: boolean): void => {
    const [real_before, folded_before] = knots.at(-1) ?? [0, 0];
    if (real_ms <= real_before) return;
    const length = real_ms - real_before;
    knots.push([real_ms, folded_before + (is_wait ? Math.min(length, FOLDED_MS) : length)]);
  };
  for (const span of spans) {
    add(span.start_ms, true);
    add(span.end_ms, false);
  }
  add(end_ms, true);
  return {
    knots,
    length_ms: knots.at(-1)?.[1] ?? 0,
    fold: (real_ms) => between(knots, real_ms, 0, 1),
    unfold: (folded_ms) => between(knots, folded_ms, 1, 0),
  };
}

function between(knots: readonly Knot[], value: number, from: 0 | 1, to: 0 | 1): number {
  const after = knots.findIndex((knot) => knot[from] >= value);
  const [right, left] = [knots[after < 0 ? knots.length - 1 : after], knots[after - 1]];
  if (!right) return 0;
  if (!left || after < 0) return right[to];
  return left[to] + ((right[to] - left[to]) * (value - left[from])) / (right[from] - left[from]);
}
