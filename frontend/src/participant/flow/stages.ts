/** Tells the server how far the participant has come, once a stage. */
import type { Session, Stage } from "../session";

export function enterStage(session: Session, stage: Stage): void {
  if (session.run.stage === stage) return;
  session.run.stage = stage;
  void session.api.stage(stage);
}
