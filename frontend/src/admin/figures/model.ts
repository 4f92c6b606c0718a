/** The PCA blink model as `stimuli model fit` writes it, and the blink of given coefficients. */

export interface BlinkModel {
  fps: number;
  down_frames: number;
  up_frames: number;
  scale_weight: number;
  explained: number[];
  coefficient_sd: number[];
  mean: number[];
  components: number[][];
}

/** Read the model's JSON; an Error where a part is missing. */
export function readModel(json: Record<string, unknown>): BlinkModel {
  const numbers = (name: string): number[] => {
    const value = json[name];
    if (!Array.isArray(value) || !value.every((one) => typeof one === "number")) throw new Error(`the model has no ${name}`);
    return value;
  };
  const number = (name: string): number => {
    const value = json[name];
    if (typeof value !== "number") throw new Error(`the model has no ${name}`);
    return value;
  };
  const rows = json["components"];
  if (!Array.isArray(rows)) throw new Error("the model has no components");
  return {
    fps: number("fps"),
    down_frames: number("down_frames"),
    up_frames: number("up_frames"),
    scale_weight: number("scale_weight"),
    explained: numbers("explained"),
    coefficient_sd: numbers("coefficient_sd"),
    mean: numbers("mean"),
    components: rows.map((row: unknown) => (Array.isArray(row) ? row.map(Number) : [])),
  };
}

/** Closure per frame for coefficients in standard deviations; `valid` is false where the lids would overlap. */
export function blinkOf(model: BlinkModel, deviations: readonly number[]): { closure: number[]; valid: boolean } {
  const row = model.mean.map((mean, frame) =>
    model.components.reduce(
      (sum, component, mode) => sum + (deviations[mode] ?? 0) * (model.coefficient_sd[mode] ?? 0) * (component[frame] ?? 0),
      mean,
    ),
  );
  const form = row.slice(0, model.down_frames + model.up_frames + 1);
  const [downScale = 0, upScale = 0] = row.slice(-2).map((value) => value / model.scale_weight);
  const down = Math.max(1, Math.round(model.down_frames * downScale));
  const up = Math.max(1, Math.round(model.up_frames * upScale));
  const closing = resampled(form.slice(0, model.down_frames + 1), down + 1);
  const opening = resampled(form.slice(model.down_frames), up + 1);
  const closure = [...closing, ...opening.slice(1)].map((value) => Math.max(0, value));
  return { closure: closure.map((value) => Math.min(1, value)), valid: Math.max(...form) <= 1 };
}

/** `values` at `length` equally spaced places, by straight lines between samples. */
function resampled(values: readonly number[], length: number): number[] {
  return Array.from({ length }, (_, index) => {
    const at = (index * (values.length - 1)) / Math.max(1, length - 1);
    const before = Math.floor(at);
    const left = values[before] ?? 0;
    return left + (at - before) * ((values[before + 1] ?? left) - left);
  });
}
