/** A declaration's text, and its problems, each at its line. */

import { Alert, List, Textarea } from "@mantine/core";
import { useRef } from "react";
import type { Schemas } from "../api";

interface Props {
  toml: string;
  onChange: (toml: string) => void;
  problems: readonly Schemas["ProblemOut"][];
  rows?: number;
}

export function TomlText({ toml, onChange, problems, rows = 28 }: Props) {
  const area = useRef<HTMLTextAreaElement>(null);
  const goTo = (line: number) => {
    const start =
      toml
        .split("\n")
        .slice(0, line - 1)
        .join("\n").length + (line > 1 ? 1 : 0);
    const end = toml.indexOf("\n", start);
    area.current?.focus();
    area.current?.setSelectionRange(start, end === -1 ? toml.length : end);
  };
  return (
    <div>
      <Textarea
        ref={area}
        className="editor"
        aria-label="Definition"
        autosize
        minRows={12}
        maxRows={rows}
        spellCheck={false}
        value={toml}
        onChange={(event) => onChange(event.currentTarget.value)}
      />
      {problems.length > 0 && (
        <Alert color="red" variant="light" title="Not usable yet" my="sm" role="status">
          <List size="sm">
            {problems.map((problem) => (
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
    </div>
  );
}
