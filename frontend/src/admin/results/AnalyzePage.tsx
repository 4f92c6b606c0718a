/** A table that you already have: drop it, confirm what the columns are, and read the result. Nothing is stored. */
import { Alert, Anchor, Button, Card, Code, CopyButton, FileInput, Group, NativeSelect, Stack, Table, Text, Title } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { useState } from "react";
import { Refused, api, type Schemas, unwrap } from "../api";
import { ErrorAlert } from "../ui/Answer";
import { DropZone } from "../ui/DropZone";
import { counted } from "../ui/format";

type Columns = Schemas["OwnColumns"];
type Result = Schemas["OwnResult"];

const ANALYSES: Record<string, string> = {
  anova: "ANOVA of participants' means",
  mixed: "Linear mixed model (participants and clips)",
  ordinal: "Ordinal mixed model (ratings as ordered categories)",
  ranks: "Rank tests (Friedman, Kruskal-Wallis)",
  "t-test": "Welch's t tests of groups",
  opinion: "Mean opinion scores (ITU-T P.910)",
  agreement: "Agreement between raters",
  pairs: "Paired comparisons (Bradley-Terry)",
  thresholds: "Thresholds (psychometric functions)",
};

const ROLES: Record<string, string> = {
  participant: "Participant",
  rating: "Rating",
  within: "Factor within participants",
  between: "Factor between participants",
  covariate: "Covariate",
  item: "Clip or item",
  left: "Item on the left (or first)",
  right: "Item on the right (or second)",
  winner: "Winner",
  x: "Stimulus level",
  response: "Answer (yes or no, correct or wrong)",
  by: "Condition or content",
};

const MAX_BYTES = 12 * 1024 * 1024;

interface Chosen {
  name: string;
  content: string;
}

async function readFile(file: File): Promise<Chosen> {
  if (file.size > MAX_BYTES) {
    throw new Error(
      `${file.name} has ${Math.ceil(file.size / 1024 / 1024)} MB; expected at most 12 MB. Use the command analysis for larger tables.`,
    );
  }
  const bytes = new Uint8Array(await file.arrayBuffer());
  // In pieces: a call with millions of arguments fails.
  let text = "";
  for (let at = 0; at < bytes.length; at += 32_768) text += String.fromCharCode(...bytes.subarray(at, at + 32_768));
  return { name: file.name, content: btoa(text) };
}

/** A refusal speaks of the command's options, which this page shows as roles. */
function withRoleNames(error: Error): Error {
  const said = error.message.replaceAll(/--([a-z]+)\b/gu, (option, role: string) => (role in ROLES ? `“${ROLES[role]}”` : option));
  const whole = said.includes("--") ? `${said}. Options with -- belong to the command analysis` : said;
  return error instanceof Refused ? new Refused(error.status, error.code, whole) : new Error(whole);
}

