/** Whether the page had the participant's window all the time. */

export interface Watch { stop: () => boolean }

/** From now until `stop`, which tells whether the page was hidden or lost focus meanwhile. */
export function watchFocus(): Watch {
  let lost = document.hidden;
  const losing = (): void => void (lost = true);
  const hiding = (): void => void (lost ||= document.hidden);
  window.addEventListener("blur", losing);
  document.addEventListener("visibilitychange", hiding);
  return {
    stop: () => {
      window.removeEventListener("blur", losing);
      document.removeEventListener("visibilitychange", hiding);
      return lost || document.hidden;
    },
  };
}
