/** What differs between two versions, word by word. */

import { Badge, Card, Group, List, Select, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { counted } from "../ui/format";

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
                <code>{key.path}</code>
                <Badge variant="default" size="sm">
                  {key.effect === "measured" ? "changes what is measured" : "wording"}
                </Badge>
              </Group>
              <Text size="sm" className="difference">
                {key.pieces.map((piece, index) => (
                  <Words key={index} piece={piece} />
                ))}
              </Text>
            </div>
          ))}
          {compared.clips.length > 0 && <Clips comparison={compared} />}
        </Stack>
      )}
    </Answer>
  );
}

function verdict({ keys, clips_differing, pooled }: Schemas["Comparison"]): string {
  if (keys.length === 0 && clips_differing === 0) return "No differences.";
  return pooled
    ? "Both measure the same with the same clips. Their answers are pooled."
    : "They differ in what they measure or in their clips. Their answers are kept separate.";
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