export function AnalyzePage() {
  const [command, setCommand] = useState("");
  const [roles, setRoles] = useState<Record<string, string>>({});
  const analysis = useMutation({
    mutationFn: ({ name, content, columns }: Chosen & { columns: Columns }) => {
      const { needed = [], optional = [] } = columns.commands[command] ?? {};
      // Roles of another analysis stay in mind for when it is chosen again.
      const taken = Object.fromEntries(Object.entries(roles).filter(([, role]) => [...needed, ...optional].includes(role)));
      return unwrap(api.POST("/api/admin/analyses", { body: { name, content, command, roles: taken } }));
    },
  });
  const table = useMutation({
    mutationFn: async (file: File) => {
      analysis.reset();
      const chosen = await readFile(file);
      const columns = await unwrap(api.POST("/api/admin/analyses/columns", { body: chosen }));
      return { ...chosen, columns };
    },
    onSuccess: ({ columns }) => {
      setCommand(columns.command === "" ? "anova" : columns.command);
      setRoles(Object.fromEntries(columns.columns.flatMap(({ name, role }) => (role === "" ? [] : [[name, role]]))));
    },
  });
  // A result belongs to the roles that it was computed with.
  const changing =
    <T,>(change: (to: T) => void) =>
    (to: T) => {
      analysis.reset();
      change(to);
    };
  const missing = (table.data?.columns.commands[command]?.needed ?? []).filter((role) => !Object.values(roles).includes(role));
  return (
    <Stack maw={1100}>
      <Title order={1}>Analyze a table</Title>
      <Text maw={720}>
        For ratings, comparisons or answers that you already have: one row per trial. The table is analyzed on this server and deleted
        afterwards.
      </Text>
      <DropZone onDrop={(files) => files[0] !== undefined && table.mutate(files[0])}>
        <FileInput
          label="Table"
          description="CSV, Excel, SPSS or JSON, at most 12 MB. Choose a file, or drop it here."
          placeholder="Choose a file"
          accept=".csv,.tsv,.txt,.xlsx,.sav,.json"
          onChange={(file) => file !== null && table.mutate(file)}
        />
      </DropZone>
      {table.isPending && <Text role="status">Reading the table…</Text>}
      {table.error !== null && <ErrorAlert error={table.error} />}
      {table.data !== undefined && (
        <>
          <ColumnRoles
            columns={table.data.columns}
            missing={missing}
            command={command}
            setCommand={changing(setCommand)}
            roles={roles}
            setRoles={changing(setRoles)}
          />
          <Group>
            <Button loading={analysis.isPending} disabled={missing.length > 0} onClick={() => analysis.mutate(table.data)}>
              Analyze
            </Button>
            {analysis.isPending && <Text role="status">This takes seconds, a mixed model up to a minute.</Text>}
          </Group>
          {analysis.error !== null && <ErrorAlert error={withRoleNames(analysis.error)} />}
          {analysis.data !== undefined && <ResultOf result={analysis.data} />}
        </>
      )}
    </Stack>
  );
}

interface RolesProps {
  columns: Columns;
  /** Roles that the analysis needs and no column has. */
  missing: string[];
  command: string;
  setCommand: (command: string) => void;
  roles: Record<string, string>;
  setRoles: (roles: Record<string, string>) => void;
}

