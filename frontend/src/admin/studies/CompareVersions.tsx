/** What differs between two versions: a sentence each, and its words where they are asked for. */

import { Anchor, Badge, Card, Group, List, Select, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { CopyId } from "../ui/CopyId";
import { DataTable } from "../ui/DataTable";
import { placeOf } from "../builder/data";
import { counted, when } from "../ui/format";

export function CompareVersions({ detail }: { detail: Schemas["StudyDetail"] }) {
  const study = detail.summary.name;
  const numbers = detail.versions.map((version) => String(version.number));
  const [old, setOld] = useState(numbers[1] ?? null);
  const [latest, setLatest] = useState(numbers[0] ?? null);
  if (numbers.length < 2) return null;
  const choose = (label: string, value: string | null, set: (value: string | null) => void) => (
    <Select label={label} data={numbers} value={value} allowDeselect={false} onChange={set} w={120} />
  );
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Compare versions
      </Title>
      <Group mb="sm">
        {choose("From version", old, setOld)}
        {choose("To version", latest, setLatest)}
      </Group>
      {old !== null && latest !== null && <Compared study={study} old={Number(old)} latest={Number(latest)} />}
    </Card>
  );
}

function Compared({ study, old, latest }: { study: string; old: number; latest: number }) {
  const query = { old, new: latest };
  const comparison = useQuery({
    queryKey: ["study", study, "comparison", old, latest],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/comparison", { params: { path: { study }, query } })),
  });
  return (
    <Answer of={comparison}>
      {(compared) => (
        <Stack gap="sm">
          <Text size="sm">{verdict(compared)}</Text>
          {compared.keys.map((key) => (
            <div key={key.path}>
              <Group gap="xs">
                <Text size="sm">{sentenceOf(key)}</Text>
                <Badge variant="default" size="sm">
                  {key.effect === "measured" ? "changes what is measured" : "wording"}
                </Badge>
              </Group>
              <details>
                <summary className="small-summary">
                  Word by word: <code>{key.path}</code>
                </summary>
                <Text size="sm" className="difference">
                  {key.pieces.map((piece, index) => (
                    <Words key={index} piece={piece} />
                  ))}
                </Text>
              </details>
            </div>
          ))}
          {compared.clips.length > 0 && <Clips comparison={compared} />}
        </Stack>
      )}
    </Answer>
  );
}

function verdict({ keys, clips_differing, pooled }: Schemas["Comparison"]): string {
  if (keys.length === 0 && clips_differing === 0)
    return pooled ? "No differences." : "Only the sizes of clips differ. Their answers are kept separate.";
  return pooled
    ? "Both measure the same thing with the same clips. Their answers are pooled."
    : "They differ in what they measure or in their clips. Their answers are kept separate.";
}

const MAX_VALUE = 60;

/** "Changed “Minimum” of the question age of the questionnaire about from 18 to 16." */
export function sentenceOf({ path, pieces }: Pick<Schemas["KeyDifference"], "path" | "pieces">): string {
  const text = (left: Schemas["Piece"]["kind"]) => pieces.flatMap((piece) => (piece.kind === left ? [] : [piece.text])).join("");
  const [before, after] = [text("new").trim(), text("gone").trim()];
  const what = placeOf(path.split("."));
  if (before === "") return `Added ${what}.`;
  if (after === "") return `Removed ${what}.`;
  const isShort = [before, after].every((value) => value.length <= MAX_VALUE && !/[{\n]/.test(value));
  return `Changed ${what}${isShort ? ` from ${before} to ${after}` : ""}.`;
}

function Words({ piece: { kind, text } }: { piece: Schemas["Piece"] }) {
  if (kind === "gone") return <del>{text}</del>;
  if (kind === "new") return <ins>{text}</ins>;
  return <span>{text}</span>;
}

const CLIP_WORDS: Record<Schemas["ClipDifference"]["kind"], string> = { gone: "gone", new: "new", replaced: "has different bytes" };

function Clips({ comparison }: { comparison: Schemas["Comparison"] }) {
  return (
    <div>
      <Text size="sm" fw={600}>
        Differing: {counted(comparison.clips_differing, "clip")}; the same: {comparison.clips_same}
      </Text>
      <List size="sm">
        {comparison.clips.map((clip) => (
          <List.Item key={`${clip.cell} ${String(clip.exemplar)}`} className="wrap-anywhere">
            {clip.cell}, no. {clip.exemplar}: {CLIP_WORDS[clip.kind]} ({files(clip)})
          </List.Item>
        ))}
      </List>
      {comparison.clips.length < comparison.clips_differing && (
        <Text size="sm">… and {comparison.clips_differing - comparison.clips.length} more.</Text>
      )}
    </div>
  );
}

function files({ old_file, new_file }: Schemas["ClipDifference"]): string {
  return [...new Set([old_file, new_file])].filter((file) => file != null).join(" → ");
}

// Every version, with its text.

type Version = Schemas["StudyDetail"]["versions"][number];

export function Versions({ detail }: { detail: Schemas["StudyDetail"] }) {
  const address = (version: Version) => `/api/admin/studies/${detail.summary.name}/versions/${version.number}`;
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Versions
      </Title>
      <DataTable
        rows={detail.versions}
        rowKey={(version) => version.number}
        empty="No versions yet."
        columns={[
          {
            title: "Version",
            number: true,
            cell: (version) => (
              <Anchor href={address(version)} target="_blank" rel="noopener">
                {version.number}
              </Anchor>
            ),
          },
          { title: "Made", cell: (version) => when(version.created_at) },
          { title: "Runs", number: true, cell: (version) => version.runs },
          { title: "Note", wrap: true, cell: (version) => version.note },
          { title: "SHA-256", wide: true, cell: (version) => <CopyId value={version.definition_sha256} what="SHA-256" /> },
        ]}
      />
    </Card>
  );
}
