/** What the page sends of one play: the server's own type, every key given; its evidence is added when it is kept. */
import type { RatingIn } from "../../api/schema";
import type { PlaybackRecord } from "../playback/record";

export type RatingBody = Required<Omit<RatingIn, "playback" | "evidence">> & { playback: PlaybackRecord };
