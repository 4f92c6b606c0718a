/** Where the participant's page begins: link, gates, one tab, the run, its timeline. */
import "./style/index.css";
import type { LinkState, RunStarted, RunState } from "../api/schema";
import { Refused } from "./request";
import { loadMessages, type MessageKey, preferred, SHIPPED, translator, type Translate } from "../i18n";
import { setLanguage, setScales, setSurround } from "./flow/appearance";
import { fetchFirst } from "./flow/blocks";
import { abilities, findings, type GateFinding, lackOfRoom, measures } from "./flow/gates";
import { Identity, recruiterQuery, storageKey, storageOf } from "./flow/identity";
import { type Kept, KeptVisit } from "./flow/kept-visit";
import { fetchRun, persistently, reach, startRun, wayBack } from "./flow/link";
import { describeDevice, flush, openSession } from "./flow/open-session";
import { asksForCode, type Claim } from "./flow/resume-code";
import { serveOffline } from "./flow/serve-offline";
import { type Beginning, startPage, titleOf } from "./flow/start-page";
import { timeline } from "./flow/timeline";
import { watch } from "./flow/watchers";
import { runTimeline, type SimulationMode } from "./jspsych";
import { choosePlayer } from "./playback/choose";
import { IndexedDbStore } from "./outbox/indexed-db";
import { Outbox } from "./outbox/outbox";
import { MemoryStore, type OutboxStore } from "./outbox/store";
import { loadModule } from "../ui/load-module";
import { claimTab } from "./screen/one-tab";
import { AnswersMissing } from "./screens/finish";
import { emptied, showNotice } from "./screens/notice";
import type { Session } from "./session";
import { loadKind } from "./trials";
import { saveInterrupted } from "./trials/save-rating";
import { settleInterrupted } from "./views/ledger";

/** How often the end may lead back to what is missing, before the page says that something is wrong. */
const RETURNS = 3;
const RETURNED = "palpebra returns";

/** What is known when the link has answered, or an earlier visit answers for it. */
export interface Entry {
  root: HTMLElement;
  t: Translate;
  link_token: string;
  link: LinkState;
  language: string;
  keeping: KeptVisit;
  kept: Kept | null;
}

const loadRefusal = (): Promise<typeof import("./flow/refusal")> => loadModule(() => import("./flow/refusal"));
const loadEnd = (): Promise<typeof import("./flow/ended")> => loadModule(() => import("./flow/ended"));

export async function main(root: HTMLElement): Promise<void> {
  const spoken = preferred(SHIPPED, navigator.languages);
  await loadMessages(spoken);
  let t = translator(spoken);
  const fail = (error: unknown): void => showProblem(root, t, error);
  window.addEventListener("unhandledrejection", (event) => fail(event.reason));
  const link_token = location.pathname.split("/").filter(Boolean).at(-1) ?? "";
  const keeping = new KeptVisit(storageKey("palpebra visit", link_token, location.search), storageOf("localStorage"));
  try {
    const { link, kept } = await reach(root, t, link_token, keeping.read());
    setSurround(link.study.background);
    const language = preferred(link.study.languages, navigator.languages);
    await loadMessages(language);
    setLanguage(language);
    document.title = titleOf(link, language);
    t = translator(language);
    await visit({ root, t, link_token, link, language, keeping, kept });
  } catch (error) {
    if (error instanceof Refused) (await loadRefusal()).showRefusal(root, t, error.code, error.message);
    else fail(error);
  }
}

