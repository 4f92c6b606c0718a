/** The page that asks for a larger window or a smaller zoom, before anything has begun; loaded where it is needed. */
import type { LinkState } from "../../api/schema";
import type { Translate } from "../../i18n";
import { showNotice } from "../screens/notice";
import { type GateFinding, lackOfRoom, measures } from "./gates";
import { wayBack } from "./link";

/**
 * Wait until the window has room for the clips, before anything has begun. True as soon as it has; false where the
 * study screens devices and the participant has no other one.
 */
export function waitForRoom(root: HTMLElement, t: Translate, link: LinkState): Promise<boolean> {
  return new Promise((resolve) => {
    const look = (): void => {
      const lack = lackOfRoom(link.gates, measures(link.gates));
      if (lack) return draw(lack);
      window.removeEventListener("resize", look);
      resolve(true);
    };
    const draw = ({ reason, values }: GateFinding): void => {
      const actions = [{ label: t("try_again"), press: look }];
      if (link.screens_devices) actions.push({ label: t("no_device"), press: () => resolve(false) });
      showNotice(root, { title: t("window_small_title"), text: t(reason, values), actions, back: wayBack(t, link) });
    };
    window.addEventListener("resize", look);
    look();
  });
}
