/** An instructed answer between trials: the same buttons without clips. */
import type { TrialInfo } from "../../../api/schema";
import { OBJECT, plugin, STRING, type PluginClass, pressWhile } from "../../jspsych";
import { playbackRecord } from "../../playback/record";
import type { Session } from "../../session";
import { saveRating } from "../save-rating";
import { askAttention } from "../shared/attention";
import { askResponse, type Response } from "./answers";
import { thresholdBody } from "./body";
import { declaredThreshold } from "./declared";

interface Parameters {
  trial: TrialInfo;
}
interface Data {
  chosen: string;
}

export function thresholdCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "threshold-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { chosen: STRING }, // the answer given
    show: (display, { trial }) => check(session, display, trial),
    async simulate({ trial }) {
      const asked = Number(/\*\*(\d)\*\*/.exec(trial.prompt ?? "")?.[1] ?? "1");
      const chosen = declaredThreshold(session).answers[asked === 2 ? 1 : 0].response;
      await store(session, trial, chosen, 0);
      return { chosen };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

async function check(session: Session, display: HTMLElement, trial: TrialInfo): Promise<Data> {
  const { answer, rt } = await askAttention(session, display, trial, (below, question) => askResponse(session, below, question));
  await store(session, trial, answer.name, rt);
  return { chosen: answer.name };
}

function store(session: Session, trial: TrialInfo, chosen: Response, rt: number): Promise<void> {
  return saveRating(session, trial, thresholdBody(session, trial, 1, chosen, playbackRecord(null, [], session.screen.record()), { rt }));
}
