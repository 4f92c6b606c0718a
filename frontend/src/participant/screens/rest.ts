/** The rest between blocks: it shows the progress, and lasts at least as long as declared. */
import { h, button, showPage, progressBar } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import { counted, done, type Session } from "../session";
import { choose, codeNote, stopButton } from "./support";

export interface RestParameters {
  block: number;
  blocks: number;
  seconds_min: number;
}
export interface RestData {
  rested_ms: number;
}

export async function rest(session: Session, display: HTMLElement, { block, blocks, seconds_min }: RestParameters): Promise<RestData> {
  const { t, run } = session;
  const started = performance.now();
  const total = counted(run).length;
  const finished = done(run).length;
  const progress = t("break_progress", { done: finished, total });
  const bar = progressBar(progress);
  bar.set(finished, total);
  const count = h("p", { class: "count" }, progress);
  const wait = h("p", { class: "status", role: "status" });
  const footer = h("footer", { class: "actions" });
  const text = markdown(run.texts.block_break || `# ${t("break_part", { block, blocks })}`);
  const section = showPage(display, {
    eyebrow: t("break_part", { block, blocks }),
    body: [h("div", { class: "prose" }, ...text), bar.element, count, wait, footer, h("p", { class: "help" }, codeNote(session))],
  });
  section.classList.add("break");
  section.append(stopButton(session));
  await countDown(session, wait, footer, seconds_min);
  wait.textContent = t("break_ready");
  await choose(session, footer, [{ label: t("break_go_on"), value: true }], "never");
  return { rested_ms: Math.round(performance.now() - started) };
}

async function countDown(session: Session, wait: HTMLElement, footer: HTMLElement, seconds: number): Promise<void> {
  const locked = button(session.t("break_go_on"), () => {});
  locked.disabled = true;
  footer.append(locked);
  for (let left = seconds; left > 0; left -= 1) {
    // Spoken at the start and the end only: a screen reader need not count along.
    wait.setAttribute("aria-live", left === seconds ? "polite" : "off");
    wait.textContent = session.t("break_wait", { seconds: left });
    await new Promise((resolve) => setTimeout(resolve, 1_000));
  }
  wait.setAttribute("aria-live", "polite");
  locked.remove();
}
