/**
 * What the participant page and the server say to each other: the server's own types under the page's names.
 * Where the schema says only "an object" (texts, forms, the declared trial), the declaration's shape is given here.
 */
import type { components } from "./schema";

type Schemas = components["schemas"];

type Translated = Record<string, string>;
export type LinkDocument = Schemas["LinkState"];
export type Gates = Schemas["Gates"];
export type StartedRun = Schemas["RunStarted"];
export type AssignedTrial = Schemas["TrialInfo"];
export type Stage = Schemas["StageChange"]["stage"];
export type Calibration = Required<Schemas["CalibrationState"]>;
export type Receipt = Schemas["Receipt"];
export type RatingBody = Required<Omit<Schemas["RatingIn"], "playback">> & { playback: PlaybackRecord };
export type Completion = Schemas["Completion"];

export type PlaybackRecord = Required<Omit<Schemas["PlaybackLog"], "drawn">> & { drawn: [index: number, t_ms: number][] };
export type PlaybackMethod = PlaybackRecord["method"];

export type EventType =
  | "heartbeat"
  | "focus_lost"
  | "fullscreen_left"
  | "clip_unavailable"
  | "unsupported"
  | "storage_blocked"
  | "offline"
  | "online"
  | "stage"
  | "clock_changed"
  | "second_tab";
export type RunEvent = Schemas["Event"] & { type: EventType };

export interface RunDocument extends Omit<Schemas["RunState"], "texts" | "forms" | "trial" | "display"> {
  texts: Texts;
  forms: Form[];
  trial: ClipRating;
  display: Gates & { background: string };
}

interface Texts {
  consent: string;
  instructions: string;
  practice: string;
  block_break: string;
  debrief: string;
  screened_out?: string;
}

export interface Scale {
  minimum: number;
  maximum: number;
  question: Translated;
  low: Translated;
  high: Translated;
}
export interface ClipRating {
  kind: "clip_rating";
  scale: Scale;
  views: number;
  start: "key" | "fixation";
  fixation_ms: number;
  confirm: boolean;
  comment: boolean;
  expected_seconds: number;
}

interface FieldBase {
  name: string;
  label: Translated;
  help?: Translated | null;
  required: boolean;
}
interface TextField extends FieldBase {
  type: "text";
  max_length: number;
}
interface NumberField extends FieldBase {
  type: "number";
  minimum: number;
  maximum: number;
}
interface Option {
  value: string;
  label: Translated;
}
interface ChoiceField extends FieldBase {
  type: "choice";
  options: Option[];
}
interface MultipleChoiceField extends FieldBase {
  type: "multiple_choice";
  options: Option[];
}
interface LikertField extends FieldBase {
  type: "likert";
  points: number;
  low: Translated;
  high: Translated;
}
export type FormField = TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField;
export interface Form {
  name: string;
  when: "before" | "after";
  title: Translated;
  fields: FormField[];
}
export type FormAnswers = Record<string, string | number | string[] | null>;
