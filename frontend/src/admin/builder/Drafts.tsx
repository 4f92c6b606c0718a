/** Unsaved work on the server: sent while somebody edits, offered in another browser; and who else has the builder open. */

import { Button, Group, List, Text } from "@mantine/core";
import { useDebouncedCallback } from "@mantine/hooks";
import { type QueryClient, useQuery, useQueryClient } from "@tanstack/react-query";
import { useEffect, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { ConfirmButton } from "../ui/ConfirmButton";
import { counted, plain, when } from "../ui/format";
import { isTable } from "./data";
import { changesBetween, placeInWords, placeName } from "./history";
import { type Draft, isUnsaved, keptFrom, otherWork, tab, tabOf } from "./kept";
import type { Builder } from "./useBuilder";

// This tab's work on its way to the server.

const SENT_AFTER_MS = 1_000;
/** Studies of which the server has this tab's work, or is about to. */
const onServer = new Set<string>();
/** Drafts that were opened in this tab, by study: deleted once the server has the work as this tab's. */
const opened = new Map<string, Set<string>>();

const path = (study: string, own = tab) => ({ params: { path: { study, tab: own } } });

async function discard(study: string, own = tab): Promise<void> {
  await unwrap(api.DELETE("/api/admin/studies/{study}/drafts/{tab}", path(study, own)));
}

/** Sends this tab's work a moment after each change, and has it forgotten once it is saved or discarded. */
export function SentDraft({ detail, builder }: { detail: Schemas["StudyDetail"]; builder: Builder }) {
  const { name, revision } = detail.summary;
  const [state, setState] = useState<"" | "sent" | "failed">("");
  const { changed, toml, writing, data, places, moved, broken } = builder;
  const isWhole = !writing || broken;
  const send = useDebouncedCallback(async () => {
    try {
      if (changed) {
        const work = { toml, data: isWhole ? null : data, revision, base: detail.toml };
        const clips = moved && places !== null ? places.map((clip) => ({ ...clip })) : null;
        await unwrap(api.PUT("/api/admin/studies/{study}/drafts/{tab}", { ...path(name), body: { ...work, places: clips } }));
        for (const draft of opened.get(name) ?? []) {
          await discard(name, draft);
          opened.get(name)?.delete(draft);
        }
      } else if (onServer.delete(name)) await discard(name);
      setState(changed ? "sent" : "");
    } catch {
      // The browser has the work; the next change tries again.
      setState("failed");
    }
  }, SENT_AFTER_MS);
  useEffect(() => {
    if (changed) onServer.add(name);
    send();
  }, [name, send, changed, toml, isWhole, data, places, moved]);
  if (!changed) return null;
  return state === "sent" ? " A draft is on the server, too." : state === "failed" ? " The server has no draft yet." : null;
}

// What other tabs and browsers left.

interface OfferProps {
  detail: Schemas["StudyDetail"];
  /** Open it in this tab, which keeps it from then on; false where somebody thinks better of it. */
  onOpen: (draft: Draft) => boolean;
}

const draftsQuery = (study: string) => ({
  queryKey: ["drafts", study],
  queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/drafts", { params: { path: { study } } })),
});

/** Deletes what the server has of a tab, so that it is not offered again. */
export async function discardDraft(queries: QueryClient, study: string, own: string): Promise<void> {
  await discard(study, own);
  await queries.invalidateQueries({ queryKey: draftsQuery(study).queryKey });
}

/** Drafts of this person on the server that this browser does not have itself. */
export function OfferedDrafts({ detail, onOpen }: OfferProps) {
  const { name } = detail.summary;
  const queries = useQueryClient();
  const stored = useQuery({ ...draftsQuery(name), staleTime: Infinity, gcTime: 0 }).data ?? [];
  const here = new Set([tab, ...otherWork(name).map(tabOf), ...(opened.get(name) ?? [])]);
  const offered = stored.flatMap((draft): Draft[] => {
    const work = keptFrom({ ...draft.work, at: draft.at });
    return work === null || !isUnsaved(work, detail.toml) || here.has(draft.tab) ? [] : [{ ...work, key: draft.tab }];
  });
  const open = (draft: Draft) => {
    if (onOpen(draft)) opened.set(name, new Set([...(opened.get(name) ?? []), draft.key]));
  };
  return offered.map((draft) => (
    <UnsavedWork
      key={draft.key}
      detail={detail}
      draft={draft}
      words={`Your unsaved work from ${when(draft.at)}, in another browser, is on the server.`}
      actions={["Open the draft", "Discard the draft", "Discard"]}
      onOpen={() => open(draft)}
      onDiscard={() => void discardDraft(queries, name, draft.key)}
    />
  ));
}

interface UnsavedProps {
  detail: Schemas["StudyDetail"];
  draft: Draft;
  words: string;
  /** Labels of the buttons that open it, ask to discard it, and discard it. */
  actions: [string, string, string];
  onOpen: () => void;
  onDiscard: () => void;
}

/** Work of another tab or browser: what it would change, to be opened or discarded. */
export function UnsavedWork({ detail, draft, words, actions: [open, label, confirm], onOpen, onDiscard }: UnsavedProps) {
  return (
    <Group gap="xs" align="start" role="status">
      <span>{words}</span>
      <Button size="compact-xs" variant="default" onClick={onOpen}>
        {open}
      </Button>
      <ConfirmButton
        size="compact-xs"
        label={label}
        question={`The unsaved work from ${when(draft.at)} is deleted permanently.`}
        confirm={confirm}
        onConfirm={onDiscard}
      />
      <Difference detail={detail} draft={draft} />
    </Group>
  );
}

const MAX_CHANGES = 20;
const MAX_WORDS = 120;

function shortly(value: unknown): string {
  const text = value === undefined ? "nothing" : plain(value);
  return text.length > MAX_WORDS ? `${text.slice(0, MAX_WORDS)} …` : text;
}

/** What a draft changes in the study as it is now. */
function Difference({ detail, draft }: { detail: Schemas["StudyDetail"]; draft: Draft }) {
  const changes = useQuery({
    queryKey: ["draft difference", detail.toml, draft.toml, draft.data],
    queryFn: async () => {
      const [mine, stored] = await Promise.all(
        [draft, { toml: detail.toml, data: null }].map(({ toml, data }) =>
          unwrap(api.POST("/api/admin/definitions/edit", { body: { toml, data } })),
        ),
      );
      return isTable(mine?.data) ? changesBetween(stored?.data, mine.data) : null;
    },
    staleTime: Infinity,
  }).data;
  if (changes === undefined) return null;
  if (changes === null) return <Text size="sm">Its text is not valid TOML at the moment.</Text>;
  const moves = draft.places === null ? "" : ", and clips in other cells";
  return (
    <details>
      <summary className="small-summary">{`Show what it changes (${counted(changes.length, "field")}${moves})`}</summary>
      <List size="sm">
        {changes.slice(0, MAX_CHANGES).map((change) => (
          <List.Item key={placeName(change.at)} className="wrap-anywhere">
            {`${placeInWords(change.at)}: ${shortly(change.before)} becomes ${shortly(change.after)}`}
          </List.Item>
        ))}
      </List>
      {changes.length > MAX_CHANGES && <Text size="sm">{`And ${String(changes.length - MAX_CHANGES)} more.`}</Text>}
    </details>
  );
}

// Who else has the builder open.

const HEARTBEAT_MS = 15_000;

export function OtherEditors({ study }: { study: string }) {
  const editors = useQuery({
    queryKey: ["editors", study],
    queryFn: () => unwrap(api.POST("/api/admin/studies/{study}/editors/{tab}", path(study))),
    refetchInterval: HEARTBEAT_MS,
    gcTime: 0,
  }).data;
  if (editors === undefined || editors.length === 0) return null;
  const words = editors.map(
    ({ name, own, edits }) => `${own ? "you, in another tab or browser" : name}${edits ? " (unsaved changes)" : ""}`,
  );
  return (
    <Text size="sm" role="status">
      {`Also has this page open: ${words.join("; ")}. When you save, both edits are kept; where you both changed a field or moved a clip, you choose.`}
    </Text>
  );
}
