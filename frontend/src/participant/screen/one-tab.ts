/** One tab at a time, by a Web Lock: a second one is told, and may take over. */

export type Claim = "held" | "elsewhere";

/** A browser that answers within this time has locks. */
const ANSWER_LIMIT_MS = 3_000;

/**
 * Claim the run. `onTaken` is called when another tab takes it away. Where the browser has no locks, refuses them (as with
 * blocked cookies) or does not answer, nothing is known of other tabs and the visit goes on: the server still keeps each
 * answer once.
 */
export function claimTab(name: string, take: boolean, onTaken: () => void, limit_ms = ANSWER_LIMIT_MS): Promise<Claim> {
  return new Promise((resolve) => {
    let has_lock = false;
    setTimeout(resolve, limit_ms, "held");
    // The lock lasts as long as this promise: until the page goes, or another tab steals it.
    const options: LockOptions = take ? { steal: true } : { ifAvailable: true };
    const hold = (lock: Lock | null): Promise<void> | void => {
      if (!lock) return resolve("elsewhere");
      has_lock = true;
      resolve("held");
      return new Promise<void>(() => {});
    };
    const failed = (): void => (has_lock ? onTaken() : resolve("held"));
    try {
      Promise.resolve(navigator.locks.request(name, options, hold)).catch(failed);
    } catch {
      failed();
    }
  });
}
