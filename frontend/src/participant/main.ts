/** Where the participant's page begins: link, gates, one tab, the run, its timeline. */
import "./style/index.css";
import type { LinkDocument, RunDocument, StartedRun } from "../api/participant";
import { Refused } from "../api/request";
import { preferred, translator, type Translate } from "../i18n";
import { setLanguage, setSurround } from "./flow/appearance";
import { Identity, recruiterQuery } from "./flow/identity";
import { fetchLink, fetchRun, passGates, persistently, showRefusal, startRun } from "./flow/link";
import { describeDevice, flush, openSession } from "./flow/open-session";
import { startPage } from "./flow/start-page";
import { timeline } from "./flow/timeline";
import { watch } from "./flow/watchers";
import { runTimeline, type SimulationMode } from "./jspsych";
import { IndexedDbStore } from "./outbox/indexed-db";
import { Outbox } from "./outbox/outbox";
import { MemoryStore, type OutboxStore } from "./outbox/store";
import { claimTab } from "./screen/one-tab";
import { completed, RatingsMissing, showCompletion } from "./screens/finish";
import { emptied, showNotice } from "./screens/notice";
import { openStopDialog } from "./screens/stop-dialog";
import type { Session } from "./session";
import { button } from "../ui/page";

const RETURNS = 3;

export async function main(root: HTMLElement): Promise<void> {
  let t = translator(preferred(["en", "de"], navigator.languages));
  const fail = (error: unknown): void => showProblem(root, t, error);
  window.addEventListener("unhandledrejection", (event) => fail(event.reason));
  const link_token = location.pathname.split("/").filter(Boolean).at(-1) ?? "";
  try {
    const link = await persistently(root, t, () => fetchLink(link_token));
    setSurround(link.study.background);
    const language = preferred(link.study.languages, navigator.languages);
    setLanguage(language);
    document.title = link.study.title;
    t = translator(language);
    await visit(root, t, link_token, link, language);
  } catch (error) {
    if (error instanceof Refused) showRefusal(root, t, error.code, error.message);
    else fail(error);
  }
}

async function visit(root: HTMLElement, t: Translate, link_token: string, link: LinkDocument, language: string): Promise<void> {
  const identity = new Identity(link_token, link.kind, location.search);
  // A visit that this browser or this personal link has begun may go on though no new one may begin.
  const returns = identity.isKnown || link.resumable;
  if (link.status !== "open" && !returns) return showRefusal(root, t, link.status);
  const store: OutboxStore = await IndexedDbStore.open().catch(() => new MemoryStore());
  const found = await passGates(root, t, link_token, link, store.durable);
  if (!found) return;
  if (!(await oneTab(root, t, link_token))) return;
  const chosen = returns ? language : await startPage(root, link, language);
  const start = { language: chosen, client_id: identity.client_id(), query: recruiterQuery(location.search), device: { user_agent: navigator.userAgent } };
  const started = await persistently(root, t, () => startRun(link_token, start));
  const outbox = new Outbox(store, { onUnauthorized: () => root.dispatchEvent(new CustomEvent("taken-over")) });
  const unsent = await flush(outbox, started);
  const run = await persistently(root, t, () => fetchRun(started.run_token));
  setLanguage(run.language);
  const t_run = translator(run.language);
  if (run.status !== "active") return ended(root, t_run, run, started, identity);
  const session = openSession(root, link, run, outbox, unsent);
  for (const { reason } of found) session.events.add(reason === "gate_storage" ? "storage_blocked" : "unsupported", { reason });
  await play(session, started, store.durable);
}

/** False where another tab has the study and the participant leaves it there. */
async function oneTab(root: HTMLElement, t: Translate, link_token: string): Promise<boolean> {
  const taken = (): void => void root.dispatchEvent(new CustomEvent("tab-taken"));
  const reload = { label: t("reload"), press: () => location.reload() };
  root.addEventListener("tab-taken", () => showNotice(root, { title: t("taken_over_title"), text: t("taken_over") }));
  root.addEventListener("taken-over", () => showNotice(root, { title: t("taken_over_title"), text: t("taken_over_device"), actions: [reload] }));
  if ((await claimTab(`palpebra ${link_token}`, false, taken)) === "held") return true;
  await new Promise<void>((resolve) => {
    showNotice(root, { title: t("second_tab_title"), text: t("second_tab"), actions: [{ label: t("second_tab_take"), press: resolve }] });
  });
  return (await claimTab(`palpebra ${link_token}`, true, taken)) === "held";
}

async function play(session: Session, started: StartedRun, durable: boolean): Promise<void> {
  const { root, run, outbox, over } = session;
  const end = (): void => {
    over.abort();
    outbox.stop();
  };
  root.addEventListener("tab-taken", () => (session.events.add("second_tab"), end()));
  root.addEventListener("taken-over", end);
  root.addEventListener("stop", () => openStopDialog(session));
  watch(session);
  void describeDevice(session, durable);
  root.replaceChildren();
  await runTimeline(root, timeline(session, started.run_token), simulation(run));
  if (session.completion) showCompletion(session, emptied(root), session.completion);
}

/** Only previews and synthetic runs may answer themselves. */
function simulation(run: RunDocument): SimulationMode | null {
  const wanted = new URLSearchParams(location.search).get("simulate");
  return (run.preview || run.synthetic) && (wanted === "visual" || wanted === "data-only") ? wanted : null;
}

async function ended(root: HTMLElement, t: Translate, run: RunDocument, started: StartedRun, identity: Identity): Promise<void> {
  if (run.status === "withdrawn") return void showNotice(root, { title: t("withdrawn_title"), text: t("withdrawn") });
  if (run.status === "screened_out") return void showNotice(root, { title: t("screened_out_title"), text: t("screened_out") });
  const done = await persistently(root, t, () => completed(started.run_token));
  // On a laboratory's computer the next person comes by the same link.
  const next = identity.isNamed ? [] : [button(t("new_visit"), () => (identity.forget(), location.reload()), "plain")];
  showCompletion({ t, run }, emptied(root), done, next);
}

function showProblem(root: HTMLElement, t: Translate, error: unknown): void {
  console.error(error);
  const key = "palpebra returns";
  const returns = Number(sessionStorage.getItem(key) ?? 0);
  if (error instanceof RatingsMissing && returns < RETURNS) {
    sessionStorage.setItem(key, String(returns + 1));
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
