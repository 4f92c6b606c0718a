/** One tab at a time, by a Web Lock: a second one is told, and may take over. */

export type Claim = "held" | "elsewhere";

/** Claim the run. `onTaken` is called when another tab takes it away. */
export function claimTab(name: string, take: boolean, onTaken: () => void): Promise<Claim> {
  return new Promise((resolve) => {
    // The lock lasts as long as this promise: until the page goes, or another tab steals it.
    const options: LockOptions = take ? { steal: true } : { ifAvailable: true };
    const held = navigator.locks.request(name, options, (lock) => {
      if (!lock) return resolve("elsewhere");
      resolve("held");
      return new Promise<void>(() => {});
    });
    held.catch(onTaken);
  });
}
