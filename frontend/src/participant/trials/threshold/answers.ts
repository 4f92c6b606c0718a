/** The two answers of a threshold: yes and no, or the first and the second. */
import type { ShownThreshold } from "../../../api/schema";
import { pick } from "../../../i18n";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { askAnswer, type Chosen } from "../shared/ask-answer";
import { declaredThreshold } from "./declared";

export type Response = ShownThreshold["answers"][0]["response"];

/** Arrows point at a button; 1 and 2 name it by its order; Y and N are for those who think in words. */
export function responseOf(key: string, [one, other]: readonly [Response, Response]): Response | null {
  if (["1", "ArrowLeft", "ArrowUp"].includes(key)) return one;
  if (["2", "ArrowRight", "ArrowDown"].includes(key)) return other;
  if (one !== "yes") return null;
  return key === "y" ? one : key === "n" ? other : null;
}

export async function askResponse(session: Session, container: HTMLElement, question: HTMLElement): Promise<Chosen<Response>> {
  const { answers, pointer_delay_ms } = declaredThreshold(session);
  const { signal, done } = screenSignal(session);
  const [one, other] = answers;
  const chosen = await askAnswer<Response>(container, {
    choices: answers.map(({ response, label }, index) => ({ name: response, number: index + 1, label: pick(label, session.language) })),
    keyed: (key) => responseOf(key, [one.response, other.response]),
    layout: "one_after_the_other",
    pointer_delay_ms,
    signal,
    question,
  });
  done();
  return chosen;
}
