/** Lets a reload without a connection find the page: see service-worker.ts. */

export function serveOffline(): void {
  // Private windows and some settings have none: a reload then needs the server.
  try {
    if (!("serviceWorker" in navigator)) return;
    void Promise.resolve(navigator.serviceWorker.register("/service-worker.js", { scope: "/run/" })).catch(() => {});
  } catch {
    // Denied with the cookies.
  }
}
