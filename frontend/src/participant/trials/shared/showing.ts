/** One showing of a clip: waits for the start key, plays, and notes what disturbed it. */
import { clickNothing, isStartKey, listenKeys } from "../../../ui/keys";
import { h } from "../../../ui/element";
import { MeantPress } from "../../../ui/meant-press";
import { button } from "../../../ui/page";
import type { Showing } from "../../playback/record";
import { screenSignal } from "../../screens/support";
import type { Session } from "../../session";
import { refreshDropped, watchDisturbances } from "../../views/disturbances";
import type { Stage } from "./stage";

export interface Shown extends Showing {
  early_keys: number;
}

const FALLBACK_REFRESH_MS = 1000 / 60;

/** The ready screen; resolves with the time of the press that starts the clip (absolute, ms). */
export function waitForStart(
  session: Session,
  stage: Stage,
  prompt: string,
  note: string,
  pointer_delay_ms: number,
  left?: AbortSignal,
): Promise<number> {
  const { signal, done } = screenSignal(session);
  left?.addEventListener("abort", done);
  const { t } = session;
  return new Promise((resolve) => {
    const meant = new MeantPress(pointer_delay_ms, signal);
    const start = (event: Event): void => {
      if (!meant.allows(event)) return;
      done();
      resolve(performance.timeOrigin + event.timeStamp);
    };
    const go = button(t("start"), () => {});
    go.addEventListener("click", start, { signal });
    stage.below.replaceChildren(h("h1", { class: "ready" }, prompt), go, h("p", { class: "count" }, note));
    stage.element.querySelector(".clip")?.addEventListener("click", start, { signal });
    const pressed = (event: KeyboardEvent): void => {
      if (!isStartKey(event)) return;
      clickNothing(event);
      start(event);
    };
    listenKeys(pressed, signal, go);
    window.addEventListener("resize", stage.fit, { signal });
    stage.fit();
    go.focus({ preventScroll: true });
  });
}

/** Play the prepared clip once, with nothing else on the screen, and not before `kept`: the view is on disk first. */
export async function showOnce(
  session: Session,
  stage: Stage,
  sha256: string,
  key_at_ms: number,
  fixation_ms: number,
  kept: Promise<void>,
  label = "",
): Promise<Shown> {
  const { player, screen, t } = session;
  const { signal, done } = screenSignal(session);
  let early_keys = 0;
  document.addEventListener(
    "keydown",
    (event) => {
      if (!event.repeat && event.key.length === 1) early_keys += 1;
      if (event.key === " ") event.preventDefault();
    },
    { signal },
  );
  stage.setPlaying(true);
  stage.below.replaceChildren(h("p", { class: label ? "count" : "spoken", role: "status" }, label || t("clip_playing")));
  const watched = watchDisturbances(player.element, stage.layout);
  const refresh_ms = screen.refresh_rate_hz ? 1000 / screen.refresh_rate_hz : FALLBACK_REFRESH_MS;
  try {
    const shown = await player.play(sha256, { fixation_ms, refresh_ms, ready: kept });
    const { counts, focus_lost, visible_share } = watched.stop();
    const dropped = screen.refresh_rate_hz !== null && refreshDropped(shown.refresh_ms, refresh_ms);
    const disturbances = dropped ? { ...counts, refresh_dropped: 1 } : counts;
    return { ...shown, key_at_ms, focus_lost, visible_share, disturbances, early_keys };
  } finally {
    watched.stop();
    done();
    stage.setPlaying(false);
  }
}
