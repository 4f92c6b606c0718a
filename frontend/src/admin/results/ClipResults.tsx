/** Every clip with its answers; the chosen one plays beside them. */

import { Card, Group, ScrollArea, Stack, Table, Text, Title, UnstyledButton } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import type { Schemas } from "../api";
import { clipsQuery } from "../queries";
import { ClipCard } from "../studies/ClipsTab";
import { fixed } from "../ui/format";

export function ClipResults({ study, data }: { study: string; data: Schemas["Results"] }) {
  const clips = useQuery(clipsQuery(study));
  const [chosen, setChosen] = useState<Schemas["ClipResult"] | null>(data.clips[0] ?? null);
  const shown = clips.data?.find((clip) => clip.clip_sha256 === chosen?.clip_sha256 && clip.cell === chosen.cell);
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Each clip
      </Title>
      <Group align="start" wrap="wrap">
        <ScrollArea h={380} flex="1 1 420px" viewportProps={{ tabIndex: 0, "aria-label": "Clips" }}>
          <Table stickyHeader>
            <Table.Thead>
              <Table.Tr>
                <Table.Th>Clip</Table.Th>
                <Table.Th>Ratings</Table.Th>
                <Table.Th>Mean</Table.Th>
                <Table.Th>Answers from {data.scale_minimum} to {data.scale_maximum}</Table.Th>
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>
              {data.clips.map((clip) => (
                <Table.Tr key={`${clip.cell}${String(clip.exemplar)}`} bg={clip === chosen ? "var(--mantine-color-default-hover)" : ""}>
                  <Table.Td>
                    <UnstyledButton onClick={() => setChosen(clip)} fz="sm" td="underline">
                      {clip.cell} {clip.exemplar}
                    </UnstyledButton>
                  </Table.Td>
                  <Table.Td className="number">{clip.ratings}</Table.Td>
                  <Table.Td className="number">{fixed(clip.mean)}</Table.Td>
                  <Table.Td className="number">{clip.counts.join("  ")}</Table.Td>
                </Table.Tr>
              ))}
            </Table.Tbody>
          </Table>
        </ScrollArea>
        <Stack flex="1 1 300px" maw={460}>
          {shown === undefined ? <Text c="dimmed">Choose a clip to see it.</Text> : <ClipCard clip={shown} />}
        </Stack>
      </Group>
    </Card>
  );
}
