/** An instructed rating between trials: the same scale without a clip. Whether it was followed, the server knows. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { focusHeading } from "../../../ui/page";
import { INT, OBJECT, plugin, type PluginClass } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import { absoluteNow } from "../../playback/protocol";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { declaredRating } from "./declared";
import { askScale, type Rated } from "./scale";
import { saveRating } from "../save-rating";

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  response: number;
}

export function attentionCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "attention-check",
    parameters: { trial: { type: OBJECT, description: "the assigned trial, with its prompt" } },
    data: { response: { type: INT, description: "the answer given" } },
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const response = Number(/\*\*(\d+)\*\*/.exec(trial.prompt ?? "")?.[1] ?? declaredRating(session).scale.minimum);
      await store(session, trial, absoluteNow(), { response, answered_at_ms: absoluteNow(), changes: 0, comment: null });
      return { response };
    },
    act: (display) => display.querySelector<HTMLButtonElement>(".key")?.click(),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { signal, done } = screenSignal(session);
  const below = h("div", { class: "below" });
  const section = h("section", { class: "trial attention" }, h("div", { class: "above" }), below);
  display.replaceChildren(section);
  const question = h(
    "div",
    { class: "question" },
    h("h1", { class: "eyebrow" }, session.t("attention_title")),
    ...markdown(trial.prompt ?? ""),
  );
  const shown_at_ms = absoluteNow();
  const rating = { ...declaredRating(session), comment: false };
  const answer = askScale(below, { trial: rating, language: session.language, t: session.t, signal, question });
  focusHeading(section);
  const rated = await answer;
  done();
  await store(session, trial, shown_at_ms, rated);
  return { response: rated.response };
}

function store(session: Session, trial: TrialInfo, shown_at_ms: number, rated: Rated): Promise<void> {
  return saveRating(session, trial, {
    trial_index: trial.trial_index,
    play: 1,
    answer: { kind: "clip_rating", answers: { rating: { response: rated.response } } },
    rt: Math.round((rated.answered_at_ms - shown_at_ms) * 100) / 100,
    rt_from_first_frame: null,
    time_elapsed: session.clock.elapsed(),
    changes: rated.changes,
    comment: null,
    answered_at_client: new Date().toISOString(),
    playback: playbackRecord(null, [], session.screen.record()),
  });
}
