/** Where the participant's page begins: link, gates, one tab, the run. */
import type { RunStarted } from "../api/schema";
import { call, Refused, withinTime } from "./request";
import { loadMessages, type MessageKey, preferred, SHIPPED, translator, type Translate } from "../i18n";
import { setLanguage, setSurround, type Beginning, startPage, titleOf } from "./flow/start-page";
import { enter, RETURNED } from "./flow/enter";
import { abilities, findings, type GateFinding, lackOfRoom, measures } from "./flow/gates";
import { Identity, recruiterQuery, storageKey, storageOf } from "./flow/identity";
import { KeptVisit } from "./flow/kept-visit";
import { type Entry, persistently, reach, wayBack, asksForCode, type Claim } from "./flow/link";
import { IndexedDbStore, MemoryStore, type OutboxStore } from "./outbox/store";
import { loadModule } from "../ui/load-module";
import { claimTab } from "./screen/window";
import { AnswersMissing } from "./screens/finish";
import { showNotice } from "./screens/support";
import "./style/index.css";

/** How often the end may lead back to what is missing, before the page says that something is wrong. */
const RETURNS = 3;
/** A database that takes longer is blocked: answers then go to the server one by one. */
const OPEN_LIMIT_MS = 5_000;

const loadRefusal = (): Promise<typeof import("./flow/refusal")> => loadModule(() => import("./flow/refusal"));

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
  const store: OutboxStore = await withinTime(() => IndexedDbStore.open(), OPEN_LIMIT_MS).catch(() => new MemoryStore());
  const device = await abilities(store.durable);
  const list = findings(device, link.gates);
  const turned = async (closed: GateFinding): Promise<void> =>
    (await loadRefusal()).turnedAway(entry, identity, returns, closed, device, () => begun(entry, identity, { language, has_code: false }));
  if (list[0]?.closed) return turned(list[0]);
  if (list.length > 0) await (await loadRefusal()).passGates(root, t, list);
  const lack = returns ? null : lackOfRoom(link.gates, measures(link.gates));
  if (lack && !(await (await loadRefusal()).waitForRoom(root, t, link))) return turned(lack);
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

/** Start over, as somebody whom this browser does not know. */
function anotherPerson(keeping: KeptVisit, identity: Identity): void {
  keeping.forget();
  identity.forget();
  location.reload();
}

/** The run of this visit. Only here does the browser become known: reloading the start page begins nothing. */
async function begun({ root, link_token }: Entry, identity: Identity, { language, has_code }: Beginning): Promise<RunStarted> {
  const t = translator(language);
  const start = {
    language,
    query: recruiterQuery(location.search),
    device: { user_agent: navigator.userAgent },
    evidence: true,
    view_tickets: true,
  };
  const claimed = (claim: Claim): Promise<RunStarted> =>
    call("POST", `/api/links/${encodeURIComponent(link_token)}/runs`, { body: { ...start, client_id: identity.client_id(), ...claim } });
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

function showProblem(root: HTMLElement, t: Translate, error: unknown): void {
  console.error(error);
  // Where nothing can be counted, leading back might never end.
  const counted = storageOf("sessionStorage");
  const returns = Number(counted?.getItem(RETURNED) ?? 0);
  if (error instanceof AnswersMissing && counted && returns < RETURNS) {
    counted.setItem(RETURNED, String(returns + 1));
    if (counted.getItem(RETURNED) === String(returns + 1)) return location.reload();
  }
  const reload = { label: t("reload"), press: () => location.reload() };
  showNotice(root, { title: t("problem_title"), text: t("problem", { detail: String(error) }), actions: [reload] });
}

const root = document.querySelector<HTMLElement>("#study");
if (root) {
  root.dataset["started"] = "yes";
  void main(root);
}
