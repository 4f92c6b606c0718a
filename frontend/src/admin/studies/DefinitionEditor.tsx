/** TOML with its problems, checked while typing, and what it expands to. */

import { useDebouncedValue } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, type Schemas, unwrap } from "../api";
import { Design } from "./Design";
import { TomlText } from "./TomlText";

interface Props {
  toml: string;
  onChange: (toml: string) => void;
}

export function DefinitionEditor({ toml, onChange }: Props) {
  const checked = useCheck(toml);
  return (
    <>
      <TomlText toml={toml} onChange={onChange} problems={checked?.problems ?? []} />
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
