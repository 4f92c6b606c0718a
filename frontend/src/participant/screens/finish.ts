/** The end: the completion code appears only when the server has every answer. */
import type { Completion } from "../../api/schema";
import { call, Refused } from "../request";
import { h } from "../../ui/element";
import { markdown } from "../../ui/markdown";
import { button, showPage } from "../../ui/page";
import { isNoAnswer } from "../flow/link";
import { backoff } from "../outbox/backoff";
import { STRING, plugin, type PluginClass } from "../jspsych";
import { leaveFullScreen } from "../screen/full-screen";
import type { Session } from "../session";
import { trouble } from "./support";

interface Parameters {
  token: string;
}
interface Data {
  completion_code: string;
}

/** The server still lacks ratings or a form: the run must be taken up again, and leads to them. */
export class AnswersMissing extends Error {
  override name = "AnswersMissing";
}
const MISSING = ["ratings_missing", "forms_missing"];

export function finish(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "finish",
    parameters: { token: { type: STRING, description: "the run's token" } },
    data: { completion_code: { type: STRING, description: "as given by the server" } },
    show: (display, { token }) => complete(session, display, token),
    async simulate({ token }) {
      await session.outbox.drained();
      const done = await completed(token);
      session.completion = done;
      return { completion_code: done.completion_code ?? "" };
    },
    act: () => {},
  });
}

async function complete(session: Session, display: HTMLElement, token: string): Promise<Data> {
  const { t } = session;
  const count = h("p", { class: "count", role: "status" });
  showPage(display, { title: t("finishing_title"), body: [count] });
  const tell = setInterval(() => {
    const { pending, failures } = session.outbox.state;
    count.textContent = (pending ? t("finishing_wait", { count: pending }) : "") + (failures > 1 ? ` ${trouble(session)}` : "");
  }, 500);
  await session.outbox.drained();
  const done = await completed(token);
  clearInterval(tell);
  await leaveFullScreen();
  session.completion = done;
  return { completion_code: done.completion_code ?? "" };
}

/** Ask until the server answers. Safe to repeat. */
export async function completed(token: string): Promise<Completion> {
  for (let failures = 1; ; failures += 1) {
    try {
      return await call<Completion>("POST", "/api/run/complete", { token });
    } catch (error) {
      if (error instanceof Refused && MISSING.includes(error.code)) throw new AnswersMissing(error.message);
      if (!isNoAnswer(error)) throw error;
      await new Promise((resolve) => setTimeout(resolve, backoff(failures)));
    }
  }
}

/** The last page, also of who is screened out. It lies outside the timeline, which clears what its screens have shown. */
export function showCompletion(
  session: Pick<Session, "t" | "run">,
  display: HTMLElement,
  done: Completion,
  extra: HTMLElement[] = [],
  why = "",
): void {
  const { t, run } = session;
  const out = done.status === "screened_out";
  const code =
    done.completion_code &&
    h(
      "div",
      { class: "code" },
      h("p", { class: "help" }, t(out ? "out_code" : "done_code")),
      codeRow(t("done_copy"), t("done_copied"), done.completion_code),
    );
  const back = done.redirect_url && h("a", { class: "button primary", href: done.redirect_url, rel: "noreferrer" }, t("done_return"));
  const text = out ? run.texts.screened_out || `# ${t("screened_out_title")}\n\n${t("screened_out")}` : run.texts.debrief;
  const prose = h("div", { class: "prose" }, ...markdown(text));
  showPage(display, {
    body: [
      (done.reason || why) && h("p", { role: "alert" }, done.reason || why),
      prose,
      code,
      h("p", { class: "status", role: "status" }, t(out ? "close" : "done_close")),
    ],
    actions: [back, ...extra],
  });
}

function codeRow(copy: string, copied: string, code: string): HTMLElement {
  const row = h("p", { class: "row" }, h("output", {}, code));
  // Pages without a secure connection have no clipboard.
  if (!("clipboard" in navigator)) return row;
  const write = async (): Promise<void> => {
    await navigator.clipboard.writeText(code);
    press.textContent = copied;
  };
  const press = button(copy, () => void write().catch(() => {}), "quiet");
  row.append(press);
  return row;
}
