/**
 * The view ledger: each view is on disk before its first frame, and on the server as soon as that can be reached.
 * If a page dies during a view, the next page marks the view as interrupted. If the view was complete, the next page
 * asks for the answer without showing the clip again.
 */
import type { TrialInfo, ViewIn, ViewState } from "../../api/schema";
import { clockTime, count, duration, frameLog, offset, pixels, within } from "../measured";
import { ticketOf } from "../evidence/evidence";
import { disturbancesOf } from "../playback/record";
import type { Shown } from "../trials/showing";
import type { Session } from "../session";

// Decision 0520: Every view is stored before its first frame.
/** A showing and the roles of the clips that were in it: one clock has drawn them all. */
export interface RolesShown {
  roles: string[];
  showing: Shown;
}

export interface OpenView {
  /** Resolves when the start is kept: no frame may be drawn before. */
  kept: Promise<void>;
  end(shown: readonly RolesShown[]): Promise<void>;
  /** What is shown; where that fails, the view has ended as interrupted. */
  unlessBroken<Result>(showing: Promise<Result>): Promise<Result>;
}

const PATH = "/api/run/views";
/** Where the browser keeps nothing the server is asked to; a clip waits no longer than this for it. */
const NOT_KEPT_WAIT_MS = 3_000;
const INTERRUPTED = { outcome: "interrupted", disturbances: { interrupted: 1 } } as const;
const RELOADED = "scale_reloaded";

/** Begin a view of a trial that starts now. */
export function beginView(session: Session, trial: TrialInfo, play: number): OpenView {
  // Counted before it is kept: a view whose beginning is lost leaves a gap, never a number that two have.
  trial.views_begun += 1;
  const view: ViewIn = {
    id: crypto.randomUUID(),
    trial_index: trial.trial_index,
    number: trial.views_begun,
    play,
    started_at_client: clockTime(),
    screen: { ...session.screen.record(), width_px: pixels(window.innerWidth), height_px: pixels(window.innerHeight) },
    evidence: ticketOf(session, trial, play),
  };
  return {
    kept: send(session, view),
    unlessBroken: (showing) =>
      showing.catch(async (error: unknown) => {
        await send(session, { ...view, ...INTERRUPTED });
        throw error;
      }),
    end: (shown) => send(session, { ...view, ended_at_client: clockTime(), ...ending(trial, shown) }),
  };
}

async function send(session: Session, view: ViewIn): Promise<void> {
  const { receipt } = await session.outbox.put("POST", PATH, { views: [view] });
  // On disk it survives whatever happens to the page; only without a disk must the server have it first.
  if (session.outbox.durable) return;
  await Promise.race([receipt, new Promise((resolve) => setTimeout(resolve, NOT_KEPT_WAIT_MS))]);
}

function ending(trial: TrialInfo, shown: readonly RolesShown[]): Partial<ViewIn> {
  const showings = shown.map(({ roles, showing }) => ({
    roles: roles as NonNullable<ViewIn["showings"]>[number]["roles"],
    method: showing.method as "webcodecs" | "video",
    frames: count(showing.frames) ?? 0,
    fps: within(showing.fps, 0.001, 1000) ?? 0,
    ended_ms: duration(showing.ended_at_ms - showing.key_at_ms) ?? -1,
    stalls: count(showing.stalls) ?? 0,
    clock_gap_ms: duration(showing.clock_gap_ms),
    clock_late_ms: offset(showing.clock_late_ms),
    focus_lost: count(showing.focus_lost) ?? 0,
    visible_share: within(showing.visible_share, 0, 1),
    refresh_ms: duration(showing.refresh_ms),
  }));
  // A showing of which so much is unknown is not one that another page could ask about.
  if (showings.some(({ fps, ended_ms }) => fps === 0 || ended_ms < 0))
    return { outcome: "shown", showings: null, clips: seenClips(trial, shown) };
  return { outcome: "shown", showings, clips: seenClips(trial, shown), disturbances: disturbancesOf(shown.map(({ showing }) => showing)) };
}

/** Every clip of a showing as the server keeps a view: each with the log of the one clock. */
function seenClips(trial: TrialInfo, shown: readonly RolesShown[]): NonNullable<ViewIn["clips"]> {
  return trial.clips.map(({ role, clip_sha256, frames }) => {
    const showing = shown.find(({ roles }) => roles.includes(role))?.showing;
    const start = showing?.key_at_ms ?? 0;
    const log = frameLog((showing?.drawn ?? []).map(([index, at_ms]): [number, number] => [Math.min(index, frames - 1), at_ms - start]));
    // A shorter clip holds its last frame while the longer goes on: it is drawn again, but it is seen once.
    const first = log.filter(([index], row) => row === 0 || log[row - 1]?.[0] !== index);
    return { role, clip_sha256, drawn: first };
  });
}

