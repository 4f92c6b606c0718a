/** What a simulated person does on a trial's page: from when it is there, again and again until it is gone. */
export function actWhileShown(display: HTMLElement, act: () => void): void {
  let own: Element | null = null;
  const timer = setInterval(() => {
    // A trial may wait before its page is shown, as for the server's choice of a stimulus.
    own ??= display.querySelector(".trial");
    if (own?.isConnected) act();
    else if (own) clearInterval(timer);
  }, 250);
}
