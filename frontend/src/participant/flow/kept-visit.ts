/**
 * What a reload without a connection needs: the link, the run's token and the run as the server gave it, brought
 * up to date with each write the server has accepted. What it has not accepted yet lies in the outbox.
 */
import type { CalibrationState, Consent, LinkState, Receipt, RunStarted, RunState, TrialInfo, ViewsIn } from "../../api/schema";
import { applyViews } from "../views/ledger";
import { type RatingBody, applyNext, nextOf } from "../session";
import type { SafeStorage } from "./identity";
import type { OutboxItem } from "../outbox/store";

export interface Kept {
  link: LinkState;
  started: RunStarted;
  run: RunState;
}
type RefusedRecord = Pick<OutboxItem, "path" | "body">;
type Write = Pick<OutboxItem, "kind" | "path" | "body">;

const NO_VIEWS = { views_begun: 0, views: [] } satisfies Partial<TrialInfo>;
const RUN = "/api/run/";

export class KeptVisit {
  private kept: Kept | null = null;

  constructor(
    private readonly key: string,
    private readonly storage: SafeStorage | null,
  ) {}

  /** The visit kept here; null where there is none, or where the server must be asked before going on. */
  read(now: number = Date.now()): Kept | null {
    try {
      const stored = JSON.parse(this.storage?.getItem(this.key) ?? "null") as Kept | null;
      const until = Date.parse(stored?.run.resumable_until ?? "");
      this.kept = stored && now < until ? completed(stored) : null;
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

/** A visit that an earlier page has kept knows nothing of views. */
function completed(kept: Kept): Kept {
  const trials = kept.run.trials.map((trial) => ({ ...NO_VIEWS, ...trial }));
  return { ...kept, run: { ...kept.run, trials } };
}

/** Bring a run up to date with one write: what it says counts as given, whether or not the server has it yet. */
export function applyWrite(run: RunState, { path, body }: Pick<Write, "path" | "body">, answer: unknown = null): void {
  const [what = "", name = ""] = path.slice(RUN.length).split("/");
  if (what === "refused") applyRefused(run, body as RefusedRecord);
  else if (what === "ratings") applyRating(run, body as RatingBody, answer);
  else if (what === "views") applyViews(run.trials, (body as ViewsIn).views);
  else if (what === "forms") run.answered_forms.push(decodeURIComponent(name));
  else if (what === "consent") applyConsent(run, (body as Consent).agreed);
  else if (what === "calibration") run.calibration = body as CalibrationState;
  else if (what === "withdraw") run.status = "withdrawn";
}

function applyConsent(run: RunState, agreed: boolean): void {
  if (agreed) run.consented_at ??= run.server_time;
  else run.status = "withdrawn";
}

/** An answer that can never be stored is not asked for again. */
function applyRefused(run: RunState, { path, body }: RefusedRecord): void {
  const { trial_index, play } = body as Partial<Pick<RatingBody, "trial_index" | "play">>;
  const trial = path.startsWith(`${RUN}ratings/`) ? run.trials.find((one) => one.trial_index === trial_index) : undefined;
  if (!trial) return;
  const plays_done = Math.max(trial.plays_done, play ?? 1);
  Object.assign(trial, { answered: true, plays_done, plays_wanted: plays_done, views: [] } satisfies Partial<TrialInfo>);
}

function applyRating(run: RunState, body: RatingBody, answer: unknown): void {
  const next = nextOf(answer);
  if (next) applyNext(run.trials, next);
  const trial = run.trials.find((one) => one.trial_index === body.trial_index);
  if (!trial) return;
  const receipt = (answer as { receipt?: Receipt } | null)?.receipt;
  // An interrupted view fails its play by a rule that needs no server.
  const failed = Boolean(body.playback.disturbances?.["interrupted"]) && body.play <= run.playback.max_repeats;
  const again = receipt ? receipt.again : failed && trial.kind === "main";
  const plays_done = Math.max(trial.plays_done, body.play);
  const plays_wanted = Math.max(trial.plays_wanted, again ? body.play + 1 : body.play);
  const views = trial.views.filter((view) => view.play > plays_done);
  Object.assign(trial, { answered: true, plays_done, plays_wanted, views } satisfies Partial<TrialInfo>);
  run.elapsed_ms_before = Math.max(run.elapsed_ms_before, body.time_elapsed ?? 0);
}
