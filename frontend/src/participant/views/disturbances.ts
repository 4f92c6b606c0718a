/** What disturbs a view, named as [playback.disturbances] names it; the server knows what each does to the play. */
import { watchFocus } from "../screen/window";

// Decision 0521: Disturbances of a view have a declared consequence.
export interface Disturbed {
  /** How often each disturbed; a name that is missing did not. */
  counts: Record<string, number>;
  focus_lost: number;
  /** Smallest share of the clip inside the window. */
  visible_share: number;
}

interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

const WHOLE_SHARE = 0.995;
const SAME_ZOOM = 0.001;
/** A refresh this much longer than before is another rate, not a hiccup. */
const DROPPED = 1.4;

/** Share of a box inside another, 0 to 1. */
export function visibleShare({ left, top, right, bottom }: Box, seen: Box): number {
  const area = (right - left) * (bottom - top);
  // An element without a size is not laid out: nothing of it can be cut off.
  if (area <= 0) return 1;
  const across = Math.max(0, Math.min(right, seen.right) - Math.max(left, seen.left));
  const down = Math.max(0, Math.min(bottom, seen.bottom) - Math.max(top, seen.top));
  return Math.min(1, (across * down) / area);
}

/** True where the screen refreshed at another, lower rate than was measured, at the run's start or on the screen that it moved to. */
export function refreshDropped(refresh_ms: number | null, expected_ms: number): boolean {
  return refresh_ms !== null && refresh_ms > expected_ms * DROPPED;
}

/** What is on the screen of the page, which is less than the window where fingers have zoomed in. */
function seenPart(): Box {
  const view = window.visualViewport;
  if (!view || view.scale <= 1) return { left: 0, top: 0, right: window.innerWidth, bottom: window.innerHeight };
  const { offsetLeft: left, offsetTop: top } = view;
  return { left, top, right: left + view.width, bottom: top + view.height };
}

/** The zoom, that of fingers included: they zoom without another layout, so the size is wrong also where they did so before the trial. */
const zoom = (): number => window.devicePixelRatio * (window.visualViewport?.scale ?? 1);
/** The same on a screen that is turned, another on most other screens. */
const sides = (): number => screen.width + screen.height;

/** The window for which the clip's place was laid out: what changes before the start key disturbs the view as well. */
export interface Layout {
  zoom: number;
  sides: number;
  fullscreenElement: Element | null;
}

export const layout = (): Layout => ({ zoom: window.devicePixelRatio, sides: sides(), fullscreenElement: document.fullscreenElement });

/** Watch the window around `clip` from now until `stop`. It listens only: asking at each refresh costs frames. */
export function watchDisturbances(clip: HTMLElement, before: Layout): { stop: () => Disturbed } {
  const counts: Record<string, number> = {};
  const own = new AbortController();
  const { signal } = own;
  const focus = watchFocus();
  let visible_share = 1;
  let small = false;
  let zoomed = false;
  const add = (name: string): void => void (counts[name] = (counts[name] ?? 0) + 1);
  const look = (): void => {
    const box = clip.getBoundingClientRect();
    // Rounded down: a box may have a fraction of a pixel more than the window, whose sides are whole.
    const is_small = window.innerWidth < Math.floor(box.width) || window.innerHeight < Math.floor(box.height);
    if (is_small && !small) add("window_too_small");
    small = is_small;
    const share = visibleShare(box, seenPart());
    if (share < WHOLE_SHARE && visible_share >= WHOLE_SHARE) add("clip_cut_off");
    visible_share = Math.min(visible_share, share);
    const is_zoomed = Math.abs(zoom() - before.zoom) > SAME_ZOOM || sides() !== before.sides;
    if (is_zoomed && !zoomed) add("zoomed");
    zoomed = is_zoomed;
    if (before.fullscreenElement && !document.fullscreenElement) add("full_screen_left");
    // Kept with the layout: a trial's later clips and plays do not count the same leaving again.
    before.fullscreenElement = document.fullscreenElement;
  };
  // The window may be too small from the start, without any event.
  look();
  window.addEventListener("resize", look, { signal });
  window.addEventListener("scroll", look, { signal, passive: true });
  window.visualViewport?.addEventListener("resize", look, { signal });
  window.visualViewport?.addEventListener("scroll", look, { signal });
  document.addEventListener("fullscreenchange", look, { signal });
  return {
    stop() {
      // Once more, as the event of a change may not have come yet.
      look();
      own.abort();
      const focus_lost = focus.stop();
      if (focus_lost > 0) counts["focus_lost"] = focus_lost;
      return { counts: { ...counts }, focus_lost, visible_share };
    },
  };
}
