/** Clips tried by the participant page's own decoder in the experimenter's browser, and what is wrong with them. */

import type { components } from "../../api/schema";

type Schemas = components["schemas"];

/** What the server says of a clip, and where its bytes are. */
export interface ExpectedClip {
  file: string;
  sha256: string;
  address: string;
  fps: number | null;
  frames: number | null;
  width_px: number | null;
  height_px: number | null;
}

/** Kinds of findings, and whether a study can go live with one. */
const KINDS = {
  missing: true,
  undecodable: true,
  different: true,
  other_rate: false,
  still: false,
  begins_blank: false,
  blank: false,
} as const;
type Kind = keyof typeof KINDS;

export interface ClipProblem {
  kind: Kind;
  /** What was expected and found. */
  detail: string;
}

/** How far a check is: clips that are through, of how many. */
export interface ClipProgress {
  done: number;
  of: number;
}

export interface ClipCheck extends ClipProgress {
  /** False where this browser has no decoder that could check. */
  canTell: boolean;
  /** In words what the clips have in common, such as their length. */
  facts: string;
  findings: Schemas["LaunchCheck"][];
}

/** Most clips are H.264, High profile. */
const H264: VideoDecoderConfig = { codec: "avc1.640028", codedWidth: 960, codedHeight: 360 };

export async function decodesH264(): Promise<boolean> {
  if (!("VideoDecoder" in globalThis)) return false;
  return VideoDecoder.isConfigSupported(H264).then(
    ({ supported }) => supported === true,
    () => false,
  );
}

/** By clip: what is wrong with it. Clips stay as they are, so this does too. */
const known = new Map<string, readonly ClipProblem[]>();
const keyOf = ({ sha256, fps, frames }: ExpectedClip) => `${sha256} ${String(fps)} ${String(frames)}`;

/** What is wrong with one clip; null where it could not be asked for now, as the line is broken. */
export async function examineClip(clip: ExpectedClip, signal: AbortSignal): Promise<readonly ClipProblem[] | null> {
  const key = keyOf(clip);
  const before = known.get(key);
  if (before !== undefined) return before;
  const answer = await fetch(clip.address, { signal }).catch(() => null);
  if (answer === null || answer.status === 429 || answer.status >= 500) return null;
  // A clip that the server has lost may be brought back: that is not remembered.
  if (!answer.ok) return [{ kind: "missing", detail: `the server answered ${String(answer.status)}` }];
  const problems = await problemsOf(await answer.arrayBuffer(), clip);
  known.set(key, problems);
  return problems;
}

const FRAME_WAIT_MS = 10_000;
const LOOK_EVERY_MS = 4;
/** Frames that are looked at: first, last, and between them. */
const SAMPLED = 7;
const RATE_TOLERANCE = 0.02;

async function problemsOf(bytes: ArrayBuffer, clip: ExpectedClip): Promise<ClipProblem[]> {
  // The video reader is loaded when clips are there, not with the page.
  const { decodeClip } = await import("../../participant/playback/decode");
  try {
    const decoded = await decodeClip(bytes, null);
    const isKept = "bitmaps" in decoded;
    const frames = isKept ? decoded.bitmaps.length : decoded.frames;
    const sampler = newSampler(frames);
    try {
      for (let index = 0; index < frames; index += 1) {
        const picture = isKept ? decoded.bitmaps[index] : await nextPicture(decoded, index);
        if (picture !== undefined) sampler.take(index, picture);
      }
    } finally {
      if (isKept) decoded.bitmaps.forEach((bitmap) => bitmap.close());
      else decoded.close();
    }
    return [...differences(clip, frames, decoded), ...pictureProblems(sampler.samples)];
  } catch (error) {
    return [{ kind: "undecodable", detail: String(error) }];
  }
}

interface Streamed {
  problem: Error | null;
  picture: (index: number) => ImageBitmap | undefined;
}

/** The next frame of a long clip, once it is decoded. */
async function nextPicture(clip: Streamed, index: number): Promise<ImageBitmap> {
  for (let waited = 0; waited < FRAME_WAIT_MS; waited += LOOK_EVERY_MS) {
    const picture = clip.picture(index);
    if (picture !== undefined) return picture;
    if (clip.problem !== null) throw clip.problem;
    await new Promise((resolve) => setTimeout(resolve, LOOK_EVERY_MS));
  }
  throw new Error(`expected frame ${String(index)} within ${String(FRAME_WAIT_MS / 1000)} s, got none`);
}

