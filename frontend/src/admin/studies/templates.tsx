/** What participants do with somebody's own clips: the templates to begin from, as cards with pictures. */

import { Radio, SimpleGrid, Text } from "@mantine/core";
import type { ReactNode } from "react";
import type { Schemas } from "../api";

type Template = NonNullable<Schemas["OwnClips"]["template"]>;

export interface TemplateWords {
  value: Template;
  label: string;
  about: string;
  question: string;
  /** Whether the two ends of a scale are asked for. */
  ends: boolean;
  /** Whether clips vary along a factor whose levels are numbers. */
  isAlongNumbers?: boolean;
}

export const TEMPLATES: readonly [TemplateWords, ...TemplateWords[]] = [
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
    about: "Two clips side by side. Each clip is compared with every other; to restrict that, see Build, Trial.",
    question: "Which clip looked more natural?",
    ends: false,
  },
  {
    value: "just_noticeable",
    label: "Just-noticeable difference",
    about:
      "Two clips in turn, the standard and a stimulus, in adaptive series. One factor has numbers as levels; the lowest is the standard.",
    question: "In which of the two clips was the effect stronger?",
    ends: false,
    isAlongNumbers: true,
  },
];

// Each picture is the screen of the trial: clips as dark boxes, answers below.

const CLIP = { fill: "currentColor", opacity: 0.75, rx: 2 };
const LINE = { stroke: "currentColor", strokeWidth: 1.5, fill: "none" };

const Dots = ({ number, y = 46 }: { number: number; y?: number }) => (
  <>
    {Array.from({ length: number }, (_, index) => (
      <circle key={index} cx={48 + (index - (number - 1) / 2) * (60 / (number - 1))} cy={y} r={3} {...LINE} />
    ))}
  </>
);

const Slider = ({ y, at }: { y: number; at: number }) => (
  <>
    <path d={`M18 ${y}H78`} {...LINE} />
    <circle cx={at} cy={y} r={3.5} fill="var(--mantine-primary-color-filled)" />
  </>
);

const PICTURES: Readonly<Record<Template, ReactNode>> = {
  rating: (
    <>
      <rect x={30} y={6} width={36} height={28} {...CLIP} />
      <Dots number={7} />
    </>
  ),
  slider: (
    <>
      <rect x={30} y={6} width={36} height={28} {...CLIP} />
      <Slider y={46} at={58} />
    </>
  ),
  sliders: (
    <>
      <rect x={34} y={4} width={28} height={22} {...CLIP} />
      <Slider y={36} at={34} />
      <Slider y={48} at={62} />
    </>
  ),
  acr: (
    <>
      <rect x={8} y={8} width={40} height={40} {...CLIP} />
      {[10, 19, 28, 37, 46].map((y) => (
        <path key={y} d={`M58 ${y}H${y === 19 ? 88 : 80}`} {...LINE} strokeWidth={y === 19 ? 4 : 2} />
      ))}
    </>
  ),
  dcr: (
    <>
      <rect x={10} y={6} width={30} height={26} {...CLIP} />
      <path d="M43 19h9m-3-3 3 3-3 3" {...LINE} />
      <rect x={56} y={6} width={30} height={26} {...CLIP} opacity={0.4} />
      <Dots number={5} />
    </>
  ),
  pairs: (
    <>
      <rect x={8} y={8} width={36} height={30} {...CLIP} />
      <rect x={52} y={8} width={36} height={30} {...CLIP} />
      <rect x={51} y={7} width={38} height={32} rx={3} stroke="var(--mantine-primary-color-filled)" strokeWidth={2} fill="none" />
      <path d="M20 47H32M64 47H76" {...LINE} strokeWidth={3} />
    </>
  ),
  just_noticeable: (
    <>
      <path d="M10 6V50H88" {...LINE} />
      <path d="M14 12H24V20H34V30H44V24H54V34H64V30H74V36H86" {...LINE} stroke="var(--mantine-primary-color-filled)" strokeWidth={2} />
    </>
  ),
};

interface CardsProps {
  chosen: TemplateWords;
  onChoose: (template: TemplateWords) => void;
}

/** The templates; arrow keys move between them. */
export function TemplateCards({ chosen, onChoose }: CardsProps) {
  return (
    <Radio.Group
      label="What participants do"
      description={chosen.about}
      value={chosen.value}
      onChange={(value) => onChoose(TEMPLATES.find((one) => one.value === value) ?? chosen)}
    >
      <SimpleGrid cols={{ base: 2, sm: 4 }} spacing="xs" mt="xs">
        {TEMPLATES.map(({ value, label }) => (
          <Radio.Card key={value} value={value} className="template-card" aria-label={label}>
            <svg viewBox="0 0 96 56" width={96} height={56} aria-hidden="true">
              {PICTURES[value]}
            </svg>
            <Text size="sm">{label}</Text>
          </Radio.Card>
        ))}
      </SimpleGrid>
    </Radio.Group>
  );
}
