/** The place of a pair on the screen; where it does not fit, the participant is asked for a larger window. */
import type { TrialInfo } from "../../../api/schema";
import { clipHeight, clipWidth } from "../../screen/size";
import { askRoom } from "../../screens/screen-setup";
import type { Session } from "../../session";
import { stopButton } from "../../screens/support";
import { stage, type Stage } from "../shared/stage";
import { declaredPairs } from "./declared";
import { layoutOf, roomNeeded, type Layout, type Size } from "./layout";

export async function stageFor(session: Session, display: HTMLElement, trial: TrialInfo): Promise<{ place: Stage; layout: Layout }> {
  const { presentation } = declaredPairs(session);
  const { px_per_mm } = session.screen;
  const shown = clipSize(session, trial);
  const pixels = { width: trial.width_px ?? shown.width, height: trial.height_px ?? shown.height };
  for (;;) {
    const room = { width: window.innerWidth, height: window.innerHeight };
    const layout = layoutOf(presentation, pixels, shown, room, px_per_mm);
    if (layout) {
      const place = stage(session.player.element, layout.shown.width, layout.shown.height, session.t("pair_name"));
      place.element.append(stopButton(session));
      display.replaceChildren(place.element);
      return { place, layout };
    }
    await askRoom(session, display, "", roomNeeded(presentation, shown, px_per_mm));
  }
}

/** One clip at actual size; only where calibration is optional can it be too wide: it is then as wide as the window. */
function clipSize(session: Session, trial: TrialInfo): Size {
  const wanted = clipWidth(trial, session.run.display.inter_ocular_mm, session.screen.px_per_mm);
  const width = Math.min(wanted, window.innerWidth);
  return { width, height: clipHeight(trial, width) };
}
