/** What the page sends of one play: the server's own type, every key given; its evidence is added when it is kept. */
import type { RatingIn, TrialInfo } from "../../api/schema";
import { clockTime, count, duration } from "../measured";
import type { PlaybackRecord } from "../playback/record";
import type { Session } from "../session";

export type RatingBody = Required<Omit<RatingIn, "playback" | "evidence">> & { playback: PlaybackRecord };
const LONGEST_COMMENT = 5_000;
type Given = Partial<Pick<RatingBody, "rt" | "rt_from_first_frame" | "changes" | "comment">>;

/** A play and its answer, at this moment; what is not given was not measured, changed or said. */
export function ratingBody(
  session: Session,
  { trial_index }: TrialInfo,
  play: number,
  answer: RatingBody["answer"],
  playback: PlaybackRecord,
  given: Given = {},
): RatingBody {
  return {
    trial_index,
    play,
    answer,
    rt: null,
    rt_from_first_frame: null,
    time_elapsed: duration(session.clock.elapsed()),
    changes: 0,
    comment: null,
    answered_at_client: clockTime(),
    playback,
    ...given,
    ...(given.changes === undefined ? {} : { changes: count(given.changes) ?? 0 }),
    // As long as the server keeps one.
    ...(given.comment ? { comment: given.comment.slice(0, LONGEST_COMMENT) } : {}),
  };
}
