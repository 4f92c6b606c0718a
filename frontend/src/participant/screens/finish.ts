/** The end: the completion code appears only when the server has every answer. */
import type { Completion } from "../../api/schema";
import { call, Refused } from "../request";
import { h, showPage } from "../../ui/element";
import { isNoAnswer } from "../flow/link";
import { backoff } from "../outbox/outbox";
import { STRING, plugin, type PluginClass } from "../jspsych";
import { leaveFullScreen } from "../screen/window";
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
    parameters: { token: STRING }, // the run's token
    data: { completion_code: STRING }, // as given by the server
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
  const timer = setInterval(() => {
    const { pending, failures } = session.outbox.state;
    count.textContent = (pending ? t("finishing_wait", { count: pending }) : t("saving")) + (failures > 1 ? ` ${trouble(session)}` : "");
  }, 500);
  await session.outbox.drained();
  const done = await completed(token);
  clearInterval(timer);
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
