/** The registry of trial kinds: every folder here with a screen.ts, found by name and loaded when a run needs it. */
import type { TrialInfo } from "../../api/schema";
import type { Node } from "../jspsych";
import { loadModule } from "../../ui/load-module";
import type { Session, Showable, TrialKind } from "../session";

const folders = import.meta.glob<TrialKind>("./*/screen.ts", { import: "kind" });

/** The code of the kind that a study declares. Throws where this page has none of that name. */
export function loadKind(name: string): Promise<TrialKind> {
  const load = folders[`./${name}/screen.ts`];
  const names = Object.keys(folders).map((path) => path.split("/")[1]);
  return load
    ? loadModule(load)
    : Promise.reject(new Error(`expected one of the kinds of trial ${names.join(", ")}, got ${name}; load the page again`));
}

/** The screens of motion checks, which a study of any kind may declare. */
export function loadChecks(): Promise<TrialKind> {
  return loadKind("motion_check");
}

/** The timeline node that shows what `what` names when its turn comes. */
export function trialNode(session: Session, kind: TrialInfo["kind"], what: () => Showable): Node {
  if (kind === "check") return session.checks.node(session, what);
  return kind === "attention" ? session.kind.attention(session, what) : session.kind.node(session, what);
}
