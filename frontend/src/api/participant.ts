/** What the participant page and the server say to each other, under the names the page uses. */

export type Translated = Record<string, string>;
export type TrialKind = "practice" | "main" | "attention";
export type Verdict = "good" | "flagged" | "failed";
export type PlaybackMethod = "webcodecs" | "video" | "none";
export type Stage =
  | "consent" | "forms_before" | "calibration" | "instructions" | "practice" | "trials" | "forms_after" | "debrief" | "done";

export interface Gates {
  minimum_width_px: number;
  minimum_height_px: number;
  allow_touch: boolean;
  full_screen: boolean;
  calibrate: "required" | "optional" | "off";
  viewing_distance: boolean;
  inter_ocular_mm: number;
}

export interface LinkDocument {
  study: { name: string; title: string; languages: string[]; background: string; expected_minutes: number };
  status: "open" | "closed" | "expired" | "full" | "paused" | "used";
  kind: "general" | "personal" | "preview";
  resumable: boolean;
  gates: Gates;
}

export interface StartedRun { run_token: string; run_id: string; resumed: boolean }

interface FieldBase { name: string; label: Translated; help?: Translated | null; required: boolean }
export interface TextField extends FieldBase { type: "text"; max_length: number }
export interface NumberField extends FieldBase { type: "number"; minimum: number; maximum: number }
export interface Option { value: string; label: Translated }
export interface ChoiceField extends FieldBase { type: "choice"; options: Option[] }
export interface MultipleChoiceField extends FieldBase { type: "multiple_choice"; options: Option[] }
export interface LikertField extends FieldBase { type: "likert"; points: number; low: Translated; high: Translated }
export type FormField = TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField;
export interface Form { name: string; when: "before" | "after"; title: Translated; fields: FormField[] }
export type FormAnswers = Record<string, string | number | string[] | null>;

export interface Scale { minimum: number; maximum: number; question: Translated; low: Translated; high: Translated }
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

export interface Calibration {
  px_per_mm: number;
  method: "card" | "ruler";
  viewing_distance_mm: number | null;
  device_pixel_ratio: number;
  screen_width_px: number;
  screen_height_px: number;
  window_width_px: number;
  window_height_px: number;
  zoom: number;
}

export interface AssignedTrial {
  trial_index: number;
  kind: TrialKind;
  block: number;
  clip_sha256: string | null;
  clip_url: string | null;
  frames: number | null;
  fps: number | null;
  bytes: number | null;
  width_px: number | null;
  height_px: number | null;
  width_mm: number | null;
  inter_ocular_px: number | null;
  prompt: string | null;
  plays_done: number;
  plays_wanted: number;
  answered: boolean;
}

export interface Texts { consent: string; instructions: string; practice: string; block_break: string; debrief: string }

export interface RunDocument {
  run_id: string;
  status: "active" | "complete" | "screened_out" | "withdrawn";
  stage: Stage;
  preview: boolean;
  synthetic: boolean;
  language: string;
  texts: Texts;
  forms: Form[];
  trial: ClipRating;
  display: Gates & { background: string };
  break_seconds_min: number;
  consented_at: string | null;
  calibration: Calibration | null;
  answered_forms: string[];
  blocks: { block: number; trials: number }[];
  trials: AssignedTrial[];
  elapsed_ms_before: number;
}

export interface PlaybackRecord {
  method: PlaybackMethod;
  clip_sha256: string | null;
  key_to_first_frame_ms: number | null;
  frames_drawn: number;
  frames_late: number;
  frames_missing: number;
  longest_gap_ms: number | null;
  stalls: number;
  focus_lost: boolean;
  refresh_rate_hz: number | null;
  device_pixel_ratio: number;
  drawn: [index: number, t_ms: number][];
}

export interface RatingBody {
  trial_index: number;
  play: number;
  response: number | null;
  rt: number | null;
  rt_from_first_frame: number | null;
  time_elapsed: number;
  changes: number;
  comment: string | null;
  answered_at_client: string;
  playback: PlaybackRecord;
}

export interface Receipt { rating_id: string; saved_at: string; verdict: Verdict; rule: string | null; again: boolean; remaining: number }

export type EventType =
  | "heartbeat" | "focus_lost" | "fullscreen_left" | "clip_unavailable" | "unsupported" | "storage_blocked"
  | "offline" | "online" | "stage" | "clock_changed" | "second_tab";
export interface RunEvent { id: string; type: EventType; at: string; data: Record<string, unknown> }

export interface Completion { completion_code: string | null; redirect_url: string | null }
