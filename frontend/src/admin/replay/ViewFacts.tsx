/** Verdict, views and events of a play, in words. */

import { Badge, Group, Stack, Table, Text, Title } from "@mantine/core";
import type { Schemas } from "../api";
import { words } from "../ui/format";
import { longestWords, missingWords } from "./facts";
import type { Play, PlayedBack, Scene } from "./shown";
import { type Mark, seconds } from "./Timeline";
import { ruleWords } from "../ui/play-words";
import { VERDICT_COLOURS } from "../ui/verdicts";

const ANSWER_COLOUR = "#2a9d74";
const EVENT_COLOUR = "#e8590c";

/** The answer and what happened around the views, on the time line; by the participant's clock. */
export function marksOf(play: Play, { answered_ms }: PlayedBack, events: readonly Schemas["ReplayedEvent"][]): Mark[] {
  const begun = play.views[0]?.started_at_client;
  const origin = begun ? Date.parse(begun) : null;
  const happened =
    origin === null ? [] : events.map(({ type, at_client }) => ({ at_ms: Date.parse(at_client) - origin, label: words(type) }));
  const marks: Mark[] = happened.filter(({ at_ms }) => at_ms >= 0).map((one) => ({ ...one, colour: EVENT_COLOUR }));
  if (answered_ms !== null) marks.push({ at_ms: answered_ms, label: "answer", colour: ANSWER_COLOUR });
  return marks.sort((one, other) => one.at_ms - other.at_ms);
}

export function ViewFacts({ play, played, events }: { play: Play; played: PlayedBack; events: readonly Mark[] }) {
  return (
    <Stack gap="xs">
      <Group gap="xs">
        {play.verdict !== null && (
          <Badge color={VERDICT_COLOURS[play.verdict] ?? "gray.7"}>
            {play.verdict}
            {play.verdict_rule !== "" && `: ${ruleWords(play.verdict_rule)}`}
          </Badge>
        )}
        {play.verdict === null && <Badge variant="default">no verdict: never answered</Badge>}
      </Group>
      {played.scenes.length > 0 && (
        <div className="scroll-x" tabIndex={0} role="region" aria-label="Views">
          <Table>
            <Table.Thead>
              <Table.Tr>
                <Table.Th>View</Table.Th>
                <Table.Th>Clip</Table.Th>
                <Table.Th>Never drawn</Table.Th>
                <Table.Th>Stood longest</Table.Th>
                <Table.Th>Disturbed by</Table.Th>
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>{played.scenes.flatMap((scene) => rowsOf(scene))}</Table.Tbody>
          </Table>
        </div>
      )}
      {played.scenes.some(({ view }) => view.from_answer) && (
        <Text size="sm" c="dimmed">
          This run is older than the ledger of views: what was shown is rebuilt from the answer’s own log.
        </Text>
      )}
      {events.length > 0 && (
        <>
          <Title order={3} size="h5">
            Events
          </Title>
          {events.map(({ at_ms, label }, index) => (
            <Text size="sm" key={index}>
              {seconds(at_ms)}: {label}
            </Text>
          ))}
        </>
      )}
    </Stack>
  );
}

function rowsOf({ view, lanes }: Scene) {
  const disturbed = Object.entries(view.disturbances).map(([name, count]) => `${words(name)}${count > 1 ? ` × ${count}` : ""}`);
  const outcome = view.outcome === null || view.outcome === "shown" ? "" : ` (${view.outcome})`;
  const head = `${view.number}${outcome}`;
  if (lanes.length === 0) {
    return (
      <Table.Tr key={view.number}>
        <Table.Td>{head}</Table.Td>
        <Table.Td colSpan={3}>no log: the page ended before the view did</Table.Td>
        <Table.Td>{disturbed.join(", ") || "nothing"}</Table.Td>
      </Table.Tr>
    );
  }
  return lanes.map((lane) => (
    <Table.Tr key={`${view.number} ${lane.role}`}>
      <Table.Td>{head}</Table.Td>
      <Table.Td>{lane.role === "shown" ? "clip" : lane.role}</Table.Td>
      <Table.Td>{missingWords(lane)}</Table.Td>
      <Table.Td>{longestWords(lane)}</Table.Td>
      <Table.Td>{disturbed.join(", ") || "nothing"}</Table.Td>
    </Table.Tr>
  ));
}
