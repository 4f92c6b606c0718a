/** The run of a visit: from its start by its timeline to the last page. */
import { withoutPractice, type Session } from "../session";
import type { RunStarted, RunState } from "../../api/schema";
import { loadMessages } from "../../i18n";
import { loadModule } from "../../ui/load-module";
import { runTimeline, type SimulationMode } from "../jspsych";
import { Outbox } from "../outbox/outbox";
import type { OutboxStore } from "../outbox/store";
import { choosePlayer, hasWebCodecs } from "../playback/worker-player";
import { call } from "../request";
import { emptied, showNotice } from "../screens/support";
import { loadChecks, loadKind } from "../kinds";
import { saveInterrupted } from "../trials/rating";
import { settleInterrupted } from "../views/ledger";
import { setLanguage, setScales } from "./start-page";
import { fetchFirst, timeline } from "./timeline";
import type { GateFinding } from "./gates";
import { type Identity, storageOf } from "./identity";
import type { KeptVisit } from "./kept-visit";
import { type Entry, persistently, wayBack } from "./link";
import { describeDevice, flush, openSession } from "./open-session";

// Lets a reload without a connection find the page: see service-worker.ts.

function serveOffline(): void {
  // Private windows and some settings have none: a reload then needs the server.
  try {
    if (!("serviceWorker" in navigator)) return;
    void Promise.resolve(navigator.serviceWorker.register("/service-worker.js", { scope: "/run/" })).catch(() => {});
  } catch {
    // Denied with the cookies.
  }
}

// What is noted all the time: full screen left, the connection lost and back, and that the page is alive.

const HEARTBEAT_MS = 20_000;

function watch(session: Session): void {
  const { events, outbox, over } = session;
  const { signal } = over;
  document.addEventListener(
    "fullscreenchange",
    () => {
      if (!document.fullscreenElement && !signal.aborted) events.add("fullscreen_left");
    },
    { signal },
  );
  window.addEventListener("offline", () => events.add("offline"), { signal });
  window.addEventListener(
    "online",
    () => {
      events.add("online");
      outbox.nudge();
    },
    { signal },
  );
  const beat = setInterval(() => {
    // While answers are waiting a sign of life is of no use; it would only fill the outbox.
    if (outbox.state.failures === 0 && !document.hidden) events.add("heartbeat", { stage: session.run.stage });
  }, HEARTBEAT_MS);
  signal.addEventListener("abort", () => clearInterval(beat));
}

/** The run in its present state. */
export async function fetchRun(token: string): Promise<RunState> {
  return withoutPractice(await call<RunState>("GET", "/api/run", { token, timeout_ms: 30_000 }));
}

/** A notice appears if choosing the player takes longer than this. */
const SEEN_MS = 1_500;
/** The tab counts under this key how often the end of the study led back to unfinished parts. */
export const RETURNED = "palpebra returns";

