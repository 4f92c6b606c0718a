/** A view's frames along time, and its facts in words. */

import { Group, Text, Badge, Stack, Table, Title } from "@mantine/core";
import { memo, type PointerEvent } from "react";
import { type Folding, type Lane, type PlayedBack, type ShownFrame, longestWords, missingWords, type Play, type Scene } from "./shown";
import type { Schemas } from "../api";
import { words, ruleWords, VERDICT_COLOURS } from "../ui/format";

// The time line of a play: a row for each clip with every frame as long as it stood, the answer, and events.

interface Mark {
  at_ms: number;
  label: string;
  colour: string;
}

interface Props {
  played: PlayedBack;
  time: Folding;
  marks: readonly Mark[];
  /** The slider of a continuous rating: (time in ms, 0 to 1). */
  trace: readonly (readonly [number, number])[];
  at_ms: number;
  onSeek: (at_ms: number) => void;
}

const WIDTH = 1_000;
const HEIGHT = 26;
const TICKS = 5;

export function Timeline({ played, time, marks, trace, at_ms, onSeek }: Props) {
  const seek = (event: PointerEvent<HTMLDivElement>): void => {
    if (event.type === "pointermove" && event.buttons !== 1) return;
    const { left, width } = event.currentTarget.getBoundingClientRect();
    onSeek(time.unfold((time.length_ms * (event.clientX - left)) / Math.max(1, width)));
  };
  return (
    <div className="replay-line" onPointerDown={seek} onPointerMove={seek}>
      <Rows played={played} time={time} marks={marks} trace={trace} />
      <div className="replay-head" style={{ insetInlineStart: `${share(time, at_ms)}%` }} />
      <Group justify="space-between" gap={0} wrap="nowrap" className="number" aria-hidden>
        {Array.from({ length: TICKS }, (_, tick) => (
          <Text key={tick} size="xs" c="dimmed">
            {seconds(time.unfold((time.length_ms * tick) / (TICKS - 1)))}
          </Text>
        ))}
      </Group>
    </div>
  );
}

export const seconds = (ms: number): string => `${(ms / 1000).toFixed(2)} s`;
const share = (time: Folding, at_ms: number): number => (100 * time.fold(at_ms)) / Math.max(1, time.length_ms);

const Rows = memo(function Rows({ played, time, marks, trace }: Omit<Props, "at_ms" | "onSeek">) {
  const x = (at_ms: number): number => (WIDTH * share(time, at_ms)) / 100;
  const roles = [...new Set(played.scenes.flatMap(({ lanes }) => lanes.map(({ role }) => role)))];
  return (
    <>
      {roles.map((role) => (
        <LaneRow key={role} role={role} x={x} lanes={played.scenes.flatMap(({ lanes }) => lanes.filter((lane) => lane.role === role))} />
      ))}
      {trace.length > 0 && (
        <Row label="slider">
          <polyline
            className="replay-trace"
            points={trace.map(([at_ms, value]) => `${x(at_ms)},${HEIGHT - 2 - value * (HEIGHT - 4)}`).join(" ")}
          />
        </Row>
      )}
      <Row label="answer and events">
        {marks.map(({ at_ms, label, colour }, index) => (
          <line key={index} x1={x(at_ms)} x2={x(at_ms)} y1={0} y2={HEIGHT} stroke={colour} className="replay-mark">
            <title>{label}</title>
          </line>
        ))}
      </Row>
    </>
  );
});

function Row({ label, children }: { label: string; children: React.ReactNode }) {
  return (
    <>
      <Text size="xs" c="dimmed">
        {label}
      </Text>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" className="replay-row" role="img" aria-label={label}>
        {children}
      </svg>
    </>
  );
}

function LaneRow({ role, lanes, x }: { role: string; lanes: readonly Lane[]; x: (at_ms: number) => number }) {
  const shown = lanes.flatMap((lane) => lane.shown);
  const held = lanes.flatMap((lane) => lane.held);
  const skipped = lanes.flatMap((lane) => lane.shown.filter(({ index }) => lane.missing.some(([, last]) => last === index - 1)));
  const path = (some: readonly ShownFrame[]): string =>
    some.map(({ from_ms, to_ms }) => `M${x(from_ms)} 2H${x(to_ms)}V${HEIGHT - 2}H${x(from_ms)}Z`).join("");
  return (
    <Row label={`${role === "shown" ? "clip" : role}: ${shown.length} frames shown, ${held.length} too long`}>
      <path d={path(shown.filter((_, row) => row % 2 === 0))} className="replay-even" />
      <path d={path(shown.filter((_, row) => row % 2 === 1))} className="replay-odd" />
      <path d={path(held)} className="replay-held" />
      <path d={skipped.map(({ from_ms }) => `M${x(from_ms)} 0V${HEIGHT}`).join("")} className="replay-skip" />
    </Row>
  );
}

// Verdict, views and events of a play, in words.

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
                <Table.Th>Shown longest</Table.Th>
                <Table.Th>Disturbed by</Table.Th>
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>{played.scenes.flatMap((scene) => rowsOf(scene))}</Table.Tbody>
          </Table>
        </div>
      )}
      {played.scenes.some(({ view }) => view.from_answer) && (
        <Text size="sm" c="dimmed">
          This run is older than the record of views. What was shown is reconstructed from the answer’s log.
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