/** The pixels of some frames of a clip, evenly spread from the first to the last. */
function newSampler(frames: number) {
  const last = Math.max(0, frames - 1);
  const chosen = new Set(Array.from({ length: SAMPLED }, (_, step) => Math.round((step * last) / (SAMPLED - 1))));
  const samples: Uint8ClampedArray[] = [];
  let context: OffscreenCanvasRenderingContext2D | null = null;
  return {
    samples,
    take(index: number, picture: ImageBitmap): void {
      if (!chosen.has(index)) return;
      context ??= new OffscreenCanvas(picture.width, picture.height).getContext("2d", { willReadFrequently: true });
      if (context === null) return;
      context.drawImage(picture, 0, 0);
      samples.push(context.getImageData(0, 0, picture.width, picture.height).data);
    },
  };
}

const shapeOf = (frames: unknown, width: unknown, height: unknown) =>
  `${String(frames)} frames of ${String(width)} x ${String(height)} pixels`;

function differences(clip: ExpectedClip, frames: number, decoded: { width: number; height: number; fps: number }): ClipProblem[] {
  const [expected, got] = [shapeOf(clip.frames, clip.width_px, clip.height_px), shapeOf(frames, decoded.width, decoded.height)];
  if (expected !== got) return [{ kind: "different", detail: `expected ${expected}, got ${got}` }];
  const rate = clip.fps ?? decoded.fps;
  if (frames < 2 || Math.abs(decoded.fps / rate - 1) <= RATE_TOLERANCE) return [];
  return [{ kind: "other_rate", detail: `shown at ${rate.toFixed(1)}, recorded at ${decoded.fps.toFixed(1)} frames per second` }];
}

/** Differences of brightness that a codec makes of one and the same picture. */
const NOISE = 3;

/** What the sampled frames show to a machine: nothing, nothing at first, or one and the same picture. */
export function pictureProblems(samples: readonly ArrayLike<number>[]): ClipProblem[] {
  const [first, ...later] = samples;
  if (first === undefined) return [];
  const isBlank = samples.map(spreadOf).map((spread) => spread <= NOISE);
  if (isBlank.every(Boolean)) return [{ kind: "blank", detail: "each frame has one color" }];
  if (isBlank[0]) return [{ kind: "begins_blank", detail: "the first frame has one color" }];
  if (later.every((sample) => largestDifference(first, sample) <= NOISE))
    return [{ kind: "still", detail: samples.length < 2 ? "one frame" : "the sampled frames are the same" }];
  return [];
}

/** The largest range of a channel within a picture of red, green, blue and opacity. */
function spreadOf(pixels: ArrayLike<number>): number {
  const [low, high] = [
    [255, 255, 255],
    [0, 0, 0],
  ];
  for (let at = 0; at < pixels.length; at += 1) {
    const channel = at % 4;
    const value = pixels[at] ?? 0;
    if (channel === 3) continue;
    if (value < (low[channel] ?? 0)) low[channel] = value;
    if (value > (high[channel] ?? 0)) high[channel] = value;
  }
  return Math.max(...high.map((value, channel) => value - (low[channel] ?? 0)));
}

function largestDifference(one: ArrayLike<number>, other: ArrayLike<number>): number {
  let largest = 0;
  for (let at = 0; at < one.length; at += 1) largest = Math.max(largest, Math.abs((one[at] ?? 0) - (other[at] ?? 0)));
  return largest;
}

// All clips of a study, with progress, as lines of its checklist.

const SKIPPED = new Set<string>();

/** End the check of this study's clips; what is not tried yet is said. */
export function skipRest(study: string): void {
  SKIPPED.add(study);
}

/** Try every clip of a study, one after the other. */
export async function checkClips(
  study: string,
  clips: readonly Schemas["ClipOut"][],
  onProgress: (progress: ClipProgress) => void,
  signal: AbortSignal,
): Promise<ClipCheck> {
  SKIPPED.delete(study);
  const files = new Map(clips.map((clip) => [clip.clip_sha256, clip]));
  const of = files.size;
  if (!(await decodesH264())) return { done: 0, of, canTell: false, facts: "", findings: [cannotTell()] };
  const problems = new Map<string, readonly ClipProblem[]>();
  for (const { clip_sha256, url, ...clip } of files.values()) {
    signal.throwIfAborted();
    if (SKIPPED.has(study)) break;
    onProgress({ done: problems.size, of });
    const answer = await examineClip({ ...clip, sha256: clip_sha256, address: url }, signal);
    if (answer === null) throw new Error(`The check stopped at ${clip.file}: the server cannot be reached. Try again.`);
    problems.set(clip_sha256, answer);
  }
  const named = [...problems].map(([sha256, of_clip]) => ({ file: files.get(sha256)?.file ?? sha256, problems: of_clip }));
  const findings = [...clipFindings(named), ...repeatedFiles(clips)];
  if (problems.size < of) findings.push(skippedFinding(problems.size, of));
  return { done: problems.size, of, canTell: true, facts: factsOf(clips), findings };
}

