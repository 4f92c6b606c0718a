/** Full screen as the page or the browser's own key makes it. */

export function canFullScreen(): boolean {
  return document.fullscreenEnabled;
}

export function isFullScreen(): boolean {
  // F11 fills the screen without telling the page.
  return document.fullscreenElement !== null || window.innerHeight >= screen.height - 2;
}

/** True where the browser granted it. Must be called from a click or key. */
export async function enterFullScreen(): Promise<boolean> {
  try {
    await document.documentElement.requestFullscreen({ navigationUI: "hide" });
    return true;
  } catch {
    return false;
  }
}

export async function leaveFullScreen(): Promise<void> {
  if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
}
