/** Waits until a block's clips are here, with progress, another try, and a way out. */
import type { TrialInfo } from "../../api/schema";
import { h, showPage, progressBar } from "../../ui/element";
import { plugin, INT, OBJECT, STRING, type PluginClass, BOOL } from "../jspsych";
import type { ClipUnavailable, ClipSource } from "../preload/clip-cache";
import type { Session } from "../session";
import { choose, stopButton, trouble } from "./support";

interface Parameters {
  eyebrow: string;
  trials: TrialInfo[];
}
interface Data {
  clips: number;
  failed: number;
  waited_ms: number;
}

type WithClips = Pick<TrialInfo, "clip_sha256"> & Partial<Pick<TrialInfo, "clips">>;

/** Every clip of these trials. A visit that an earlier page has kept knows one clip per trial. */
export function sourcesOf(trials: readonly WithClips[]): ClipSource[] {
  return trials.flatMap(({ clips, clip_sha256 }) =>
    (clips ?? [{ clip_sha256 }]).flatMap(({ clip_sha256: sha256 }) =>
      sha256 ? [{ clip_sha256: sha256, clip_url: `/clips/${sha256}.mp4` }] : [],
    ),
  );
}

export function preloadPage(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "preload-clips",
    parameters: {
      eyebrow: STRING, // small line above the title
      trials: OBJECT, // trials whose clips must be here
    },
    data: {
      clips: INT, // clips of the block
      failed: INT, // clips that could not be had
      waited_ms: INT, // time on the screen in ms
    },
    show: (display, { eyebrow, trials }) => waitForClips(session, display, eyebrow, sourcesOf(trials)),
    simulate: ({ trials }) => ({ clips: sourcesOf(trials).length, failed: 0, waited_ms: 0 }),
    act: () => {},
  });
}

async function waitForClips(session: Session, display: HTMLElement, eyebrow: string, sources: ClipSource[]): Promise<Data> {
  const started = performance.now();
  const result = (failed: number): Data => ({ clips: sources.length, failed, waited_ms: Math.round(performance.now() - started) });
  if (session.clips.hasAll(sources)) return result(0);
  for (;;) {
    const failed = await loadShown(session, display, eyebrow, sources);
    if (failed.length > 0 && (await askAgain(session, display, failed))) continue;
    failed.forEach(({ sha256 }) => session.clips.giveUp(sha256));
    return result(failed.length);
  }
}

function loadShown(session: Session, display: HTMLElement, eyebrow: string, sources: ClipSource[]): Promise<ClipUnavailable[]> {
  const { t } = session;
  const bar = progressBar(t("preload_title"));
  const count = h("p", { class: "count", role: "status" });
  const section = showPage(display, { title: t("preload_title"), eyebrow, body: [h("p", {}, t("preload_text")), bar.element, count] });
  section.append(stopButton(session));
  return session.clips.load(sources, ({ done, total }) => {
    bar.set(done, total);
    count.textContent = t("preload_progress", { done, total });
  });
}

/** True: try again. False: go on without the clips that the server itself cannot give. */
async function askAgain(session: Session, display: HTMLElement, failed: ClipUnavailable[]): Promise<boolean> {
  const { t } = session;
  for (const { sha256, fault } of failed) session.events.add("clip_unavailable", { clip_sha256: sha256, fault });
  const footer = h("footer", { class: "actions" });
  const section = showPage(display, { title: t("preload_failed_title"), body: [h("p", { role: "alert" }, t("preload_failed")), footer] });
  section.append(stopButton(session));
  const gone = failed.every(({ fault }) => fault !== "offline");
  const without = gone ? [{ label: t("preload_without"), value: false }] : [];
  return choose(session, footer, [{ label: t("try_again"), value: true }, ...without]);
}

// At the end of a block: wait a little for receipts, because they say which clips are shown again.

interface SettleParameters {
  limit_ms: number;
}
interface SettleData {
  settled: boolean;
}
const SEEN_MS = 250;

export function settle(session: Session): PluginClass<SettleParameters> {
  return plugin<SettleParameters, SettleData>({
    name: "settle",
    parameters: { limit_ms: INT }, // longest wait in ms; what comes later joins the next block
    data: { settled: BOOL }, // true where the server had everything
    async show(display, { limit_ms }) {
      let said: string | null = null;
      const showProgress = (): void => {
        const why = trouble(session);
        // What is written again may be spoken again.
        if (why !== said) showPage(display, { title: session.t("saving"), body: [h("p", { role: "status" }, why)] });
        said = why;
      };
      const timer = setInterval(showProgress, SEEN_MS * (session.outbox.state.failures > 0 ? 1 : 8));
      const settled = await session.outbox.drained(limit_ms);
      clearInterval(timer);
      return { settled };
    },
    simulate: async ({ limit_ms }) => ({ settled: await session.outbox.drained(limit_ms) }),
    act: () => {},
  });
}
