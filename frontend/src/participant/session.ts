/** All that the screens of one visit share. */
import type { CalibrationState, Completion, LinkState, Receipt, RunState, StageChange, TrialInfo, WarningShown } from "../api/schema";
import type { Translate } from "../i18n";
import type { InteractionLog } from "./evidence/interaction";
import type { EventLog } from "./outbox/events";
import type { Outbox, Outcome } from "./outbox/outbox";
import type { ClipPlayer } from "./playback/player";
import type { ClipCache } from "./preload/clip-cache";
import type { RunClock } from "./screen/run-clock";
import type { ScreenState } from "./screen/screen-state";
import type { Replays } from "./flow/replays";
import type { TrialKind } from "./trials/kind";

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
