/** Motion checks of a study of any kind; loaded with the visit of a study that declares them. */
import type { TrialInfo } from "../../../api/schema";
import { INT, OBJECT, plugin, trial, type PluginClass } from "../../jspsych";
import type { Session } from "../../session";
import type { TrialKind } from "../kind";
import { unrated } from "./body";
import { actCheck, type CheckData, showCheck, simulateCheck } from "./screen";
import "../shared/answers.css";
import "./check.css";

interface Parameters {
  trial: TrialInfo;
}

function motionCheck(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, CheckData>({
    name: "motion-check",
    parameters: { trial: OBJECT }, // the assigned check
    data: { check: INT }, // number of the choice; null where there is none
    show: (display, parameters) => showCheck(session, display, parameters.trial),
    simulate: (parameters) => simulateCheck(session, parameters.trial),
    act: actCheck,
  });
}

const node: TrialKind["node"] = (session, what) => trial(motionCheck(session), { trial: () => what().trial });

export const kind: TrialKind = { node, attention: node, unrated };
