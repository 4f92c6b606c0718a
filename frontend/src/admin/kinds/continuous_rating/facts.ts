/** What the admin site knows of ratings that are given while a clip runs. */
import type { AdminKind } from "../kind";

export const kind: AdminKind = { sliderRange: (trial) => (trial.kind === "continuous_rating" ? trial : null) };
