/** What the admin site asks of a kind of trial, apart from its results: each key is left out where a kind is like any other. */
import type { RunState } from "../../api/schema";
import type { Schemas } from "../api";
import type { Data } from "../builder/data";

type Declared = Schemas["StudyDetail"]["definition"]["trial"];
type Shown = RunState["trial"];

export interface ShownClips {
  readonly words: readonly string[];
  readonly stacked: boolean;
}
interface Range {
  minimum: number;
  maximum: number;
}

export interface AdminKind {
  /** The clips of a trial in the builder's preview; null where they are those of a single view. */
  preview?(trial: Data): ShownClips | null;
  /** Whether exports have a table with one row per participant and one column per cell. */
  hasWideTable?: boolean;
  /** The ends of the scale, which are what its answers mean. */
  scaleEnds?(trial: Declared): Range | null;
  /** How the clips of a trial stood; `answered` is the arrangement that its answer names. */
  presentation?(trial: Shown, answered: unknown): Extract<Shown, { kind: "paired_comparison" }>["presentation"] | null;
  /** The range of the slider that is moved while a clip runs. */
  sliderRange?(trial: Shown): Range | null;
}

/** Two clips one after the other, in the words of the preview. */
export const IN_TURN = ["1st clip", "2nd clip"];
