/** The continuous rating as the registry of trial kinds finds it. */
import type { TrialInfo } from "../../../api/schema";
import { INT, OBJECT, plugin, type PluginClass, pressWhile, trial } from "../../jspsych";
import type { Session } from "../../session";
import { loadModule } from "../../../ui/load-module";
import type { TrialKind } from "../kind";
import { parametersOf } from "../shared/parameters";
import { continuousRating, unrated } from "./screen";

/** What it draws comes beside the first trial, which does not wait for it, and is here when a check is. */
function continuousCheck(session: Session): PluginClass<{ trial: TrialInfo }> {
  const loaded = loadModule(() => import("./attention-check"));
  return plugin<{ trial: TrialInfo }, { chosen: number }>({
    name: "continuous-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { chosen: INT }, // the answer given
    show: async (display, parameters) => (await loaded).check(session, display, parameters.trial),
    async simulate(parameters) {
      const chosen = Number(/\*\*(\d+)\*\*/.exec(parameters.trial.prompt ?? "")?.[1] ?? "1");
      await (await loaded).store(session, parameters.trial, chosen, 0);
      return { chosen };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

export const kind: TrialKind = {
  node: (session, what) => trial(continuousRating(session), parametersOf(session, what)),
  attention: (session, what) => trial(continuousCheck(session), { trial: () => what().trial }),
  unrated,
};
