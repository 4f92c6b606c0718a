/** What participants do with somebody's own clips: the templates to begin from. */

import type { Schemas } from "../api";

type Template = NonNullable<Schemas["OwnClips"]["template"]>;

interface Words {
  value: Template;
  label: string;
  about: string;
  question: string;
  /** Whether the two ends of a scale are asked for. */
  ends: boolean;
}

export const TEMPLATES: readonly [Words, ...Words[]] = [
  {
    value: "rating",
    label: "Rating on seven points",
    about: "One clip after the other, each rated from 1 to 7.",
    question: "How natural was this clip?",
    ends: true,
  },
  {
    value: "slider",
    label: "Rating on a slider",
    about: "One clip after the other, each rated on a slider from 0 to 100.",
    question: "How natural was this clip?",
    ends: true,
  },
  {
    value: "sliders",
    label: "Several sliders",
    about: "One clip after the other, with two sliders from 0 to 100 to begin with.",
    question: "How natural was this clip?",
    ends: true,
  },
  {
    value: "acr",
    label: "Mean opinion score (ACR)",
    about: "Absolute category rating of ITU-T P.910: Bad, Poor, Fair, Good, Excellent.",
    question: "How would you rate the quality of this clip?",
    ends: false,
  },
  {
    value: "dcr",
    label: "Degradation (DCR)",
    about: "ITU-T P.910: the reference, then the clip, from Very annoying to Imperceptible.",
    question: "How impaired is the second clip, compared with the first?",
    ends: false,
  },
  {
    value: "pairs",
    label: "Paired comparisons",
    about: "Two clips side by side: which of them? Every clip meets every other of the same exemplar number.",
    question: "Which clip looked more natural?",
    ends: false,
  },
  {
    value: "just_noticeable",
    label: "Just-noticeable difference",
    about:
      "Two clips in turn, the standard and a stimulus, in adaptive series. One factor has numbers as its levels; the lowest is the standard.",
    question: "In which of the two clips was the effect stronger?",
    ends: false,
  },
];
