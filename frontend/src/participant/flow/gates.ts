/** Can this browser, on this device, show the study? Reasons are message keys, worst first. */
import type { Gates } from "../../api/schema";
import type { MessageKey } from "../../i18n";
import { hasVideo, hasWebCodecs, playsH264 } from "../playback/worker-player";

// Decision 0173: Pages without a secure context are refused.
export interface GateFinding {
  reason: MessageKey;
  /** False where the participant may go on all the same. */
  closed: boolean;
  values: Record<string, number>;
}

export interface Abilities {
  secure: boolean;
  web_codecs: boolean;
  video: boolean;
  h264: boolean;
  storage: boolean;
  /** No mouse or keyboard to be seen: a phone or a tablet. */
  touch_only: boolean;
  screen_width_px: number;
  screen_height_px: number;
}

export async function abilities(storage: boolean): Promise<Abilities> {
  return {
    secure: window.isSecureContext && "subtle" in globalThis.crypto,
    web_codecs: hasWebCodecs(),
    video: hasVideo(),
    h264: hasVideo() && (await playsH264()),
    storage,
    touch_only: matchMedia("(pointer: coarse)").matches && !matchMedia("(any-pointer: fine)").matches,
    screen_width_px: Math.max(screen.width, window.innerWidth),
    screen_height_px: Math.max(screen.height, window.innerHeight),
  };
}

export function findings(device: Abilities, gates: Gates): GateFinding[] {
  const list: GateFinding[] = [];
  const add = (reason: MessageKey, closed: boolean, values = {}): void => void list.push({ reason, closed, values });
  if (!device.secure) add("gate_insecure", true);
  else if (!device.video) add("gate_browser", true);
  if (device.touch_only && !gates.allow_touch) add("gate_touch", true);
  if (tooSmall(device, gates)) {
    add("gate_screen", true, {
      width: gates.minimum_width_px,
      height: gates.minimum_height_px,
      have_width: device.screen_width_px,
      have_height: device.screen_height_px,
    });
  }
  if (device.secure && device.video && !device.web_codecs) add("gate_video", false);
  // A study's own clips may be VP9 or AV1, so the participant may try.
  if (device.secure && device.video && !device.h264) add("gate_h264", false);
  if (!device.storage) add("gate_storage", false);
  return list.sort((a, b) => Number(b.closed) - Number(a.closed));
}

/** What a window measures at this moment, all in CSS px. */
export interface Measures {
  inner: [number, number];
  outer: [number, number];
  screen: [number, number];
  /** The page can fill the screen, and the study wants it to. */
  full_screen: boolean;
}

export function measures(gates: Gates): Measures {
  return {
    inner: [window.innerWidth, window.innerHeight],
    outer: [window.outerWidth, window.outerHeight],
    screen: [screen.width, screen.height],
    full_screen: gates.full_screen && document.fullscreenEnabled,
  };
}

const ZOOMED = 1.1;

/** Why there is no room for the clips at this moment, by the window or by the page's zoom; null where there is. */
export function lackOfRoom(gates: Gates, now: Measures): GateFinding | null {
  // The frame of a window is a few pixels wide: a page twice as large shows half as many in the same window.
  const zoom = now.outer[0] > 0 ? Math.max(1, now.outer[0] / now.inner[0]) : 1;
  const zoomed = zoom > ZOOMED;
  // In full screen the page has all of the screen, in its own enlarged pixels.
  const [have_width, have_height] = now.full_screen ? now.screen.map((side) => Math.round(zoomed ? side / zoom : side)) : now.inner;
  const [width, height] = [gates.minimum_width_px, gates.minimum_height_px];
  const fits = (scale: number): boolean => (have_width ?? 0) * scale >= width && (have_height ?? 0) * scale >= height;
  if (fits(1)) return null;
  return {
    reason: zoomed && fits(zoom) ? "gate_zoom" : "window_small",
    closed: false,
    values: { width, height, have_width, have_height } as Values,
  };
}

type Values = GateFinding["values"];

function tooSmall(device: Abilities, gates: Gates): boolean {
  const long = Math.max(device.screen_width_px, device.screen_height_px);
  const short = Math.min(device.screen_width_px, device.screen_height_px);
  // A tablet held upright can be turned, so only the two sides count.
  return (
    long < Math.max(gates.minimum_width_px, gates.minimum_height_px) || short < Math.min(gates.minimum_width_px, gates.minimum_height_px)
  );
}