/** From a started run to its timeline: what an earlier page left is sent, or counted, first. */
export async function enter(
  entry: Entry,
  identity: Identity,
  store: OutboxStore,
  started: RunStarted,
  warnings: GateFinding[],
): Promise<void> {
  const { root, t, link, keeping, kept } = entry;
  const outbox = outboxOf(root, store, keeping);
  // Loaded before anything is sent where the kind is known: an answer that ends the run must find its listener.
  const known = kept && (await loadKind(kept.run.trial.kind));
  const unsent = await flush(outbox, started, kept ? 0 : undefined);
  const run = kept?.run ?? (await persistently(root, t, () => fetchRun(started.run_token)));
  if (!kept) keeping.begin({ link, started, run });
  const kind = known ?? (await loadKind(run.trial.kind));
  identity.keepTab();
  const checks = run.checks ? await loadChecks() : kind;
  await loadMessages(run.language);
  // A worker that is blocked says nothing for a while: the page says what it waits for.
  const wait = setTimeout(() => showNotice(root, { title: t("preload_title"), text: t("saving_wait") }), SEEN_MS);
  const player = await choosePlayer(run.display).finally(() => clearTimeout(wait));
  const session = openSession({ root, link, run, kind, checks, player, outbox, unsent });
  setLanguage(run.language);
  setScales(run.display.right_to_left_scales);
  const over = (): Promise<void> => {
    keeping.forget();
    return persistently(root, session.t, () => fetchRun(started.run_token)).then(async (now) =>
      (await loadModule(() => import("../screens/completion"))).ended(root, session.t, now, started, identity, wayBack(session.t, link)),
    );
  };
  if (run.status !== "active") return over();
  root.addEventListener(
    "run-over",
    () => {
      session.over.abort();
      emptied(root);
      void over();
    },
    { once: true },
  );
  if (hasWebCodecs() && player.method === "video") session.events.add("unsupported", { reason: "gate_video", worker: "blocked" });
  for (const { reason } of warnings) session.events.add(reason === "gate_storage" ? "storage_blocked" : "unsupported", { reason });
  if (kept) session.events.add("offline", { loaded_without_server: true });
  if (run.resumable_until) serveOffline();
  // Asked for now, so that it is here when it is wanted, also without a connection.
  const last = loadModule(() => import("../screens/completion"));
  await play(session, started, store.durable, () => {
    keeping.begin({ link, started, run: session.run });
    if (session.run.resumable_until) serveOffline();
  });
  if (!session.completion) return;
  keeping.forget();
  const { nextPerson, showCompletion } = await last;
  showCompletion(session, emptied(root), session.completion, nextPerson(session.t, identity));
}

/** An outbox whose answers keep the visit up to date, and announce that the run ends or goes on elsewhere. */
function outboxOf(root: HTMLElement, store: OutboxStore, keeping: KeptVisit): Outbox {
  const announce = (what: "run-over" | "taken-over"): void => void root.dispatchEvent(new CustomEvent(what));
  return new Outbox(store, {
    onAccepted(item, body) {
      keeping.note(item, body);
      if (statusIn(body) === "screened_out") announce("run-over");
    },
    onRefused({ status, code }) {
      if (status === 401) announce("taken-over");
      else if (code === "run_closed") announce("run-over");
    },
  });
}

/** The run's status in the answer to a write, or in its receipt. */
function statusIn(body: unknown): RunState["status"] | undefined {
  const answer = body as { status?: RunState["status"]; receipt?: { status: RunState["status"] } } | null;
  return answer?.receipt?.status ?? answer?.status;
}

/** `hasTrials` is called where an answer in this visit decides the group, and with it the trials. */
async function play(session: Session, started: RunStarted, durable: boolean, hasTrials: () => void): Promise<void> {
  const { root, run, outbox, over } = session;
  const end = (): void => {
    over.abort();
    outbox.stop();
  };
  root.addEventListener("tab-taken", () => {
    session.events.add("second_tab");
    end();
  });
  root.addEventListener("taken-over", end);
  // Asked for now, as the last page is.
  const dialog = loadModule(() => import("../screens/stop-dialog"));
  root.addEventListener("stop", () => void dialog.then(({ openStopDialog }) => openStopDialog(session)));
  watch(session);
  fetchFirst(session);
  void describeDevice(session, durable);
  await settleInterrupted(session, (trial, play) => saveInterrupted(session, trial, play));
  root.replaceChildren();
  if (run.awaits_group) {
    await runTimeline(root, timeline(session, started.run_token), simulation(run));
    hasTrials();
    root.replaceChildren();
  }
  await runTimeline(root, timeline(session, started.run_token), simulation(run));
  if (session.completion) storageOf("sessionStorage")?.removeItem(RETURNED);
}

/** Only previews and synthetic runs may answer themselves. */
function simulation(run: RunState): SimulationMode | null {
  const mode = new URLSearchParams(location.search).get("simulate");
  return (run.origin === "preview" || run.origin === "simulated") && (mode === "visual" || mode === "data-only") ? mode : null;
}