const finding = (kind: string, blocks: boolean, text: string): Schemas["LaunchCheck"] => ({ kind, blocks, text, page: "clips", path: "" });

const cannotTell = () =>
  finding(
    "clips_not_tried",
    false,
    "This browser cannot test whether participants will see the clips: it has no H.264 decoder, or the address is not https. Open this page in a current Chrome, Edge, Firefox or Safari.",
  );

const skippedFinding = (done: number, of: number) =>
  finding("clips_not_tried", false, `${String(of - done)} of ${String(of)} clips were not tried in this browser. Check them all once.`);

const WORDS: Readonly<Record<Kind, [one: string, several: string, todo: string]>> = {
  missing: ["is missing on the server", "are missing on the server", "Upload the clip again."],
  undecodable: ["does not play in the participant page", "do not play in the participant page", "Export the clip again as H.264 in MP4."],
  different: ["is not as stored", "are not as stored", "Upload the clip again."],
  other_rate: ["plays at another rate than recorded", "play at another rate than recorded", "Is this intended?"],
  still: ["shows no motion", "show no motion", "Is this intended?"],
  begins_blank: ["begins with an empty picture", "begin with an empty picture", "Cut it off, or use a fixation instead."],
  blank: ["shows nothing", "show nothing", "Is this intended?"],
};

/** One line per kind of problem, with the files that have it. */
export function clipFindings(clips: readonly { file: string; problems: readonly ClipProblem[] }[]): Schemas["LaunchCheck"][] {
  return (Object.keys(KINDS) as Kind[]).flatMap((kind) => {
    const hits = clips.flatMap(({ file, problems }) => problems.filter((one) => one.kind === kind).map(({ detail }) => ({ file, detail })));
    if (hits.length === 0) return [];
    const [one, several, todo] = WORDS[kind];
    const named = hits.map(({ file, detail }) => `${file} (${detail})`);
    const count = hits.length === 1 ? `1 clip ${one}` : `${String(hits.length)} clips ${several}`;
    return finding(`clip_${kind}`, KINDS[kind], `${count}: ${named.join(", ")}. ${todo}`);
  });
}

/** Cells of the design that show the very same file: a difference between them cannot be seen. */
export function repeatedFiles(clips: readonly Pick<Schemas["ClipOut"], "clip_sha256" | "cell" | "file">[]): Schemas["LaunchCheck"][] {
  const cells = new Map<string, Set<string>>();
  for (const { clip_sha256, cell } of clips) cells.set(clip_sha256, (cells.get(clip_sha256) ?? new Set()).add(cell));
  const shared = [...cells.values()].filter((of) => of.size > 1);
  if (shared.length === 0) return [];
  const named = shared.map((of) => [...of].join(" and "));
  const count = shared.length === 1 ? "1 clip is the same file" : `${String(shared.length)} clips are the same file`;
  const text = `${count} in several cells: ${named.join("; ")}. A difference between these cells cannot be seen. Is this intended?`;
  return [finding("clip_repeated", false, text)];
}

/** "80 clips: 1.5 s, 960 x 360 pixels, 30 frames per second"; where they differ, the least and the most. */
export function factsOf(clips: readonly Pick<Schemas["ClipOut"], "clip_sha256" | "frames" | "fps" | "width_px" | "height_px">[]): string {
  const range = (values: readonly number[], digits: number) => {
    const [low, high] = [Math.min(...values).toFixed(digits), Math.max(...values).toFixed(digits)];
    return low === high ? low : `${low} to ${high}`;
  };
  const sizes = [...new Set(clips.map((clip) => `${String(clip.width_px)} x ${String(clip.height_px)}`))];
  const seconds = clips.map((clip) => clip.frames / clip.fps);
  const rates = clips.map((clip) => clip.fps);
  const digits = rates.every(Number.isInteger) ? 0 : 2;
  const shape = sizes.length <= 2 ? sizes.join(" and ") : `${String(sizes.length)} sizes`;
  const number = new Set(clips.map((clip) => clip.clip_sha256)).size;
  return `${String(number)} clips: ${range(seconds, 2)} s, ${shape} pixels, ${range(rates, digits)} frames per second`;
}
