/** TOML with its problems, each at its line, checked while typing. */

import { Alert, List, Textarea } from "@mantine/core";
import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { useRef } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Design } from "./Design";

interface Props {
  toml: string;
  onChange: (toml: string) => void;
}

export function DefinitionEditor({ toml, onChange }: Props) {
  const place = useRef<HTMLTextAreaElement>(null);
  const checked = useCheck(toml);
  const goTo = (line: number) => {
    const start =
      toml
        .split("\n")
        .slice(0, line - 1)
        .join("\n").length + (line > 1 ? 1 : 0);
    const end = toml.indexOf("\n", start);
    place.current?.focus();
    place.current?.setSelectionRange(start, end === -1 ? toml.length : end);
  };
  return (
    <>
      <Textarea
        ref={place}
        className="editor"
        aria-label="Definition"
        autosize
        minRows={12}
        maxRows={28}
        spellCheck={false}
        value={toml}
        onChange={(event) => onChange(event.currentTarget.value)}
      />
      {checked !== undefined && checked.problems.length > 0 && (
        <Alert color="red" variant="light" title="Not usable yet" my="sm" role="status">
          <List size="sm">
            {checked.problems.map((problem) => (
              <List.Item key={`${String(problem.line)}${problem.path}${problem.message}`}>
                {problem.line !== null && (
                  <button type="button" className="line-link" onClick={() => goTo(problem.line ?? 1)}>
                    Line {problem.line}
                  </button>
                )}{" "}
                {problem.path}: {problem.message}
              </List.Item>
            ))}
          </List>
        </Alert>
      )}
      {checked?.design !== null && checked?.design !== undefined && <Design design={checked.design} />}
    </>
  );
}

/** What the server says of a definition, half a second after the last key. */
export function useCheck(toml: string): Schemas["Checked"] | undefined {
  const [settled] = useDebouncedValue(toml, 500);
  const { data } = useQuery({
    queryKey: ["check", settled],
    queryFn: () => unwrap(api.POST("/api/admin/definitions/check", { body: { toml: settled } })),
    enabled: settled.trim() !== "",
    placeholderData: (before) => before,
  });
  return settled.trim() === "" ? undefined : data;
}
