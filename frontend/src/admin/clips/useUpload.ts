/** An upload of clips: what is sent, how far the server is with it, what became of each file. It outlives the page. */

import { api, Refused, type Schemas, unwrap } from "../api";
import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { useState } from "react";
import type { ClipProblem } from "./examine";

// Files on their way to the server: in small requests, so that a broken line costs little and goes on where it broke.

const MAX_BATCH = { files: 40, bytes: 16 * 1024 * 1024 };
const WAITS_MS = [1000, 2000, 4000, 8000, 15_000];

/** A name in the form in which the server keeps it. */
const formOf = (name: string) => name.normalize("NFC");

/** Files in requests of limited size, in order; a file above the limit gets a separate request. */
export function batchesOf<F extends { size: number }>(files: readonly F[], most = MAX_BATCH): F[][] {
  const batches: F[][] = [];
  let bytes = 0;
  for (const file of files) {
    const last = batches.at(-1);
    if (last === undefined || last.length >= most.files || bytes + file.size > most.bytes) {
      batches.push([file]);
      bytes = file.size;
    } else {
      last.push(file);
      bytes += file.size;
    }
  }
  return batches;
}

/** Whether it may go well a moment later: the line is broken, or the server restarts or is busy. */
function passes(error: unknown): boolean {
  return error instanceof Refused && (error.status === 0 || error.status === 408 || error.status === 429 || error.status >= 500);
}

/** What `attempt` gives, tried again after growing waits where it may go well later. */
export async function persistently<T>(attempt: () => Promise<T>, waits: readonly number[] = WAITS_MS): Promise<T> {
  for (const wait of waits) {
    try {
      return await attempt();
    } catch (error) {
      if (!passes(error)) throw error;
      await new Promise((resolve) => setTimeout(resolve, wait));
    }
  }
  return attempt();
}

async function beginUpload(fps: number | null): Promise<Schemas["UploadOut"]> {
  const form = new FormData();
  if (fps !== null) form.append("fps", String(fps));
  return persistently(() => unwrap(api.POST("/api/admin/uploads", { body: {}, bodySerializer: () => form })));
}

/** Files that the server will not take, whatever the line; all others are there. */
export class LeftOut extends Error {
  override name = "LeftOut";
  constructor(readonly reasons: readonly string[]) {
    super(reasons.join(" "));
  }
}

/** Send what the upload does not hold yet; `onSent` gets the number of files sent. Throws LeftOut if the server refuses some. */
async function sendFiles(id: string, files: readonly File[], onSent: (count: number) => void): Promise<void> {
  const missing = await missingOf(id, files);
  const reasons: string[] = [];
  let sent = files.length - missing.length;
  onSent(sent);
  for (const batch of batchesOf(missing)) {
    const refused = await sendBatch(id, batch);
    reasons.push(...refused);
    sent += batch.length - refused.length;
    onSent(sent);
  }
  if (reasons.length > 0) throw new LeftOut(reasons);
}

async function missingOf(id: string, files: readonly File[]): Promise<File[]> {
  const there = await persistently(() => unwrap(api.GET("/api/admin/uploads/{upload}", { params: { path: { upload: id } } })));
  const known = new Map(there.files.map((file) => [file.name, file.bytes]));
  return files.filter((file) => known.get(formOf(file.name)) !== file.size);
}

/** One request; where the server refuses a file, one for each file that it does not hold. Why each was refused. */
async function sendBatch(id: string, batch: readonly File[]): Promise<string[]> {
  try {
    await persistently(() => unwrap(api.POST("/api/admin/uploads/{upload}/files", filesFor(id, batch))));
    return [];
  } catch (error) {
    if (!(error instanceof Refused) || error.status !== 422) throw error;
    if (batch.length === 1) return [error.message];
  }
  const refused: string[] = [];
  for (const file of await missingOf(id, batch)) refused.push(...(await sendBatch(id, [file])));
  return refused;
}

function filesFor(id: string, files: readonly File[], replaces?: string) {
  const form = new FormData();
  for (const file of files) form.append("files", file);
  if (replaces !== undefined) form.append("replaces", replaces);
  return { params: { path: { upload: id } }, body: { files: [] }, bodySerializer: () => form };
}

/** Put another file in the place of one of the upload's. */
async function replaceFile(id: string, name: string, file: File): Promise<Schemas["UploadProgress"]> {
  return persistently(() => unwrap(api.POST("/api/admin/uploads/{upload}/files", filesFor(id, [file], name))));
}