async function visit(entry: Entry): Promise<void> {
  const { root, t, link_token, link, language, keeping, kept } = entry;
  const identity = new Identity(link_token, link.kind, location.search);
  // A visit that this browser or this personal link has begun may go on though no new one may begin.
  const returns = kept !== null || identity.isKnown || link.resumable;
  if (link.status !== "open" && !returns) {
    (await loadRefusal()).showRefusal(root, t, link.status, "", wayBack(t, link));
    return;
  }
  const store: OutboxStore = await IndexedDbStore.open().catch(() => new MemoryStore());
  const device = await abilities(store.durable);
  const list = findings(device, link.gates);
  const turned = async (closed: GateFinding): Promise<void> =>
    (await loadRefusal()).turnedAway(entry, identity, returns, closed, device, () => begun(entry, identity, { language, has_code: false }));
  if (list[0]?.closed) return turned(list[0]);
  if (list.length > 0) await (await loadRefusal()).passGates(root, t, list);
  const lack = returns ? null : lackOfRoom(link.gates, measures(link.gates));
  if (lack && !(await (await loadModule(() => import("./flow/room-page"))).waitForRoom(root, t, link))) return turned(lack);
  const tab = await oneTab(root, t, link_token);
  if (tab === "left") return;
  if (tab === "first" && !(await goesOn(entry, identity))) {
    anotherPerson(keeping, identity);
    return;
  }
  const chosen = returns ? { language, has_code: false } : await startPage(root, link, language);
  const started = kept?.started ?? (await begun(entry, identity, chosen));
  await enter(entry, identity, store, started, list);
}

/**
 * On a computer that several people use, the visit begun here may be another person's: a tab that has not shown it
 * yet asks first. True where the visit is to go on.
 */
async function goesOn({ root, t, link, language }: Entry, identity: Identity): Promise<boolean> {
  if (link.kind !== "general" || identity.isNamed || !identity.isKnown || identity.isOfThisTab) return true;
  return new Promise((resolve) => {
    const go = { label: t("return_go_on"), press: (): void => resolve(true) };
    const other = { label: t("new_visit"), press: (): void => resolve(false) };
    showNotice(root, { title: titleOf(link, language), text: t("return_begun"), actions: [go, other] });
  });
}

/** Begin anew, as somebody whom this browser does not know. */
function anotherPerson(keeping: KeptVisit, identity: Identity): void {
  keeping.forget();
  identity.forget();
  location.reload();
}

/** The run of this visit. Only here does the browser become known: who reloads the start page has begun nothing. */
async function begun({ root, link_token }: Entry, identity: Identity, { language, has_code }: Beginning): Promise<RunStarted> {
  const t = translator(language);
  const start = {
    language,
    query: recruiterQuery(location.search),
    device: { user_agent: navigator.userAgent },
    evidence: true,
    view_tickets: true,
  };
  const claimed = (claim: Claim): Promise<RunStarted> => startRun(link_token, { ...start, client_id: identity.client_id(), ...claim });
  const kept = identity.code;
  const askForCode = async (why: MessageKey): Promise<RunStarted> =>
    (await loadModule(() => import("./flow/code-page"))).codePage(root, t, why, identity, claimed);
  if (has_code) return askForCode("code_enter");
  try {
    return await persistently(root, t, () => claimed(kept ? { resume_code: kept } : {}));
  } catch (error) {
    const why = asksForCode(error);
    if (!why) throw error;
    return askForCode(why);
  }
}

