/** Lets a reload without a connection find the page: see service-worker.ts. */

export function serveOffline(): void {
  // Private windows and some settings have none: a reload then needs the server.
  if (!("serviceWorker" in navigator)) return;
  void navigator.serviceWorker.register("/service-worker.js", { scope: "/run/" }).catch(() => {});
}