function ColumnRoles({ columns, missing, command, setCommand, roles, setRoles }: RolesProps) {
  const [all, setAll] = useState(false);
  const { needed = [], optional = [] } = columns.commands[command] ?? {};
  const possible = [...needed, ...optional];
  const likely = columns.columns.filter(({ name, role }) => role !== "" || roles[name] || columns.columns.length <= 12);
  const shown = all || likely.length === 0 ? columns.columns : likely;
  return (
    <Card withBorder>
      <Title order={2} size="h4">
        Is this right?
      </Title>
      <Text size="sm" mb="sm">
        {counted(columns.n_rows, "row")}, {counted(columns.columns.length, "column")}. The roles are guesses from names and values.
      </Text>
      {columns.decisions.map((decision) => (
        <Text key={decision} size="sm">
          {decision}
        </Text>
      ))}
      <NativeSelect
        label="Analysis"
        value={command}
        onChange={(event) => setCommand(event.currentTarget.value)}
        data={Object.keys(columns.commands).map((value) => ({ value, label: ANALYSES[value] ?? value }))}
        maw={420}
        mb="sm"
      />
      <div className="scroll-x" tabIndex={0} role="group" aria-label="Columns">
        <Table verticalSpacing={4}>
          <Table.Thead>
            <Table.Tr>
              <Table.Th>Column</Table.Th>
              <Table.Th>Values</Table.Th>
              <Table.Th>Role</Table.Th>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {shown.map((column) => (
              <Table.Tr key={column.name}>
                <Table.Td>{column.name}</Table.Td>
                <Table.Td>{valuesOf(column)}</Table.Td>
                <Table.Td>
                  <NativeSelect
                    size="xs"
                    miw="max-content"
                    aria-label={`Role of ${column.name}`}
                    value={possible.includes(roles[column.name] ?? "") ? roles[column.name] : ""}
                    onChange={(event) => setRoles({ ...roles, [column.name]: event.currentTarget.value })}
                    data={[{ value: "", label: "None" }, ...possible.map((value) => ({ value, label: ROLES[value] ?? value }))]}
                  />
                </Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </div>
      {shown.length < columns.columns.length && (
        <Button variant="subtle" size="compact-sm" mt="xs" onClick={() => setAll(true)}>
          Show the other {columns.columns.length - shown.length} columns
        </Button>
      )}
      {missing.length > 0 && (
        <Text size="sm" mt="xs">
          Choose a column for: {missing.map((role) => ROLES[role] ?? role).join(", ")}.
        </Text>
      )}
    </Card>
  );
}

function valuesOf({ is_number, n_values, values, n_missing }: Schemas["OwnColumn"]): string {
  const missing = n_missing > 0 ? `, ${n_missing.toLocaleString("en")} missing` : "";
  if (n_values === 0) return "empty";
  if (is_number && n_values > values.length) return `${n_values.toLocaleString("en")} numbers, ${values.join(" to ")}${missing}`;
  const more = n_values > values.length ? `, … (${n_values.toLocaleString("en")})` : "";
  return `${values.join(", ")}${more}${missing}`;
}

function ResultOf({ result }: { result: Result }) {
  const [first, ...rest] = result.tables;
  return (
    <Stack>
      {result.synthetic && (
        <Alert color="yellow" title="Synthetic data">
          No person gave these answers. Nothing here is a finding about people.
        </Alert>
      )}
      <Card withBorder>
        <Title order={2} size="h4" mb="xs">
          Result
        </Title>
        {result.sentences.map((sentence) => (
          <Text key={sentence} mb="xs">
            {sentence}
          </Text>
        ))}
        {result.decisions.map((decision) => (
          <Text key={decision} size="sm" c="dimmed">
            {decision}
          </Text>
        ))}
      </Card>
      {result.figures.map((figure) => (
        <Figure key={figure.key} figure={figure} />
      ))}
      {first !== undefined && <ResultTable table={first} />}
      {rest.map((table) => (
        <details key={table.title} open={!table.folded && rest.length <= 3}>
          <summary>{table.title}</summary>
          <ResultTable table={table} />
        </details>
      ))}
      <Card withBorder>
        <Title order={2} size="h4" mb="xs">
          The same on your computer
        </Title>
        <Code block tabIndex={0} aria-label="Command">
          {result.command_line}
        </Code>
        <CopyButton value={result.command_line}>
          {({ copied, copy }) => (
            <Button mt="xs" size="xs" variant="default" onClick={copy} style={{ alignSelf: "flex-start" }}>
              {copied ? "Copied" : "Copy the command"}
            </Button>
          )}
        </CopyButton>
      </Card>
    </Stack>
  );
}

function Figure({ figure: { key, caption, alt, svg, png } }: { figure: Result["figures"][number] }) {
  const files: [kind: string, address: string][] = [
    ["svg", `data:image/svg+xml;base64,${svg}`],
    ["png", `data:image/png;base64,${png}`],
  ];
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="xs">
        {caption}
      </Title>
      {/* White in both color schemes, as figures of a report are. */}
      <img src={files[0]?.[1]} alt={alt} style={{ background: "white", maxWidth: 720, width: "100%" }} />
      <Group mt="xs">
        {files.map(([kind, address]) => (
          <Anchor key={kind} href={address} download={`${key}.${kind}`} size="sm">
            {kind.toUpperCase()}
          </Anchor>
        ))}
      </Group>
    </Card>
  );
}

function ResultTable({ table }: { table: Result["tables"][number] }) {
  const csv = [table.header, ...table.rows].map((row) => row.map((cell) => `"${cell.replaceAll('"', '""')}"`).join(",")).join("\r\n");
  return (
    <Card withBorder>
      <Title order={3} size="h5" mb="xs">
        {table.title}
      </Title>
      <div className="scroll-x" tabIndex={0} role="group" aria-label={table.title}>
        <Table verticalSpacing={4}>
          <Table.Thead>
            <Table.Tr>
              {table.header.map((name, at) => (
                <Table.Th key={at} className={at >= table.text_columns ? "number" : ""}>
                  {name}
                </Table.Th>
              ))}
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {table.rows.map((row, number) => (
              <Table.Tr key={number}>
                {row.map((cell, at) => (
                  <Table.Td key={at} className={at >= table.text_columns ? "number" : ""}>
                    {cell}
                  </Table.Td>
                ))}
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </div>
      {table.notes.map((note) => (
        <Text key={note} size="sm" c="dimmed" mt={4}>
          {note}
        </Text>
      ))}
      <Anchor size="sm" mt="xs" href={`data:text/csv;charset=utf-8,${encodeURIComponent(csv)}`} download={`${table.key}.csv`}>
        CSV
      </Anchor>
    </Card>
  );
}
