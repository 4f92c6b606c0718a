/** The single-clip rating as the registry of trial kinds finds it. */
import type { TrialInfo } from "../../../api/schema";
import { INT, OBJECT, plugin, type PluginClass, pressWhile, trial } from "../../jspsych";
import { absoluteNow } from "../../playback/protocol";
import type { Session } from "../../session";
import { loadModule } from "../../../ui/load-module";
import type { TrialKind } from "../kind";
import { parametersOf } from "../shared/parameters";
import { declaredRating } from "./declared";
import { clipRating, unrated } from "./screen";
import { loadWidgets } from "./widget";

/** What it draws comes beside the first trial, which does not wait for it, and is here when a check is. */
function attentionCheck(session: Session): PluginClass<{ trial: TrialInfo }> {
  const loaded = loadModule(() => import("./attention-check"));
  return plugin<{ trial: TrialInfo }, { response: number }>({
    name: "attention-check",
    parameters: { trial: OBJECT }, // the assigned trial, with its prompt
    data: { response: INT }, // the answer given
    show: async (display, parameters) => (await loaded).check(session, display, parameters.trial),
    async simulate(parameters) {
      const { check_scale } = declaredRating(session);
      const response = Number(/\*\*(\d+)\*\*/.exec(parameters.trial.prompt ?? "")?.[1] ?? check_scale.minimum);
      const answers = { [check_scale.name]: { response } };
      const rated = { answers, at_ms: {}, answered_at_ms: absoluteNow(), changes: 0, comment: null };
      await (await loaded).store(session, parameters.trial, rated, 0);
      return { response };
    },
    act: (display) => pressWhile(display, ".attention", [".key", ".primary"]),
  });
}

export const kind: TrialKind = {
  node: (session, what) => {
    // Asked for now, so that no scale waits; what cannot be had is asked for again where it is shown.
    const { scales, reference } = declaredRating(session);
    void loadWidgets(scales).catch(() => {});
    const other = reference && loadModule(() => import("./degradation")).then(({ watchBothAndRate }) => watchBothAndRate);
    return trial(clipRating(session, other), parametersOf(session, what));
  },
  attention: (session, what) => trial(attentionCheck(session), { trial: () => what().trial }),
  unrated,
};
