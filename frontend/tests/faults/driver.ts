/**
 * Many participants at once, each with the page's own outbox and IndexedDB (a shim in memory), against a real
 * server behind a bad network. They reload at random, and write down what was acknowledged.
 *
 * node driver.js ADDRESS LINK PARTICIPANTS PACE_MS HURRY > acknowledged.json
 *
 * HURRY shortens the pauses between tries: at 4 a person's patience of a minute passes in a quarter of one.
 */
import { IDBFactory } from "fake-indexeddb";
import { isTemporary, NetworkError, request, type Answer } from "../../src/participant/request";
import type { RunStarted, RunState } from "../../src/api/schema";
import type { RatingBody } from "../../src/participant/session";
import { backoff, Outbox } from "../../src/participant/outbox/outbox";
import { IndexedDbStore } from "../../src/participant/outbox/store";
import { flush } from "../../src/participant/flow/open-session";
import { playbackRecord } from "../../src/participant/playback/record";

declare const process: { argv: string[] };
const [base = "", link = "", participants = "1", pace_ms = "20", hurry = "1"] = process.argv.slice(2);
const RATING = "/api/run/ratings/";
const RELOAD_CHANCE = 0.02;

interface Acknowledged {
  rating_id: string;
  run_id: string;
  trial_index: number;
  response: number;
}
const acknowledged: Acknowledged[] = [];
const refused: { path: string; status: number; body: unknown }[] = [];
let given = 0;
let reloads = 0;

const pause = (ms: number): Promise<void> => sleep(ms / Number(hurry));
const sleep = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

async function insist<Body>(method: string, path: string, options: { token?: string; body?: unknown } = {}): Promise<Body> {
  for (let failures = 1; ; failures += 1) {
    const answer = await request(method, path, { ...options, base }).catch((error: unknown) => {
      if (error instanceof NetworkError) return null;
      throw error;
    });
    if (answer && !isTemporary(answer.status)) {
      if (answer.status >= 300) throw new Error(`${method} ${path}: ${answer.status} ${JSON.stringify(answer.body)}`);
      return answer.body as Body;
    }
    await pause(backoff(failures));
  }
}

function watched(run_id: string) {
  return async (method: string, path: string, options: { token: string; body: unknown }): Promise<Answer> => {
    const answer = await request(method, path, { ...options, base });
    if (path.startsWith(RATING)) note(run_id, path, options.body as RatingBody, answer);
    return answer;
  };
}

function note(run_id: string, path: string, body: RatingBody, answer: Answer): void {
  if (answer.status === 200 || answer.status === 201) {
    const response = body.answer.kind === "clip_rating" ? (body.answer.answers["rating"]?.response ?? 0) : 0;
    acknowledged.push({ rating_id: path.slice(RATING.length), run_id, trial_index: body.trial_index, response });
  } else if (!isTemporary(answer.status)) refused.push({ path, status: answer.status, body: answer.body });
}

async function participant(): Promise<void> {
  const factory = new IDBFactory();
  const client_id = crypto.randomUUID();
  for (;;) if (await visit(factory, client_id)) return;
}

/** One visit from load to reload; true when the run is complete. */
async function visit(factory: IDBFactory, client_id: string): Promise<boolean> {
  const started = await insist<RunStarted>("POST", `/api/links/${link}/runs`, {
    body: { language: "en", client_id, query: {}, device: {} },
  });
  const outbox = new Outbox(await IndexedDbStore.open(factory), { send: watched(started.run_id), pause });
  const unsent = await flush(outbox, started);
  const run = await insist<RunState>("GET", "/api/run", { token: started.run_token });
  if (!run.consented_at) await outbox.put("PUT", "/api/run/consent", { agreed: true });
  const waiting = new Set(unsent.map((item) => (item.body as RatingBody).trial_index));
  for (const trial of run.trials.filter((one) => !one.answered && !waiting.has(one.trial_index))) {
    await sleep(Number(pace_ms) * (0.5 + Math.random()));
    const id = crypto.randomUUID();
    await outbox.put("PUT", RATING + id, ratingOf(trial), id);
    given += 1;
    if (Math.random() < RELOAD_CHANCE) {
      reloads += 1;
      outbox.stop();
      return false;
    }
  }
  await outbox.drained();
  await insist("POST", "/api/run/complete", { token: started.run_token });
  return true;
}

function ratingOf(trial: RunState["trials"][number]): RatingBody {
  const frames = trial.frames ?? 0;
  const period = 1000 / 30;
  const drawn = Array.from({ length: frames }, (_, index): [number, number] => [index, 10 + index * period]);
  const showing = {
    method: "webcodecs" as const,
    key_at_ms: 0,
    ended_at_ms: frames * period,
    drawn,
    frames,
    fps: 30,
    stalls: 0,
    clock_gap_ms: 17,
    clock_late_ms: 1,
    focus_lost: 0,
    disturbances: {},
    visible_share: 1,
    refresh_ms: 16.7,
  };
  return {
    trial_index: trial.trial_index,
    play: 1,
    answer: { kind: "clip_rating", answers: { rating: { response: 1 + Math.floor(Math.random() * 7) } } },
    rt: 500,
    rt_from_first_frame: 1_500,
    time_elapsed: 1_000 * (trial.trial_index + 1),
    changes: 0,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(trial.clip_sha256, [showing], { refresh_rate_hz: 60, device_pixel_ratio: 1 }),
  };
}

await Promise.all(Array.from({ length: Number(participants) }, participant));
console.log(JSON.stringify({ acknowledged, refused, given, reloads }));
