/** The rest between blocks; what draws it is loaded beside the first trials. */
import { INT, plugin, type PluginClass, pressWhile } from "../jspsych";
import { loadModule } from "../../ui/load-module";
import type { Session } from "../session";

export interface Parameters {
  block: number;
  blocks: number;
  seconds_min: number;
}
export interface Data {
  rested_ms: number;
}

/** Fetched with the first clips, so that it is here when its turn comes, also without a connection. */
export const loadRest = (): Promise<typeof import("./rest")> => loadModule(() => import("./rest"));

export function blockBreak(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "block-break",
    parameters: {
      block: INT, // the block that comes next
      blocks: INT, // how many blocks there are
      seconds_min: INT, // shortest rest in seconds
    },
    data: { rested_ms: INT }, // length of the rest in ms
    show: async (display, parameters) => (await loadRest()).rest(session, display, parameters),
    simulate: () => ({ rested_ms: 0 }),
    act: (display) => pressWhile(display, ".break", [".primary"]),
  });
}
