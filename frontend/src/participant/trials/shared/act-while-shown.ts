/** What a simulated person does on the page that is there now, again and again until it is gone. */
export function actWhileShown(display: HTMLElement, act: () => void): void {
  const own = display.firstElementChild;
  const timer = setInterval(() => (own?.isConnected ? act() : clearInterval(timer)), 250);
}
