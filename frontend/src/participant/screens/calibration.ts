/** The size of the screen, measured: what does it is loaded where a study asks for it. */
import { plugin, BOOL, FLOAT, STRING, type PluginClass } from "../jspsych";
import type { CalibrationState } from "../../api/schema";
import { loadModule } from "../../ui/load-module";
import type { Session } from "../session";

interface Parameters {
  eyebrow: string;
  occasion: CalibrationState["occasion"];
}
interface Data {
  px_per_mm: number | null;
  method: string;
  checked: boolean;
}

/** Fetched with the page's first clips, so that it is here when its turn comes, also without a connection. */
export const loadCalibration = (): Promise<typeof import("../calibration/measure")> => loadModule(() => import("../calibration/measure"));

export function calibration(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "calibration",
    parameters: {
      eyebrow: STRING, // small line above the title
      occasion: STRING, // first, screen_changed or recheck
    },
    data: {
      px_per_mm: FLOAT, // CSS pixels per millimetre, null where skipped
      method: STRING, // card or ruler
      checked: BOOL, // true where an earlier size was looked at once more and holds
    },
    show: async (display, { eyebrow, occasion }) => (await loadCalibration()).calibrate(session, display, eyebrow, occasion),
    simulate: async () => (await loadCalibration()).simulate(session),
    act: async (display) => (await loadCalibration()).act(display),
  });
}
