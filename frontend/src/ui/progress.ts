/** A progress bar without movement of its own: a ruler with a tick a part. */
import { h } from "./element";

export interface ProgressBar {
  element: HTMLElement;
  set(done: number, total: number): void;
}

export function progressBar(label: string): ProgressBar {
  const bar = h("progress", { "aria-label": label, max: 1, value: 0 });
  return {
    element: bar,
    set(done, total) {
      bar.max = Math.max(1, total);
      bar.value = done;
    },
  };
}
