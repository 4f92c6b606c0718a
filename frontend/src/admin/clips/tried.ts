/** Whether each clip of an upload plays: tried in the experimenter's browser by the decoder of the participant's page. */

import type { Schemas } from "../api";

type File = Schemas["UploadedFile"];

/** By the hash of a clip: why it does not play, or null where it does. Clips stay as they are, so this does too. */
const known = new Map<string, string | null>();

/** Most clips are H.264, High profile. */
const H264: VideoDecoderConfig = { codec: "avc1.640028", codedWidth: 960, codedHeight: 360 };

export interface Tried {
  /** By the name of a file: why its clip does not play. */
  problems: ReadonlyMap<string, string>;
  /** False where this browser has no decoder that could tell. */
  canTell: boolean;
}

const keyOf = ({ sha256, fps, frames }: File) => `${String(sha256)} ${String(fps)} ${String(frames)}`;

/** Decode every clip, one after the other; those that could not be fetched are not judged. */
export async function tryClips(upload: string, files: readonly File[], signal: AbortSignal): Promise<Tried> {
  const problems = new Map<string, string>();
  if (!(await decodesH264())) return { problems, canTell: false };
  for (const file of files) {
    if (signal.aborted) break;
    if (file.state !== "ready" || file.sha256 == null) continue;
    const key = keyOf(file);
    if (!known.has(key)) {
      const answer = await fetch(`/api/admin/uploads/${upload}/clips/${file.sha256}`, { signal }).catch(() => null);
      if (!answer?.ok) continue;
      known.set(key, await problemOf(await answer.arrayBuffer(), file));
    }
    const problem = known.get(key);
    if (problem != null) problems.set(file.name, problem);
  }
  return { problems, canTell: true };
}

async function decodesH264(): Promise<boolean> {
  if (!("VideoDecoder" in globalThis)) return false;
  return VideoDecoder.isConfigSupported(H264).then(
    ({ supported }) => supported === true,
    () => false,
  );
}

async function problemOf(bytes: ArrayBuffer, file: File): Promise<string | null> {
  // The video reader is loaded when clips are there, not with the page.
  const { decodeClip } = await import("../../participant/playback/decode");
  try {
    const clip = await decodeClip(bytes, file.fps ?? null);
    const isKept = "bitmaps" in clip;
    const frames = isKept ? clip.bitmaps.length : clip.frames;
    if (isKept) clip.bitmaps.forEach((bitmap) => bitmap.close());
    else clip.close();
    const [expected, got] = [shapeOf(file.frames, file.width_px, file.height_px), shapeOf(frames, clip.width, clip.height)];
    return expected === got ? null : `expected ${expected}, got ${got}`;
  } catch (error) {
    return String(error);
  }
}

const shapeOf = (frames: unknown, width: unknown, height: unknown) =>
  `${String(frames)} frames of ${String(width)} x ${String(height)} pixels`;

/** The upload with the clips that do not play among those that cannot be used. */
export function withTried(upload: Schemas["UploadOut"], tried: Tried | undefined): Schemas["UploadOut"] {
  if (!tried || tried.problems.size === 0) return upload;
  const files = upload.files.map((file): File => {
    const problem = tried.problems.get(file.name);
    if (problem === undefined) return file;
    const words = `the participant's page does not play it in this browser (${problem}); export it again as H.264 in MP4`;
    return { ...file, state: "refused", problem: words };
  });
  return { ...upload, files };
}
