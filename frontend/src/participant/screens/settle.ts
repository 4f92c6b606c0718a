/** At the end of a block: wait a little for receipts, because they say which clips are shown again. */
import { h } from "../../ui/element";
import { showPage } from "../../ui/page";
import { BOOL, INT, plugin, type PluginClass } from "../jspsych";
import type { Session } from "../session";
import { trouble } from "./support";

interface Parameters {
  limit_ms: number;
}
interface Data {
  settled: boolean;
}
const SEEN_MS = 250;

export function settle(session: Session): PluginClass<Parameters> {
  return plugin<Parameters, Data>({
    name: "settle",
    parameters: { limit_ms: INT }, // longest wait in ms; what comes later joins the next block
    data: { settled: BOOL }, // true where the server had everything
    async show(display, { limit_ms }) {
      let said: string | null = null;
      const tell = (): void => {
        const why = trouble(session);
        // What is written again may be spoken again.
        if (why !== said) showPage(display, { title: session.t("saving"), body: [h("p", { role: "status" }, why)] });
        said = why;
      };
      const say = setInterval(tell, SEEN_MS * (session.outbox.state.failures > 0 ? 1 : 8));
      const settled = await session.outbox.drained(limit_ms);
      clearInterval(say);
      return { settled };
    },
    simulate: async ({ limit_ms }) => ({ settled: await session.outbox.drained(limit_ms) }),
    act: () => {},
  });
}
