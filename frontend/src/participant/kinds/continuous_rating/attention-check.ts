/** An instructed answer between trials: seven numbers without a clip. */
import type { TrialInfo } from "../../../api/schema";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../../trials/rating";
import { askAnswer, askAttention } from "../../trials/answers";
import { continuousBody, declaredContinuous } from "./answer";
import "../../trials/answers.css";

export async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ chosen: number }> {
  const { check_scale, pointer_delay_ms } = declaredContinuous(session);
  // Texts, as pressed keys are.
  const numbers = Array.from({ length: check_scale.maximum }, (_, index) => String(index + 1));
  const { answer, rt } = await askAttention(session, display, trial, (below, question, signal) =>
    askAnswer(below, {
      choices: numbers.map((name) => ({ name, number: Number(name), label: "" })),
      keyed: (key) => (numbers.includes(key) ? key : null),
      layout: "side_by_side",
      pointer_delay_ms,
      signal,
      question,
    }),
  );
  const chosen = Number(answer.name);
  await store(session, trial, chosen, rt);
  return { chosen };
}

export function store(session: Session, trial: TrialInfo, chosen: number, rt: number): Promise<void> {
  // A check has one play and no clip.
  return saveRating(session, trial, continuousBody(session, trial, 1, { chosen }, playbackRecord(null, [], session.screen.record()), rt));
}
