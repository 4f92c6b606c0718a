/** An instructed answer between pairs: the same buttons without clips. */
import type { TrialInfo } from "../../../api/schema";
import { h } from "../../../ui/element";
import { markdown } from "../../../ui/markdown";
import { focusHeading } from "../../../ui/page";
import { OBJECT, plugin, STRING, type PluginClass, pressWhile } from "../../jspsych";
import { absoluteNow } from "../../playback/protocol";
import { playbackRecord } from "../../playback/record";
import { screenSignal, stopButton } from "../../screens/support";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { winnerOf, type Winner } from "./answer-keys";
import { askWinner } from "./answers";
import { comparisonBody } from "./body";
import { declaredPairs } from "./declared";

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  winner: string;
}

export function pairCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "pair-check",
    parameters: { trial: { type: OBJECT, description: "the assigned trial, with its prompt" } },
    data: { winner: { type: STRING, description: "the answer given" } },
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const winner = winnerOf(/\*\*(\d)\*\*/.exec(trial.prompt ?? "")?.[1] ?? "1", true) ?? "left";
      await store(session, trial, winner, 0);
      return { winner };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { signal, done } = screenSignal(session);
  const { language, t } = session;
  const declared = declaredPairs(session);
  const below = h("div", { class: "below" });
  const section = h("section", { class: "trial attention" }, h("div", { class: "above" }), below);
  section.append(stopButton(session));
  display.replaceChildren(section);
  const title = h("h1", { class: "eyebrow" }, t("attention_title"));
  const question = h("div", { class: "question" }, title, ...markdown(trial.prompt ?? ""));
  const shown_at_ms = absoluteNow();
  const { arrangement } = declared.presentation;
  const answer = askWinner(below, { trial: declared, arrangement, language, t, signal, question });
  focusHeading(section);
  const { winner, answered_at_ms } = await answer;
  done();
  await store(session, trial, winner, Math.round((answered_at_ms - shown_at_ms) * 100) / 100);
  return { winner };
}

function store(session: Session, trial: TrialInfo, winner: Winner, rt: number): Promise<void> {
  const given = { winner, arrangement: null, rt, rt_from_first_frame: null, time_elapsed: session.clock.elapsed() };
  return saveRating(session, trial, comparisonBody(trial, 1, given, playbackRecord(null, [], session.screen.record())));
}
