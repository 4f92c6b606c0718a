/** Full screen and a window that is large enough: before the size is measured, and whenever it is lost. */
import { h, showPage, statusLine } from "../../ui/element";
import { plugin, BOOL, STRING, type PluginClass, FLOAT } from "../jspsych";
import { canFullScreen, enterFullScreen, isFullScreen } from "../screen/window";
import type { Session } from "../session";
import { choose, noDevice, screenOut, stopButton } from "./support";
import type { CalibrationState } from "../../api/schema";
import { loadModule } from "../../ui/load-module";

interface Parameters {
  eyebrow: string;
  again: boolean;
}
interface Data {
  full_screen: boolean;
}

/** True where the page must ask: full screen is wanted and lost, or the window is too small. */
export function needsScreenSetup(session: Session): boolean {
  return lacksFullScreen(session) || lacksRoom(session);
}

export function screenSetup(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "screen-setup",
    parameters: {
      eyebrow: STRING, // small line above the title
      again: BOOL, // true where full screen was left during the trials
    },
    data: { full_screen: BOOL }, // whether the page fills the screen
    async show(display, { eyebrow, again }) {
      if (lacksFullScreen(session)) await askFullScreen(session, display, eyebrow, again);
      const { minimum_width_px: width, minimum_height_px: height } = session.run.display;
      while (lacksRoom(session)) await askRoom(session, display, eyebrow, { width, height });
      return { full_screen: isFullScreen() };
    },
    simulate: () => ({ full_screen: false }),
    act: (display) => display.querySelector<HTMLButtonElement>(".primary")?.click(),
  });
}

const denied = new WeakSet<Session>();
function lacksFullScreen(session: Session): boolean {
  return session.run.display.full_screen && !isFullScreen() && canFullScreen() && !denied.has(session);
}

function lacksRoom({ run: { display } }: Session): boolean {
  return window.innerWidth < display.minimum_width_px || window.innerHeight < display.minimum_height_px;
}

async function askFullScreen(session: Session, display: HTMLElement, eyebrow: string, again: boolean): Promise<void> {
  const { t } = session;
  const footer = h("footer", { class: "actions" });
  const title = t(again ? "full_screen_again_title" : "screen_title");
  const text = h("p", {}, t(again ? "full_screen_again" : "full_screen_text"));
  showPage(display, { title, eyebrow, body: [text, footer] }).append(stopButton(session));
  await choose(session, footer, [{ label: t("full_screen_enter"), value: true }]);
  if (await enterFullScreen()) return settled();
  denied.add(session);
  session.events.add("fullscreen_left", { denied: true });
  text.textContent = t("full_screen_denied");
  footer.replaceChildren();
  await choose(session, footer, [{ label: t("continue"), value: true }]);
}

/** The window's size is right only some frames after full screen was granted. */
function settled(): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, 300));
}

/** Ask for a larger window; resolves at the next try, however large it is then. */
export async function askRoom(
  session: Session,
  display: HTMLElement,
  eyebrow: string,
  needed: { width: number; height: number },
): Promise<void> {
  const { t } = session;
  const values = {
    width: Math.ceil(needed.width),
    height: Math.ceil(needed.height),
    have_width: window.innerWidth,
    have_height: window.innerHeight,
  };
  const status = statusLine();
  const footer = h("footer", { class: "actions" });
  showPage(display, { title: t("window_small_title"), eyebrow, body: [h("p", {}, t("window_small", values)), status, footer] }).append(
    stopButton(session),
  );
  const choices = [{ label: t("try_again"), value: true }, ...noDevice(session, false)];
  if (!(await choose(session, footer, choices))) await screenOut(session, "window_small", values);
}

// The size of the screen, measured: what does it is loaded where a study asks for it.

interface CalibrationParameters {
  eyebrow: string;
  occasion: CalibrationState["occasion"];
}
interface CalibrationData {
  px_per_mm: number | null;
  method: string;
  checked: boolean;
}

/** Fetched with the page's first clips, so that it is here when its turn comes, also without a connection. */
export const loadCalibration = (): Promise<typeof import("../calibration/measure")> => loadModule(() => import("../calibration/measure"));

export function calibration(session: Session): PluginClass<CalibrationParameters> {
  return plugin<CalibrationParameters, CalibrationData>({
    name: "calibration",
    parameters: {
      eyebrow: STRING, // small line above the title
      occasion: STRING, // first, screen_changed or recheck
    },
    data: {
      px_per_mm: FLOAT, // CSS pixels per millimeter, null where skipped
      method: STRING, // card or ruler
      checked: BOOL, // true where an earlier size was looked at once more and holds
    },
    show: async (display, { eyebrow, occasion }) => (await loadCalibration()).calibrate(session, display, eyebrow, occasion),
    simulate: async () => (await loadCalibration()).simulate(session),
    act: async (display) => (await loadCalibration()).act(display),
  });
}