/** The views of this play that an earlier page has shown to their end; times are this clock's, as far as it was right. */
export function viewsBefore(trial: TrialInfo, play: number): RolesShown[][] {
  // Where answers decide on clips, another one may have been chosen meanwhile.
  const same = (view: ViewState): boolean => view.clips.every((seen) => trial.clips.some((clip) => clip.clip_sha256 === seen.clip_sha256));
  return trial.views.filter((view) => view.play === play && view.outcome === "shown" && view.showings && same(view)).map(restored);
}

/** True where the last of these was shown by an earlier page. */
export function isFromBefore(showings: readonly Pick<Shown, "disturbances">[]): boolean {
  return Boolean(showings.at(-1)?.disturbances[RELOADED]);
}

interface Span {
  began_at_ms: number | undefined;
  ended_at_ms: number | undefined;
}

/** When the last showing drew its first and last frame; undefined if an earlier page showed the clip: the answer did not follow it on this page. */
export function spanOf(showings: readonly Shown[]): Span {
  const last = isFromBefore(showings) ? undefined : showings.at(-1);
  return { began_at_ms: last?.drawn[0]?.[1], ended_at_ms: last?.drawn.at(-1)?.[1] ?? last?.ended_at_ms };
}

/** Response times from what was shown to the answer, in ms. */
export function timesOf({ began_at_ms, ended_at_ms }: Span, answered_at_ms: number) {
  const since = (start: number | undefined): number | null => (start === undefined ? null : duration(answered_at_ms - start));
  return { rt: since(ended_at_ms), rt_from_first_frame: since(began_at_ms) };
}

function restored(view: ViewState): RolesShown[] {
  const began_ms = Date.parse(view.started_at_client);
  const key_at_ms = Number.isNaN(began_ms) ? 0 : began_ms;
  return (view.showings ?? []).map(({ roles, visible_share, refresh_ms, ended_ms, ...measured }, number, { length }) => {
    // If several clips are shown at once, the log of the longest has every frame that the clock drew.
    const logs = view.clips.filter(({ role }) => roles.includes(role)).map(({ drawn }) => drawn);
    const log = logs.reduce((longest, one) => (one.length > longest.length ? one : longest), []);
    const drawn = log.map(([index, ms]): [number, number] => [index, key_at_ms + ms]);
    const kept = { visible_share: visible_share ?? 1, refresh_ms: refresh_ms ?? null, early_keys: 0, logs_frames: drawn.length > 1 };
    // The view's own counts are those of all its showings: they are reported once.
    const disturbances: Record<string, number> = number === length - 1 ? { ...view.disturbances, [RELOADED]: 1 } : {};
    return { roles, showing: { ...measured, ...kept, drawn, key_at_ms, ended_at_ms: key_at_ms + ended_ms, disturbances } };
  });
}

/**
 * End what an earlier page has left open, as interrupted. Its play fails without an answer, so that the trial comes
 * once more at the end of its block; in practice it is shown again in its place.
 */
export async function settleInterrupted(session: Session, file: (trial: TrialInfo, play: number) => Promise<void>): Promise<void> {
  for (const trial of session.run.trials) {
    // Under the id of the view that began: the server completes it, and counts no second one.
    for (const { id, number, play, started_at_client } of trial.views.filter(({ ended }) => !ended)) {
      const start = { id, trial_index: trial.trial_index, number, play, started_at_client, evidence: ticketOf(session, trial, play) };
      await send(session, { ...start, ...INTERRUPTED });
      if (trial.kind !== "practice" && trial.plays_done < play) await file(trial, play);
    }
  }
}

/** Bring a run up to date with views that were sent, whether or not the server has them yet. */
export function applyViews(trials: readonly TrialInfo[], sent: readonly ViewIn[]): void {
  for (const view of sent) {
    const trial = trials.find((one) => one.trial_index === view.trial_index);
    if (!trial) continue;
    const play = view.play ?? view.number;
    trial.views_begun = Math.max(trial.views_begun, view.number);
    // The end of a view has the id of its beginning, and takes its place.
    trial.views = trial.views.filter((one) => one.id !== view.id);
    // A play that has its answer needs no view any more.
    if (play <= trial.plays_done) continue;
    trial.views.push({
      id: view.id,
      number: view.number,
      play,
      started_at_client: view.started_at_client ?? "",
      ended: Boolean(view.outcome ?? view.ended_at_client),
      outcome: view.outcome ?? null,
      showings: view.showings ?? null,
      clips: view.clips ?? [],
      disturbances: view.disturbances ?? {},
    });
  }
}
