/** The answers to one clip as the server is sent them. */
import type { RatingAnswer, ShownClipRating } from "../../../api/schema";
import { duration } from "../../measured";
import type { Rated } from "./scale";

/** `from_ms` is when the clip's last frame was drawn, where it is known. */
export function answerOf({ answers, at_ms }: Rated, from_ms: number | undefined): RatingAnswer {
  const timed = Object.entries(answers).map(([name, given]) => {
    const at = at_ms[name];
    const rt = at === undefined || from_ms === undefined ? null : duration(at - from_ms);
    return [name, { ...given, rt }];
  });
  return { kind: "clip_rating", answers: Object.fromEntries(timed) as RatingAnswer["answers"] };
}

/** No answer on any scale: the clip could not be shown. */
export function noAnswer({ scales }: ShownClipRating): RatingAnswer {
  const none = scales.map(({ name }) => [name, { response: null }]);
  return { kind: "clip_rating", answers: Object.fromEntries(none) as RatingAnswer["answers"] };
}

/** The one number where there is one scale; jsPsych's own data hold it. */
export function onlyResponse(answers: RatingAnswer["answers"]): number | null {
  const [first, ...more] = Object.values(answers);
  return first && more.length === 0 ? first.response : null;
}
