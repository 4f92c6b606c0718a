/** An instructed answer between pairs: the same buttons without clips. */
import type { TrialInfo } from "../../../api/schema";
import { OBJECT, plugin, STRING, type PluginClass, pressWhile } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { ratingBody } from "../rating";
import { saveRating } from "../save-rating";
import { askAttention } from "../shared/attention";
import { winnerOf, type Winner } from "./answer-keys";
import { askWinner } from "./answers";
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
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { winner: STRING }, // the answer given
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
  const { language, t } = session;
  const declared = declaredPairs(session);
  const { arrangement } = declared.presentation;
  const { answer, rt } = await askAttention(session, display, trial, (below, question, signal) =>
    askWinner(below, { trial: declared, arrangement, language, t, signal, question }),
  );
  await store(session, trial, answer.winner, rt);
  return { winner: answer.winner };
}

function store(session: Session, trial: TrialInfo, winner: Winner, rt: number): Promise<void> {
  const answer = { kind: "paired_comparison", winner, arrangement: null } as const;
  return saveRating(session, trial, ratingBody(session, trial, 1, answer, playbackRecord(null, [], session.screen.record()), { rt }));
}
