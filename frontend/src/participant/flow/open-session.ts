/** From a started run to everything its screens share. */
import type { LinkState, RunStarted, RunState } from "../../api/schema";
import { translator } from "../../i18n";
import { InteractionLog } from "../evidence/interaction";
import { EventLog, type Outbox } from "../outbox/outbox";
import type { OutboxItem } from "../outbox/store";
import { hasWebCodecs } from "../playback/worker-player";
import type { ClipPlayer } from "../playback/protocol";
import { duration, pixelRatio } from "../measured";
import { ClipCache } from "../preload/clip-cache";
import { untilMeasured, RunClock } from "../screen/window";
import { ScreenState, screenShape } from "../screen/size";
import { RunApi, type Session, type TrialKind, owed, Replays } from "../session";
import { storageOf } from "./identity";
import { applyWrite } from "./kept-visit";

const LONGEST_AGENT = 1_000;
const SEND_FIRST_MS = 8_000;

/**
 * Send what an earlier visit left, so that the run document knows of it. Returns what could not be sent yet: it
 * must count as given, since it may arrive after the document was made and before the page reads it.
 */
export async function flush(outbox: Outbox, started: RunStarted, wait_ms = SEND_FIRST_MS): Promise<OutboxItem[]> {
  await outbox.open(started.run_id, started.run_token);
  await outbox.drained(wait_ms);
  return outbox.unsent();
}

export interface Opening {
  root: HTMLElement;
  link: LinkState;
  run: RunState;
  kind: TrialKind;
  checks: TrialKind;
  player: ClipPlayer;
  outbox: Outbox;
  unsent: OutboxItem[];
}

/** The run's clock: it goes on from the last answer, and after a reload from when the page before was left. */
function runClock(run: RunState, over: AbortSignal): RunClock {
  const tab = storageOf("sessionStorage");
  const name = `palpebra elapsed ${run.run_id}`;
  const clock = new RunClock(Math.max(run.elapsed_ms_before, duration(Number(tab?.getItem(name))) ?? 0));
  window.addEventListener("pagehide", () => tab?.setItem(name, String(clock.elapsed())), { signal: over });
  return clock;
}

export function openSession({ root, link, run, kind, checks, player, outbox, unsent }: Opening): Session {
  const screen = new ScreenState();
  unsent.forEach((item) => applyWrite(run, item));
  screen.restore(run.calibration);
  const over = new AbortController();
  const session: Session = {
    link,
    run,
    root,
    outbox,
    screen,
    language: run.language,
    t: translator(run.language),
    events: new EventLog(outbox),
    clips: new ClipCache(),
    player,
    clock: runClock(run, over.signal),
    replays: new Replays(),
    warnings: run.warning ? [run.warning] : [],
    kind,
    checks,
    interaction: new InteractionLog(window, over.signal),
    over,
    api: new RunApi(outbox),
    completion: null,
  };
  owed(run.trials).forEach(({ trial, play }) => session.replays.add(trial, play));
  return session;
}

/** Measure the refresh rate, and report the device to the server. */
export function describeDevice(session: Session, storage: boolean): Promise<void> {
  const report = (rate: number | null): void => {
    session.screen.refresh_rate_hz = rate;
    // A simulated visit may be over by now.
    if (!session.completion) void sendDevice(session, storage);
  };
  return untilMeasured(document, report, session.over.signal);
}

function sendDevice(session: Session, storage: boolean): Promise<unknown> {
  return session.api.device({
    refresh_rate_hz: session.screen.refresh_rate_hz,
    user_agent: navigator.userAgent.slice(0, LONGEST_AGENT),
    webcodecs: hasWebCodecs(),
    indexed_db: storage,
    touch: navigator.maxTouchPoints > 0,
    ...screenShape(),
    device_pixel_ratio: pixelRatio(window.devicePixelRatio),
    languages: navigator.languages.slice(0, 20),
  });
}
