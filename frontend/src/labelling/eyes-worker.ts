/** Looks for eyes in the background, which takes seconds, while the page stays usable. */

import type { EyesOfVideo } from "./eyes";
import type { Grey } from "./grey";
import { seeEyes } from "./follow-eyes";

export interface ToEyes {
  readonly pictures: readonly Grey[];
  readonly seconds: number;
}

export type FromEyes = { readonly percent: number } | { readonly eyes: EyesOfVideo };

const send = (message: FromEyes): void => self.postMessage(message);

self.onmessage = ({ data }: MessageEvent<ToEyes>) => {
  let reported = -1;
  const eyes = seeEyes(data.pictures, data.seconds, (share) => {
    const percent = Math.floor(100 * share);
    if (percent > reported) send({ percent });
    reported = Math.max(reported, percent);
  });
  send({ eyes });
};
