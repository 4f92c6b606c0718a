/** Says that a view begins, so that it is known though the page dies, and again when it has ended. */
import type { TrialInfo } from "../../../api/schema";
import type { Session } from "../../session";
import { seenClips, type RolesShown } from "./roles";

export async function beginView(session: Session, trial: TrialInfo, number: number): Promise<(shown: RolesShown[]) => Promise<void>> {
  const view = {
    id: crypto.randomUUID(),
    trial_index: trial.trial_index,
    number,
    started_at_client: new Date().toISOString(),
    screen: { ...session.screen.record(), width_px: window.innerWidth, height_px: window.innerHeight },
  };
  const send = async (more: object): Promise<void> => {
    await session.outbox.put("POST", "/api/run/views", { views: [{ ...view, ...more }] });
  };
  await send({});
  return (shown) => send({ ended_at_client: new Date().toISOString(), clips: seenClips(trial, shown) });
}
