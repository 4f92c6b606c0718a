/** Files on their way to the server: in small requests, so that a broken line costs little and goes on where it broke. */

import { api, Refused, type Schemas, unwrap } from "../api";

const MAX_BATCH = { files: 40, bytes: 16 * 1024 * 1024 };
const WAITS_MS = [1000, 2000, 4000, 8000, 15_000];

/** A name in the form in which the server keeps it. */
const formOf = (name: string) => name.normalize("NFC");

/** Files in requests of limited size, in order; a file above the limit is a request of its own. */
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

export async function beginUpload(fps: number | null): Promise<Schemas["UploadOut"]> {
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

/** Send what the upload does not hold yet; `onSent` is told how many files are there. LeftOut where it refuses some. */
export async function sendFiles(id: string, files: readonly File[], onSent: (count: number) => void): Promise<void> {
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
export async function replaceFile(id: string, name: string, file: File): Promise<Schemas["UploadProgress"]> {
  return persistently(() => unwrap(api.POST("/api/admin/uploads/{upload}/files", filesFor(id, [file], name))));
}
