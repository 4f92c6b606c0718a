/** The builder's state: what is edited, its TOML as the server writes it, what is wrong with it. */

import { useQuery, useQueryClient } from "@tanstack/react-query";
import { createContext, useContext, useEffect, useMemo, useState } from "react";
import { api, clipsQuery, Refused, type Schemas, unwrap, sessionQuery } from "../api";
import { type Data, isTable, listAt, type Path, textAt } from "./data";
import { begun, edited, type History, latestToml, rearranged, redone, rewritten, undone, written } from "./history";
import { DEFAULT_KIND } from "../kinds";
import { forgetWork, keepWork } from "./kept";
import { arrangementOf, isAsStored, type Place, reconciled, storedPlaces } from "./places";

type Problem = Schemas["ProblemOut"];

export interface Builder {
  data: Data;
  /** What is stored: names in it are those of answers. */
  saved: unknown;
  toml: string;
  /** The text does not say what the forms show yet: the server is writing it. */
  writing: boolean;
  /** The text, edited by hand, is not valid TOML: forms show the last valid one. */
  broken: boolean;
  problems: Problem[];
  design: Schemas["DesignOut"] | null;
  languages: string[];
  trialKind: string;
  error: Error | null;
  set: (path: Path, value: unknown) => void;
  /** Every clip with its cell; null for studies whose clips are rendered, and until they are loaded. */
  places: readonly Place[] | null;
  /** Whether clips are in other cells than stored. */
  moved: boolean;
  /** Names of places in cells that have no clip. */
  empty: string[];
  arrange: (places: readonly Place[], data?: Data) => void;
  setToml: (toml: string) => void;
  undo: (() => void) | null;
  redo: (() => void) | null;
  changed: boolean;
  reset: () => void;
}

const SETTLED_MS = 300;

export const BuilderContext = createContext<Builder | null>(null);

/** The builder that this page is part of. */
export function useBuilderHere(): Builder {
  const builder = useContext(BuilderContext);
  if (builder === null) throw new Error("expected a builder round this field, got none");
  return builder;
}

const edit = (body: Schemas["EditDefinition"]) => unwrap(api.POST("/api/admin/definitions/edit", { body }));

type Answered = Schemas["EditedDefinition"] & { asked: Schemas["EditDefinition"] };

interface Start {
  data: Data;
  toml: string;
  places: readonly Place[] | null;
  /** Whether somebody still has to choose between two places of clips: the work they began from is kept until then. */
  isUndecided: boolean;
}

export function useBuilder({ summary, toml: stored, definition, rendered }: Schemas["StudyDetail"], start: Start): Builder {
  const { name: study, revision } = summary;
  const [history, setHistory] = useState<History>(() => begun(start.data, start.toml, start.places));
  const clips = useQuery({ ...clipsQuery(study), enabled: !rendered }).data;
  const inCells = useMemo(() => (clips === undefined || rendered ? null : storedPlaces(clips)), [clips, rendered]);
  // Text that is being edited by hand; null where forms and text say the same.
  const [text, setText] = useState<string | null>(null);
  const [answer, setAnswer] = useState<Answered | null>(null);
  const [error, setError] = useState<Error | null>(null);
  const queries = useQueryClient();
  const { data, toml } = history.now;
  const base = latestToml(history);
  const asked = useMemo(
    () => (text !== null ? { toml: text, data: null } : toml === null ? { toml: base, data } : { toml, data: null }),
    [text, toml, base, data],
  );
  useEffect(() => {
    let over = false;
    const send = async () => {
      try {
        const said = await edit(asked);
        if (over) return;
        setError(null);
        setAnswer({ asked, ...said });
        const written_data = asked.data;
        if (written_data !== null) setHistory((before) => written(before, written_data, said.toml));
        else if (text !== null && isTable(said.data)) {
          const read = said.data;
          setHistory((before) => rewritten(before, text, read, Date.now(), inCells));
          setText(null);
        }
      } catch (refusal) {
        if (over) return;
        setError(refusal instanceof Error ? refusal : new Error(String(refusal)));
        // Where the session has ended, asking for it leads to the page to sign in; the work is kept meanwhile.
        if (refusal instanceof Refused && refusal.status === 401) await queries.invalidateQueries({ queryKey: sessionQuery.queryKey });
      }
    };
    const timer = setTimeout(() => void send(), SETTLED_MS);
    return () => {
      over = true;
      clearTimeout(timer);
    };
  }, [asked, text, queries, inCells]);
  const present = text ?? toml;
  const moves = useMemo(() => {
    const own = history.now.places;
    return own === null || (inCells !== null && isAsStored(own, inCells, data)) ? null : own;
  }, [history.now.places, inCells, data]);
  const isWaiting = start.isUndecided && text === null && history.past.length === 0;
  useEffect(() => {
    if (isWaiting) return;
    if (present === stored && moves === null) forgetWork(study);
    else keepWork(study, { toml: present ?? base, data: present === null ? data : null, revision, base: stored, places: moves });
  }, [present, base, data, stored, study, revision, moves, isWaiting]);
  const places = useMemo(() => placesNow(moves, inCells), [moves, inCells]);
  const empty = useMemo(() => {
    const filled = places === null ? [] : arrangementOf(places, data).filled;
    return filled.flatMap(({ slot, clip }) => (clip === null ? [slot.name] : []));
  }, [places, data]);
  const travel = (to: (history: History) => History) => () => {
    setText(null);
    setHistory(to);
  };
  return {
    data,
    saved: definition,
    toml: present ?? base,
    writing: present === null || answer?.toml !== present,
    broken: text !== null && answer?.asked.toml === text && answer.data === null,
    problems: answer?.problems ?? [],
    design: answer?.design ?? null,
    languages: languagesOf(data),
    trialKind: textAt(data, ["trial", "kind"]) || DEFAULT_KIND,
    error,
    set: (path, value) => setHistory((before) => edited(before, path, value, Date.now(), definition, inCells)),
    places,
    moved: moves !== null,
    empty,
    arrange: (next, withData) => setHistory((before) => rearranged(before, next, withData ?? before.now.data, Date.now())),
    setToml: setText,
    undo: history.past.length > 0 ? travel(undone) : null,
    redo: history.future.length > 0 ? travel(redone) : null,
    changed: present !== stored || moves !== null,
    reset: () => {
      if (moves !== null) setHistory((before) => rearranged(before, null, before.now.data, Date.now()));
      if (present !== stored) setText(stored);
    },
  };
}

/** Clips that were moved, with what the study has now; clips of an upload stay until it is saved. */
function placesNow(moves: readonly Place[] | null, inCells: readonly Place[] | null): readonly Place[] | null {
  if (moves === null || inCells === null) return inCells;
  return reconciled(moves, [...inCells, ...moves.filter(({ upload }) => upload !== null)]);
}

function languagesOf(data: Data): string[] {
  const codes = listAt(data, ["languages"]).filter((code) => typeof code === "string");
  return codes.length > 0 ? codes : ["en"];
}
