/** All that the screens of one visit share. */
import type {
  TrialInfo,
  RatingIn,
  CalibrationState,
  Completion,
  LinkState,
  Receipt,
  RunState,
  StageChange,
  WarningShown,
  Saved,
  NextTrials,
  RatingSaved,
} from "../api/schema";
import type { Node } from "./jspsych";
import type { PlaybackRecord } from "./playback/record";
import type { Translate } from "../i18n";
import type { InteractionLog } from "./evidence/interaction";
import type { EventLog, Outbox, Outcome } from "./outbox/outbox";
import type { ClipPlayer } from "./playback/protocol";
import type { ClipCache } from "./preload/clip-cache";
import type { RunClock } from "./screen/window";
import type { ScreenState } from "./screen/size";

// Clips that did not run as declared, waiting to be shown again at the end of their block.

export interface Replay {
  trial: TrialInfo;
  play: number;
}

export class Replays {
  private queue: Replay[] = [];

  add(trial: TrialInfo, play: number): void {
    const known = this.queue.some((one) => one.trial.trial_index === trial.trial_index && one.play === play);
    if (!known) this.queue.push({ trial, play });
    trial.plays_wanted = Math.max(trial.plays_wanted, play);
  }

  /** A play that was begun and broken off is not shown again. */
  drop(trial: TrialInfo, play: number): void {
    this.queue = this.queue.filter((one) => one.trial.trial_index !== trial.trial_index || one.play !== play);
  }

  /** The next one of this block or an earlier one, whose receipt came late; it stays until `shift`. */
  peek(block: number): Replay | null {
    return this.queue.find((one) => one.trial.block <= block) ?? null;
  }

  shift(block: number): void {
    const next = this.peek(block);
    if (next) this.queue.splice(this.queue.indexOf(next), 1);
  }
}

/** What an earlier visit still owes: played, but wanted once more. */
export function owed(trials: readonly TrialInfo[]): Replay[] {
  return trials
    .filter((trial) => trial.plays_done > 0 && trial.plays_done < trial.plays_wanted)
    .map((trial) => ({ trial, play: trial.plays_done + 1 }));
}

// What a kind of trial is to the timeline: one folder each, named as the declaration names the kind.

/** What the page sends of one play: the server's own type, every key given; its evidence is added when it is kept. */
export type RatingBody = Required<Omit<RatingIn, "playback" | "evidence">> & { playback: PlaybackRecord };

export interface Showable {
  trial: TrialInfo;
  play: number;
  next: TrialInfo | null;
}
type Maker = (session: Session, what: () => Showable) => Node;

export interface TrialKind {
  /** A trial of the main part or of practice; `what` is asked when its turn comes. */
  node: Maker;
  /** An instructed answer between trials. */
  attention: Maker;
  /** What is stored of a play that nobody could answer: its clip could not be shown, or its view was broken off. */
  unrated(session: Session, trial: TrialInfo, play: number): RatingBody;
}

export type Stage = StageChange["stage"];

export interface Session {
  link: LinkState;
  run: RunState;
  language: string;
  t: Translate;
  root: HTMLElement;
  outbox: Outbox;
  events: EventLog;
  clips: ClipCache;
  player: ClipPlayer;
  screen: ScreenState;
  clock: RunClock;
  replays: Replays;
  interaction: InteractionLog;
  /** The screens of the declared kind of trial. */
  kind: TrialKind;
  /** The screens of motion checks, where the study declares any. */
  checks: TrialKind;
  /** Warnings of the server that wait to be shown, before the next trial. */
  warnings: WarningShown[];
  /** Aborted when this page must do nothing more: another tab took over, or the participant stopped. */
  over: AbortController;
  api: RunApi;
  /** What the server gave at the end. */
  completion: Completion | null;
}

/** The writes of a run, each kept in the outbox first. */
export class RunApi {
  constructor(private readonly outbox: Outbox) {}

  consent(): Promise<Outcome> {
    return this.write("/api/run/consent", { agreed: true });
  }
  decline(): Promise<Outcome> {
    return this.write("/api/run/consent", { agreed: false });
  }
  calibration(body: CalibrationState): Promise<Outcome> {
    return this.write("/api/run/calibration", body);
  }
  form(name: string, answers: object): Promise<Outcome> {
    return this.write(`/api/run/forms/${encodeURIComponent(name)}`, { answers });
  }
  device(body: object): Promise<Outcome> {
    return this.write("/api/run/device", body);
  }
  stage(stage: Stage): Promise<Outcome> {
    return this.write("/api/run/stage", { stage });
  }

  private async write(path: string, body: unknown): Promise<Outcome> {
    return (await this.outbox.put("PUT", path, body)).receipt;
  }
}

/** Trials of the main part and attention checks: what progress counts. */
export function counted(run: Pick<RunState, "trials">): TrialInfo[] {
  return run.trials.filter((trial) => trial.kind !== "practice");
}

/** Those of them that do not come again. */
export function done(run: Pick<RunState, "trials">): TrialInfo[] {
  return counted(run).filter(isDone);
}

/** True where the trial was played as often as it is wanted. */
export const isDone = ({ answered, plays_done, plays_wanted }: TrialInfo): boolean => answered && plays_done >= plays_wanted;

export function receiptOf(outcome: Outcome): Receipt | null {
  return outcome.accepted ? ((outcome.body as { receipt?: Receipt } | null)?.receipt ?? null) : null;
}

// A run whose group an answer has just decided: its trials are known from now on.

/** The run as the page sees it: practice is not a block. */
export function withoutPractice(run: RunState): RunState {
  return { ...run, blocks: run.blocks.filter(({ block }) => block > 0) };
}

/** Take over the run that the answer to a form brings, if it brings one. */
export function placed(run: RunState, answer: unknown): void {
  const chosen = (answer as Saved | null)?.run;
  if (chosen) Object.assign(run, withoutPractice(chosen));
}

// What the server has chosen after an answer, put in the place of trials that have not begun.

const begun = new WeakSet<TrialInfo>();

/** From now on the trial keeps its clips, whatever the server chooses. */
export function begin(trial: TrialInfo): void {
  begun.add(trial);
}

export function nextOf(answer: unknown): NextTrials | null {
  return (answer as RatingSaved | null)?.next ?? null;
}

/** Change the run's trials; returns those that have other clips now. Trials of ended series count as answered. */
export function applyNext(trials: readonly TrialInfo[], next: NextTrials): TrialInfo[] {
  const at = new Map(trials.map((trial) => [trial.trial_index, trial]));
  const isOpen = (trial: TrialInfo | undefined): trial is TrialInfo => !!trial && !begun.has(trial) && trial.plays_done === 0;
  for (const index of next.closed) {
    const trial = at.get(index);
    if (isOpen(trial)) Object.assign(trial, { answered: true, plays_wanted: 0 } satisfies Partial<TrialInfo>);
  }
  return next.trials.flatMap((chosen) => {
    const trial = at.get(chosen.trial_index);
    if (!isOpen(trial) || trial.answered || (chosen.series?.known ?? 0) <= (trial.series?.known ?? -1)) return [];
    return [Object.assign(trial, chosen)];
  });
}