/** From a started run to its timeline: what an earlier page left is sent, or counted, first. */
async function enter(entry: Entry, identity: Identity, store: OutboxStore, started: RunStarted, warnings: GateFinding[]): Promise<void> {
  const { root, t, link, keeping, kept } = entry;
  const outbox = outboxOf(root, store, keeping);
  // Loaded before anything is sent where the kind is known: an answer that ends the run must find its listener.
  const known = kept && (await loadKind(kept.run.trial.kind));
  const unsent = await flush(outbox, started, kept ? 0 : undefined);
  const run = kept?.run ?? (await persistently(root, t, () => fetchRun(started.run_token)));
  if (!kept) keeping.begin({ link, started, run });
  const kind = known ?? (await loadKind(run.trial.kind));
  identity.keepTab();
  const checks = run.checks ? await loadKind("motion_check") : kind;
  await loadMessages(run.language);
  const player = await choosePlayer(run.display);
  const session = openSession({ root, link, run, kind, checks, player, outbox, unsent });
  setLanguage(run.language);
  setScales(run.display.right_to_left_scales);
  const over = (): Promise<void> => {
    keeping.forget();
    return persistently(root, session.t, () => fetchRun(started.run_token)).then(async (now) =>
      (await loadEnd()).ended(root, session.t, now, started, identity, wayBack(session.t, link)),
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
  for (const { reason } of warnings) session.events.add(reason === "gate_storage" ? "storage_blocked" : "unsupported", { reason });
  if (kept) session.events.add("offline", { loaded_without_server: true });
  if (run.resumable_until) serveOffline();
  // Asked for now, so that it is here when it is wanted, also without a connection.
  const last = loadModule(() => import("./screens/completion"));
  await play(session, started, store.durable, () => {
    keeping.begin({ link, started, run: session.run });
    if (session.run.resumable_until) serveOffline();
  });
  if (!session.completion) return;
  keeping.forget();
  const { nextPerson, showCompletion } = await last;
  showCompletion(session, emptied(root), session.completion, nextPerson(session.t, identity));
}

/** An outbox whose answers keep the visit up to date, and tell where the run ends or goes on elsewhere. */
function outboxOf(root: HTMLElement, store: OutboxStore, keeping: KeptVisit): Outbox {
  const tell = (what: "run-over" | "taken-over"): void => void root.dispatchEvent(new CustomEvent(what));
  return new Outbox(store, {
    onAccepted(item, body) {
      keeping.note(item, body);
      if (statusIn(body) === "screened_out") tell("run-over");
    },
    onRefused({ status, code }) {
      if (status === 401) tell("taken-over");
      else if (code === "run_closed") tell("run-over");
    },
  });
}

/** The run's status in the answer to a write, or in its receipt. */
function statusIn(body: unknown): RunState["status"] | undefined {
  const answer = body as { status?: RunState["status"]; receipt?: { status: RunState["status"] } } | null;
  return answer?.receipt?.status ?? answer?.status;
}

/** Whether this tab has the study as the first one, has taken it from another tab as it was asked to, or left it there. */
async function oneTab(root: HTMLElement, t: Translate, link_token: string): Promise<"first" | "taken" | "left"> {
  const taken = (): void => void root.dispatchEvent(new CustomEvent("tab-taken"));
  const reload = { label: t("reload"), press: () => location.reload() };
  root.addEventListener("tab-taken", () => showNotice(root, { title: t("taken_over_title"), text: t("taken_over") }));
  root.addEventListener("taken-over", () =>
    showNotice(root, { title: t("taken_over_title"), text: t("taken_over_device"), actions: [reload] }),
  );
  if ((await claimTab(`palpebra ${link_token}`, false, taken)) === "held") return "first";
  await new Promise<void>((resolve) => {
    showNotice(root, { title: t("second_tab_title"), text: t("second_tab"), actions: [{ label: t("second_tab_take"), press: resolve }] });
  });
  return (await claimTab(`palpebra ${link_token}`, true, taken)) === "held" ? "taken" : "left";
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
  const dialog = loadModule(() => import("./screens/stop-dialog"));
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

function showProblem(root: HTMLElement, t: Translate, error: unknown): void {
  console.error(error);
  // Where nothing can be counted, leading back might never end.
  const counted = storageOf("sessionStorage");
  const returns = Number(counted?.getItem(RETURNED) ?? 0);
  if (error instanceof AnswersMissing && counted && returns < RETURNS) {
    counted.setItem(RETURNED, String(returns + 1));
    return location.reload();
  }
  const reload = { label: t("reload"), press: () => location.reload() };
  showNotice(root, { title: t("problem_title"), text: t("problem", { detail: String(error) }), actions: [reload] });
}

const root = document.querySelector<HTMLElement>("#study");
if (root) {
  root.dataset["started"] = "yes";
  void main(root);
}
