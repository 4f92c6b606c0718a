/** The two answers of a threshold: asked, and as the server is sent them. */
import type { ShownThreshold, TrialInfo } from "../../../api/schema";
import type { Session, RatingBody } from "../../session";
import { pick } from "../../../i18n";
import { screenSignal } from "../../screens/support";
import { askAnswer, type Chosen } from "../../trials/answers";
import type { PlaybackRecord } from "../../playback/record";
import { ratingBody } from "../../trials/rating";
import { h, showPage } from "../../../ui/element";

// The declaration of a run whose trials belong to adaptive series.

export function declaredThreshold({ run }: Session): ShownThreshold {
  if (run.trial.kind !== "threshold") throw new Error(`expected a threshold, got ${run.trial.kind}`);
  return run.trial;
}

// The two answers of a threshold: yes and no, or the first and the second.

export type Response = ShownThreshold["answers"][0]["response"];

/** What jsPsych's own data hold of a trial. */
export interface ThresholdData {
  chosen: string | null;
  rt: number | null;
  again: boolean;
}

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

// What the server is sent of one trial of a series.

type Times = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame">>;

export function thresholdBody(
  session: Session,
  trial: TrialInfo,
  play: number,
  chosen: Response | null,
  playback: PlaybackRecord,
  times: Times = {},
): RatingBody {
  const answer = { kind: "threshold", chosen, known: trial.series?.known ?? 0 } as const;
  return ratingBody(session, trial, play, answer, playback, times);
}

// Waits until the server has chosen a trial's stimulus; without connection a few trials go on with what is known.

/** The answer before is usually acknowledged by now; a slow connection holds nobody up for longer. */
const CHOICE_WITHIN_MS = 1_500;

/** Earlier trials of the series that the choice of this one did not know. */
export function behind({ series }: TrialInfo): number {
  return series ? series.position - 1 - series.known : 0;
}

export async function awaitChoice(session: Session, display: HTMLElement, trial: TrialInfo): Promise<void> {
  const { outbox, t } = session;
  if (behind(trial) > 0 && outbox.state.failures === 0) await outbox.drained(CHOICE_WITHIN_MS);
  if (behind(trial) <= declaredThreshold(session).ahead) return;
  const remark = h("p", { role: "status" }, t("saving_offline"));
  showPage(display, { title: t("saving"), body: [remark] });
  // With every answer sent there is nothing more to know: failed clips never count before they are repeated.
  await outbox.drained();
}
