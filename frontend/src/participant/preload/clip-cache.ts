/** The clips of a block, fetched four at a time and kept in memory until their block is over. */
import { ClipUnavailable, fetchClip, type ClipSource } from "./fetch-clip";

const AT_ONCE = 4;

export interface Progress {
  done: number;
  total: number;
  failed: ClipUnavailable[];
}
type Fetch = (source: ClipSource, options: { signal?: AbortSignal }) => Promise<ArrayBuffer>;

export class ClipCache {
  private readonly bytes = new Map<string, ArrayBuffer>();
  private readonly without = new Set<string>();
  private readonly loading = new Map<string, Promise<void>>();

  constructor(private readonly fetchOne: Fetch = fetchClip) {}

  get(sha256: string): ArrayBuffer | undefined {
    return this.bytes.get(sha256);
  }

  /** True where none of these must be waited for. */
  hasAll(sources: ClipSource[]): boolean {
    return sources.every(({ clip_sha256 }) => this.bytes.has(clip_sha256) || this.without.has(clip_sha256));
  }

  /** Go on without a clip that cannot be had. */
  giveUp(sha256: string): void {
    this.without.add(sha256);
  }

  /** Fetch what is missing; resolves with the clips that could not be had, after all others are here. */
  async load(sources: ClipSource[], report: (progress: Progress) => void = () => {}, signal?: AbortSignal): Promise<ClipUnavailable[]> {
    const distinct = [...new Map(sources.map((source) => [source.clip_sha256, source])).values()];
    const queue = [...distinct];
    const failed: ClipUnavailable[] = [];
    let done = 0;
    report({ done, total: distinct.length, failed });
    const worker = async (): Promise<void> => {
      for (let next = queue.shift(); next; next = queue.shift()) {
        await this.one(next, signal).then(
          () => (done += 1),
          (error: unknown) => {
            if (!(error instanceof ClipUnavailable)) throw error;
            failed.push(error);
          },
        );
        report({ done, total: distinct.length, failed });
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, worker));
    return failed;
  }

  /** Forget every clip but these. */
  keepOnly(sources: ClipSource[]): void {
    const kept = new Set(sources.map((source) => source.clip_sha256));
    for (const sha256 of this.bytes.keys()) if (!kept.has(sha256)) this.bytes.delete(sha256);
  }

  private one(source: ClipSource, signal?: AbortSignal): Promise<void> {
    if (this.bytes.has(source.clip_sha256)) return Promise.resolve();
    const running = this.loading.get(source.clip_sha256);
    if (running) return running;
    const loading = this.fetchOne(source, signal ? { signal } : {})
      .then((bytes) => void this.bytes.set(source.clip_sha256, bytes))
      .finally(() => this.loading.delete(source.clip_sha256));
    this.loading.set(source.clip_sha256, loading);
    return loading;
  }
}
