/** What is noted all the time: full screen left, the connection lost and back, and that the page is alive. */
import type { Session } from "../session";

const HEARTBEAT_MS = 20_000;

export function watch(session: Session): void {
  const { events, outbox, over } = session;
  const { signal } = over;
  document.addEventListener(
    "fullscreenchange",
    () => {
      if (!document.fullscreenElement && !signal.aborted) events.add("fullscreen_left");
    },
    { signal },
  );
  window.addEventListener("offline", () => events.add("offline"), { signal });
  window.addEventListener(
    "online",
    () => {
      events.add("online");
      outbox.nudge();
    },
    { signal },
  );
  const beat = setInterval(() => {
    // While answers are waiting a sign of life is of no use; it would only fill the outbox.
    if (outbox.state.failures === 0 && !document.hidden) events.add("heartbeat", { stage: session.run.stage });
  }, HEARTBEAT_MS);
  signal.addEventListener("abort", () => clearInterval(beat));
}
