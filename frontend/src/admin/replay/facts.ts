/** What is said in words beside a replay. */
import type { Schemas } from "../api";
import { fixed, plain, words } from "../ui/format";
import type { Lane, Play, PlayedBack } from "./shown";

/** What was answered, whatever the kind of trial: each key of the answer that says something. */
export function answerWords({ answer }: Play): string {
  if (answer === null) return "no answer";
  // How a trial came about, which is not what was answered: it is said after an answer, and makes none.
  const { answers, values, known, arrangement, step_frames, moves, ...rest } = answer;
  const parts: string[] = [];
  if (isRecord(answers)) {
    for (const [scale, one] of Object.entries(answers)) {
      if (!isRecord(one)) continue;
      parts.push(`${words(scale)} ${one["not_applicable"] === true ? "not applicable" : plain(one["response"] ?? "–")}`);
    }
  }
  if (Array.isArray(values)) parts.push(`${values.length} samples of the slider`);
  for (const [key, value] of Object.entries(rest)) {
    const isSaid = key === "kind" || value === null || (key === "response" && parts.length > 0) || value === false;
    if (!isSaid) parts.push(value === true ? words(key) : `${words(key)} ${typeof value === "string" ? words(value) : plain(value)}`);
  }
  if (parts.length === 0) return "no answer";
  for (const [key, value] of Object.entries({ step_frames, moves, arrangement })) {
    if (value !== undefined && value !== null) parts.push(`${words(key)} ${typeof value === "string" ? words(value) : plain(value)}`);
  }
  if (typeof known === "number") parts.push(`stimulus chosen by ${known === 1 ? "1 answer" : `${known} answers`} before`);
  return parts.join(", ");
}

const isRecord = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);

/** "12, 15 to 18", or "none". */
export function missingWords({ missing }: Lane): string {
  return missing.map(([first, last]) => (first === last ? String(first) : `${first} to ${last}`)).join(", ") || "none";
}

export function longestWords({ stands }: Lane): string {
  const longest = stands.toSorted((one, other) => other.to_ms - other.from_ms - (one.to_ms - one.from_ms))[0];
  return longest ? `frame ${longest.index}, ${fixed(longest.to_ms - longest.from_ms, 1)} ms` : "–";
}

/** The slider of a continuous rating over the time line: when each sampled frame stood, and how far up the slider was. */
export function traceOf(play: Play, played: PlayedBack, trial: Schemas["Replay"]["trial"]): [number, number][] {
  const { values, step_frames } = play.answer ?? {};
  const lane = played.scenes.at(-1)?.lanes[0];
  if (trial.kind !== "continuous_rating" || !lane || !Array.isArray(values) || typeof step_frames !== "number") return [];
  const range = Math.max(1e-9, trial.maximum - trial.minimum);
  return values.flatMap((value: unknown, sample): [number, number][] => {
    const stand = lane.stands.find(({ index }) => index >= sample * step_frames);
    return stand && typeof value === "number" ? [[stand.from_ms, (value - trial.minimum) / range]] : [];
  });
}
