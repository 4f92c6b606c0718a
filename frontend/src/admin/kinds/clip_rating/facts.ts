/** What the admin site knows of ratings of single clips. */
import type { AdminKind } from "../kind";

export const kind: AdminKind = {
  hasWideTable: true,
  scaleEnds(trial) {
    if (trial.kind !== "clip_rating" || trial.scale === null) return null;
    return "minimum" in trial.scale && "maximum" in trial.scale ? trial.scale : null;
  },
};
