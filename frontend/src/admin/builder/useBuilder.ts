/** The builder's state: what is edited, its TOML as the server writes it, what is wrong with it. */

import { useQueryClient } from "@tanstack/react-query";
import { createContext, useContext, useEffect, useMemo, useState } from "react";
import { api, Refused, type Schemas, unwrap, sessionQuery } from "../api";
import { type Data, isTable, listAt, type Path, textAt } from "./data";
import { begun, edited, type History, latestToml, redone, rewritten, undone, written } from "./history";
import { DEFAULT_KIND } from "../kinds";
import { forgetWork, keepWork } from "./kept";

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
}

export function useBuilder({ summary, toml: stored, definition }: Schemas["StudyDetail"], start: Start): Builder {
  const { name: study, revision } = summary;
  const [history, setHistory] = useState<History>(() => begun(start.data, start.toml));
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
          setHistory((before) => rewritten(before, text, read, Date.now()));
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
  }, [asked, text, queries]);
  const present = text ?? toml;
  useEffect(() => {
    if (present === stored) forgetWork(study);
    else keepWork(study, { toml: present ?? base, data: present === null ? data : null, revision, base: stored });
  }, [present, base, data, stored, study, revision]);
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
    set: (path, value) => setHistory((before) => edited(before, path, value, Date.now(), definition)),
    setToml: setText,
    undo: history.past.length > 0 ? travel(undone) : null,
    redo: history.future.length > 0 ? travel(redone) : null,
    changed: present !== stored,
    reset: () => setText(stored),
  };
}

function languagesOf(data: Data): string[] {
  const codes = listAt(data, ["languages"]).filter((code) => typeof code === "string");
  return codes.length > 0 ? codes : ["en"];
}