// Whether each clip of an upload plays: tried in the experimenter's browser by the decoder of the participant's page.

type UploadedFile = Schemas["UploadedFile"];

interface Tried {
  /** By the name of a file: why its clip does not play. */
  problems: ReadonlyMap<string, string>;
  /** False where this browser has no decoder that could check. */
  canTell: boolean;
  /** What else is odd about clips that play, a sentence each. */
  remarks: readonly string[];
}

/** Decode every clip, one after the other; those that could not be fetched are not judged. */
async function tryClips(upload: string, files: readonly UploadedFile[], signal: AbortSignal): Promise<Tried> {
  const { clipFindings, decodesH264, examineClip } = await import("./examine");
  const problems = new Map<string, string>();
  if (!(await decodesH264())) return { problems, canTell: false, remarks: [] };
  const doubtful: { file: string; problems: readonly ClipProblem[] }[] = [];
  for (const file of files) {
    if (signal.aborted) break;
    if (file.state !== "ready" || file.sha256 == null) continue;
    const { name, sha256, fps = null, frames = null, width_px = null, height_px = null } = file;
    const address = `/api/admin/uploads/${upload}/clips/${sha256}`;
    const faults = await examineClip({ file: name, sha256, address, fps, frames, width_px, height_px }, signal);
    const problem = faults?.find(({ kind }) => kind === "undecodable" || kind === "different");
    if (problem !== undefined) problems.set(name, problem.detail);
    else if (faults !== null) doubtful.push({ file: name, problems: faults });
  }
  const remarks = clipFindings(doubtful).filter(({ kind }) => kind !== "clip_missing");
  return { problems, canTell: true, remarks: remarks.map(({ text }) => text) };
}

/** The upload with the clips that do not play among those unusable. */
function withTried(upload: Schemas["UploadOut"], tried: Tried | undefined): Schemas["UploadOut"] {
  if (!tried || tried.problems.size === 0) return upload;
  const files = upload.files.map((file): UploadedFile => {
    const problem = tried.problems.get(file.name);
    if (problem === undefined) return file;
    const words = `the participant's page does not play it in this browser (${problem}); export it again as H.264 in MP4`;
    return { ...file, state: "refused", problem: words };
  });
  return { ...upload, files };
}

const LOOK_EVERY_MS = 700;
const storageKey = (purpose: string) => `palpebra.upload.${purpose}`;

/** The next page begins without the upload for this purpose: its clips are in a study. */
export const forgetUpload = (purpose: string) => localStorage.removeItem(storageKey(purpose));

export interface Upload {
  /** Files that are there, of those that are being sent; null where nothing is sent. */
  sending: { sent: number; of: number } | null;
  /** Why sending ended before its end; `goOn` takes it up again. */
  broken: Error | null;
  goOn: () => void;
  progress: Schemas["UploadProgress"] | null;
  /** Result for each file, once none waits. */
  received: Schemas["UploadOut"] | null;
  /** The last state, while files are sent or examined: the rest of the page need not disappear. */
  last: Schemas["UploadOut"] | null;
  /** Whether the clips that came play in this browser; null until all have been tried. */
  plays: "all" | "not all" | "unknown" | null;
  /** What is odd about clips that play: blank, still, of another rate. */
  remarks: readonly string[];
  fps: number | null;
  askFps: (fps: number | null) => void;
  send: (files: readonly File[]) => void;
  /** Put a file in the place of one that was refused; the others stay. */
  replace: (name: string, file: File) => void;
  /** Why the last file was not taken. */
  notReplaced: Error | null;
  isReplacing: boolean;
  /** Leave a file out of what is made of the upload, or put it back. */
  leaveOut: (name: string, leftOut: boolean) => void;
  notLeftOut: Error | null;
  /** Start over; what was sent is deleted by the server within a day. */
  forget: () => void;
}

function playsOf({ data, isError }: { data: Tried | undefined; isError: boolean }): Upload["plays"] {
  if (isError || data?.canTell === false) return "unknown";
  if (data === undefined) return null;
  return data.problems.size > 0 ? "not all" : "all";
}

/** What keeps the clips from being used as they are; false where nothing does. */
export function playNeeded({ received, plays }: Upload): string | false {
  if (received === null || received.files.length === 0) return false;
  if (plays === null) return "clips that have been tried in this browser";
  return plays === "not all" && "another file for each clip that does not play, or leave it out";
}

