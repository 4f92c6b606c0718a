/** Whether the page had the participant's window all the time. */

export interface Watch {
  stop: () => number;
}

/** From now until `stop`, which tells how often the page was hidden or lost focus meanwhile. */
export function watchFocus(): Watch {
  let lost = document.hidden ? 1 : 0;
  const losing = (): void => void (lost += 1);
  const hiding = (): void => void (lost += document.hidden ? 1 : 0);
  window.addEventListener("blur", losing);
  document.addEventListener("visibilitychange", hiding);
  return {
    stop: () => {
      window.removeEventListener("blur", losing);
      document.removeEventListener("visibilitychange", hiding);
      return lost;
    },
  };
}
