/** The place of a pair on the screen; where it does not fit, the participant is asked for a larger window. */
import type { TrialInfo } from "../../../api/schema";
import { askRoom } from "../../screens/screen-setup";
import type { Session } from "../../session";
import { clipSize, inWindow, showStage, type Stage } from "../shared/stage";
import { declaredPairs } from "./declared";
import { layoutOf, roomNeeded, type Layout } from "./layout";

export async function stageFor(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ stage: Stage; layout: Layout }> {
  const { presentation } = declaredPairs(session);
  const { px_per_mm } = session.screen;
  const shown = clipSize(session, trial);
  const pixels = { width: trial.width_px ?? shown.width, height: trial.height_px ?? shown.height };
  for (;;) {
    const room = { width: window.innerWidth, height: window.innerHeight };
    const layout = layoutOf(presentation, pixels, shown, room, px_per_mm);
    if (layout) {
      return { stage: showStage(session, display, () => inWindow(session, layout.shown), "pair_name"), layout };
    }
    await askRoom(session, display, "", roomNeeded(presentation, shown, px_per_mm));
  }
}