/** The upload for this purpose, such as a new study; one that was begun before a reload is taken up. */
export function useUpload(purpose: string): Upload {
  const queries = useQueryClient();
  const [id, setId] = useState(() => localStorage.getItem(storageKey(purpose)));
  const [fps, setFps] = useState<number | null>(null);
  const [sending, setSending] = useState<Upload["sending"]>(null);
  const path = { params: { path: { upload: id ?? "" } } };
  const progress = useQuery({
    queryKey: ["upload", id, "progress"],
    queryFn: () => unwrap(api.GET("/api/admin/uploads/{upload}/progress", path)),
    enabled: id !== null,
    refetchInterval: ({ state }) => ((state.data?.waiting ?? 1) > 0 && state.error === null ? LOOK_EVERY_MS : false),
  });
  const settled = sending === null && progress.data?.waiting === 0 && progress.data.files + progress.data.left_out > 0;
  const received = useQuery({
    queryKey: ["upload", id, "files", progress.data?.files, progress.data?.left_out, fps],
    queryFn: () => unwrap(api.GET("/api/admin/uploads/{upload}", path)),
    enabled: id !== null && settled,
    placeholderData: (before, of) => (of?.queryKey[1] === id ? before : undefined),
  });
  const files = settled ? received.data?.files : undefined;
  const tried = useQuery({
    queryKey: ["tried", id, files?.map(({ name, sha256, fps: rate }) => [name, sha256, rate])],
    queryFn: ({ signal }) => tryClips(id ?? "", files ?? [], signal),
    enabled: id !== null && files !== undefined,
    staleTime: Infinity,
  });
  const forget = () => {
    forgetUpload(purpose);
    setId(null);
    setSending(null);
    send.reset();
    replaced.reset();
    left.reset();
  };
  const send = useMutation<undefined, Error, readonly File[]>({
    mutationFn: async (files) => {
      setSending({ sent: 0, of: files.length });
      const upload = id ?? (await beginUpload(fps)).id;
      localStorage.setItem(storageKey(purpose), upload);
      setId(upload);
      await sendFiles(upload, files, (sent) => setSending({ sent, of: files.length }));
    },
    onSettled: async () => {
      setSending(null);
      await queries.invalidateQueries({ queryKey: ["upload"] });
    },
  });
  const replaced = useMutation<Schemas["UploadProgress"], Error, { name: string; file: File }>({
    mutationFn: ({ name, file }) => replaceFile(id ?? "", name, file),
    onSuccess: async (progress) => {
      queries.setQueryData(["upload", id, "progress"], progress);
      queries.removeQueries({ queryKey: ["upload", id, "files"] });
      await queries.invalidateQueries({ queryKey: ["upload", id, "progress"] });
    },
  });
  const left = useMutation<Schemas["UploadProgress"], Error, { file: string; left_out: boolean }>({
    mutationFn: (body) => unwrap(api.PUT("/api/admin/uploads/{upload}/left-out", { ...path, body })),
    onSuccess: async (progress) => {
      queries.setQueryData(["upload", id, "progress"], progress);
      await queries.invalidateQueries({ queryKey: ["upload", id, "files"] });
    },
  });
  const ask = useMutation<Schemas["UploadProgress"], Error, number | null>({
    mutationFn: (asked) => unwrap(api.PUT("/api/admin/uploads/{upload}/frame-rate", { ...path, body: { fps: asked } })),
    onSuccess: () => queries.invalidateQueries({ queryKey: ["upload"] }),
  });
  // An upload that the server has deleted, or that is somebody else's, is none.
  const gone = progress.error !== null;
  return {
    sending,
    broken: send.error,
    goOn: () => send.variables !== undefined && send.mutate(send.variables),
    progress: id === null || gone ? null : (progress.data ?? null),
    received: settled && !gone && received.data ? withTried(received.data, tried.data) : null,
    last: id === null || gone || !received.data ? null : withTried(received.data, tried.data),
    plays: playsOf(tried),
    remarks: tried.data?.remarks ?? [],
    fps: received.data?.fps ?? fps,
    askFps: (asked) => {
      setFps(asked);
      if (id !== null && !gone) ask.mutate(asked);
    },
    send: (files) => {
      if (gone) forget();
      send.mutate(files);
    },
    replace: (name, file) => replaced.mutate({ name, file }),
    notReplaced: replaced.error,
    isReplacing: replaced.isPending,
    leaveOut: (file, left_out) => left.mutate({ file, left_out }),
    notLeftOut: left.error,
    forget,
  };
}
