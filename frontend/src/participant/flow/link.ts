/** From the link to a run: is it open, can this browser show it, and which visit is it? */
import type { LinkState, RunStarted } from "../../api/schema";
import { BUSY, call, NetworkError, Refused, isTemporary } from "../request";
import type { Translate, MessageKey } from "../../i18n";
import { backoff } from "../outbox/outbox";
import { type Back, showNotice } from "../screens/support";
import { filledIn } from "./identity";
import type { Kept, KeptVisit } from "./kept-visit";

/** What is known when the link has answered, or an earlier visit answers for it. */
export interface Entry {
  root: HTMLElement;
  t: Translate;
  link_token: string;
  link: LinkState;
  language: string;
  keeping: KeptVisit;
  kept: Kept | null;
}

/** Somebody who has begun need not wait long for a server that does not answer. */
const KEPT_WAIT_MS = 4_000;

/** Ask until the server answers, telling the participant meanwhile. Refusals are thrown. */
export async function persistently<Body>(root: HTMLElement, t: Translate, ask: () => Promise<Body>): Promise<Body> {
  for (let failures = 1; ; failures += 1) {
    try {
      return await ask();
    } catch (error) {
      if (!isNoAnswer(error)) throw error;
      const what = error instanceof Refused && error.code === BUSY ? "busy" : "no_answer";
      if (failures > 1) showNotice(root, { title: t(`${what}_title`), text: t(what) });
      await new Promise((resolve) => setTimeout(resolve, backoff(failures)));
    }
  }
}

/** True where asking again may help: no answer came, or the server is busy. */
export function isNoAnswer(error: unknown): boolean {
  return error instanceof NetworkError || (error instanceof Refused && isTemporary(error.status));
}

const fetchLink = (token: string, timeout_ms = 10_000): Promise<LinkState> =>
  call("GET", `/api/links/${encodeURIComponent(token)}`, { timeout_ms });

/** The way back to the recruiter for people who take no part. A visit that an earlier page has kept knows none. */
export function wayBack(t: Translate, { way_back }: Partial<Pick<LinkState, "way_back">>): Back {
  return way_back ? { label: t("done_return"), href: filledIn(way_back, location.search) } : null;
}

/** The link, or what an earlier visit kept of it and its run where the server does not answer. */
export async function reach(
  root: HTMLElement,
  t: Translate,
  link_token: string,
  kept: Kept | null,
): Promise<{ link: LinkState; kept: Kept | null }> {
  if (!kept) return { link: await persistently(root, t, () => fetchLink(link_token)), kept };
  try {
    return { link: await fetchLink(link_token, KEPT_WAIT_MS), kept: null };
  } catch (error) {
    if (!isNoAnswer(error)) throw error;
    return { link: kept.link, kept };
  }
}

// Taking up a visit by its resume code, where the browser and the link do not say whose it is.

/** What a start says in addition to what every start says. */
export type Claim = { resume_code: string } | { anew: true } | Record<string, never>;
export type Start = (claim: Claim) => Promise<RunStarted>;

const ASKED_FOR: Record<string, MessageKey> = {
  resume_code_needed: "code_needed",
  taken_part_already: "code_over",
  resume_code_wrong: "code_enter",
};
/** Why a code must be entered; null where the refusal is another. */
export function asksForCode(error: unknown): MessageKey | null {
  return error instanceof Refused ? (ASKED_FOR[error.code] ?? null) : null;
}
