/** For parts of the browser that may be blocked in such a way that they never answer. */

class NoAnswerInTime extends Error {
  override name = "NoAnswerInTime";
}

/** What `work` gives, also where it throws at once; rejects where it does not settle in time. */
export function withinTime<Value>(work: () => Promise<Value>, limit_ms: number): Promise<Value> {
  return new Promise((resolve, reject) => {
    const limit = setTimeout(() => reject(new NoAnswerInTime(`the browser did not answer in ${limit_ms} ms`)), limit_ms);
    void (async () => work())()
      .then(resolve, reject)
      .finally(() => clearTimeout(limit));
  });
}
