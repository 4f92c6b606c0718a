/**
 * What a reload without a connection needs: the link, the run's token and the run as the server gave it, brought
 * up to date with each write the server has accepted. What it has not accepted yet lies in the outbox.
 */
import type { CalibrationState, LinkState, Receipt, RunStarted, RunState, TrialInfo } from "../../api/schema";
import type { RatingBody } from "../trials/rating";
import { applyNext, nextOf } from "../trials/shared/next-trials";
import type { OutboxItem } from "../outbox/store";

export interface Kept {
  link: LinkState;
  started: RunStarted;
  run: RunState;
}
type Write = Pick<OutboxItem, "kind" | "path" | "body">;

const RUN = "/api/run/";

export class KeptVisit {
  private kept: Kept | null = null;

  constructor(
    private readonly key: string,
    private readonly storage: Storage | null,
  ) {}

  /** The visit kept here; null where there is none, or where the server must be asked before going on. */
  read(now: number = Date.now()): Kept | null {
    try {
      const found = JSON.parse(this.storage?.getItem(this.key) ?? "null") as Kept | null;
      const until = Date.parse(found?.run.resumable_until ?? "");
      this.kept = found && now < until ? found : null;
    } catch {
      this.kept = null;
    }
    return this.kept && structuredClone(this.kept);
  }

  /** Keep a run as the server has just given it, if its study lets it be taken up again. */
  begin(kept: Kept): void {
    this.kept = kept.run.resumable_until ? structuredClone(kept) : null;
    this.write();
  }

  /** The server has accepted a write. */
  note(item: Write, answer: unknown): void {
    if (!this.kept || item.kind !== "write") return;
    applyWrite(this.kept.run, item, answer);
    this.write();
  }

  forget(): void {
    this.kept = null;
    this.write();
  }

  private write(): void {
    try {
      if (this.kept) this.storage?.setItem(this.key, JSON.stringify(this.kept));
      else this.storage?.removeItem(this.key);
    } catch {
      // Full or blocked: a reload then needs the server.
    }
  }
}

/** Bring a run up to date with one write: what it says counts as given, whether or not the server has it yet. */
export function applyWrite(run: RunState, { path, body }: Pick<Write, "path" | "body">, answer: unknown = null): void {
  const [what = "", name = ""] = path.slice(RUN.length).split("/");
  if (what === "ratings") applyRating(run, body as RatingBody, answer);
  else if (what === "forms") run.answered_forms.push(decodeURIComponent(name));
  else if (what === "consent") run.consented_at ??= run.server_time;
  else if (what === "calibration") run.calibration = body as CalibrationState;
  else if (what === "withdraw") run.status = "withdrawn";
}

function applyRating(run: RunState, body: RatingBody, answer: unknown): void {
  const next = nextOf(answer);
  if (next) applyNext(run.trials, next);
  const trial = run.trials.find((one) => one.trial_index === body.trial_index);
  if (!trial) return;
  const again = (answer as { receipt?: Receipt } | null)?.receipt?.again === true;
  const plays_done = Math.max(trial.plays_done, body.play);
  const plays_wanted = Math.max(trial.plays_wanted, again ? body.play + 1 : body.play);
  Object.assign(trial, { answered: true, plays_done, plays_wanted } satisfies Partial<TrialInfo>);
  run.elapsed_ms_before = Math.max(run.elapsed_ms_before, body.time_elapsed ?? 0);
}
