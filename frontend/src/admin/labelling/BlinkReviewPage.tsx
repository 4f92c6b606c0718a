/** A second look at labeled blinks, for `stimuli blinks --review`. The files stay on this computer. */
import { Button, Card, Group, Table, Text, TextInput, Alert, SegmentedControl, Stack, Title } from "@mantine/core";
import { useState } from "react";
import { type Blink, blinkKey, decisionOn, edgesOf, zoomedWindow } from "../../labelling/review";
import { fixed } from "../ui/format";
import { type BlinkReview, useBlinkReview } from "./useBlinkReview";
import { OpenFile } from "./OpenFile";
import { TraceView } from "./TraceView";
import { useShortcuts, useUnsaved } from "../ui/page-events";
import "./labelling.css";

/** The blink chosen: what was decided, and what can be. */
function BlinkCard({ review, blink }: { review: BlinkReview; blink: Blink }) {
  const decision = decisionOn(review.decisions, blink);
  const [reason, setReason] = useState(decision.reason);
  const { onset, end } = edgesOf(blink, review.decisions);
  const moved = decision.onset !== null || decision.end !== null;
  return (
    <Card withBorder>
      <Group align="end">
        <Text fw={600} className="number">
          Blink {blink.number}, frames {onset} to {end} ({fixed(((end - onset) * 1000) / review.fps, 0)} ms)
        </Text>
        <Button variant="default" onClick={() => review.decide(blink, "accept", "")} disabled={decision.decision === "accept"}>
          Accept
        </Button>
        <form
          onSubmit={(event) => {
            event.preventDefault();
            if (reason.trim() === "") return;
            review.decide(blink, "reject", reason.trim());
            if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
          }}
        >
          <Group align="end" gap="xs">
            <TextInput
              id="reject-reason"
              label="Reason for rejection"
              placeholder="talking"
              value={reason}
              onChange={(event) => setReason(event.currentTarget.value)}
            />
            <Button type="submit" variant="default" disabled={reason.trim() === ""}>
              Reject
            </Button>
          </Group>
        </form>
        <Button variant="default" onClick={() => review.restore(blink)} disabled={!moved}>
          Start and end as labeled
        </Button>
      </Group>
    </Card>
  );
}

/** All blinks of the column shown. */
function BlinkList({ review }: { review: BlinkReview }) {
  return (
    <div className="blink-list" tabIndex={0} role="region" aria-label="Blinks">
      <Table stickyHeader>
        <Table.Thead>
          <Table.Tr>
            {["Blink", "Start", "End", "Closure", "Decision"].map((name) => (
              <Table.Th key={name}>{name}</Table.Th>
            ))}
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {review.blinks.map((blink) => (
            <Row key={blinkKey(blink)} review={review} blink={blink} />
          ))}
        </Table.Tbody>
      </Table>
    </div>
  );
}

function Row({ review, blink }: { review: BlinkReview; blink: Blink }) {
  const { decision, reason, onset: newOnset, end: newEnd } = decisionOn(review.decisions, blink);
  const { onset, end } = edgesOf(blink, review.decisions);
  return (
    <Table.Tr>
      <Table.Td>
        <Button
          size="compact-sm"
          variant={blink === review.chosen ? "filled" : "default"}
          aria-label={`Choose blink ${blink.number}`}
          onClick={() => review.choose(blink, true)}
        >
          {blink.number}
        </Button>
      </Table.Td>
      <Table.Td className="number">
        {onset}
        {newOnset !== null && " (moved)"}
      </Table.Td>
      <Table.Td className="number">
        {end}
        {newEnd !== null && " (moved)"}
      </Table.Td>
      <Table.Td className="number">{fixed(blink.closure)}</Table.Td>
      <Table.Td>{decision === "reject" ? `rejected: ${reason}` : "accepted"}</Table.Td>
    </Table.Tr>
  );
}

export function BlinkReviewPage() {
  const review = useBlinkReview();
  useUnsaved(review.unsaved);
  return (
    <Stack>
      <Title order={1}>Review blinks</Title>
      <Text maw={720}>
        The blinks that <code>stimuli blinks</code> found in a series or track: exclude what is not a blink, correct starts and ends, and
        give the saved file to <code>stimuli blinks --review</code>. The files are opened in this page only: nothing is uploaded.
      </Text>
      <Group>
        <OpenFile label="Open series or track" accept=".csv,text/csv" primary={!review.hasSeries} onOpen={review.openSeries} />
        <OpenFile label="Open blinks" accept=".csv,text/csv" primary={review.table === null} onOpen={review.openBlinks} />
        <OpenFile label="Open review" accept=".csv,text/csv" disabled={review.table === null} onOpen={review.openReview} />
        <Button onClick={review.save} disabled={review.decisions.size + review.lost.length === 0}>
          Save review
        </Button>
      </Group>
      {review.problem !== null && (
        <Alert color="red" variant="light" role="alert" title="That does not match">
          {review.problem}
        </Alert>
      )}
      {review.lost.length > 0 && (
        <Text>
          {review.lost.length} decisions of the review match no blink (the first at frame {review.lost[0]?.minimum} of{" "}
          {review.lost[0]?.column}); they are kept when you save.
        </Text>
      )}
      {review.next !== null && <Text role="status">{review.next}</Text>}
      {review.values !== null && <Reviewing review={review} values={review.values} />}
    </Stack>
  );
}

function Reviewing({ review, values }: { review: BlinkReview; values: Float64Array }) {
  const { window, setWindow, last, chosen } = review;
  const zoom = (factor: number): void => setWindow((now) => zoomedWindow(now, factor, (now.from + now.to) / 2, last));
  useShortcuts({
    n: () => review.step(1),
    p: () => review.step(-1),
    a: () => {
      if (chosen !== null) review.decide(chosen, "accept", "");
    },
    r: () => document.querySelector<HTMLInputElement>("#reject-reason")?.focus(),
    "+": () => zoom(0.8),
    "=": () => zoom(0.8),
    "-": () => zoom(1.25),
    "0": () => setWindow({ from: 0, to: last }),
    "ctrl+z": review.undo,
    "ctrl+shift+z": review.redo,
    "ctrl+y": review.redo,
  });
  return (
    <>
      <Group justify="space-between">
        <Group gap="xs">
          <Button variant="default" onClick={() => zoom(0.8)}>
            Zoom in
          </Button>
          <Button variant="default" onClick={() => zoom(1.25)}>
            Zoom out
          </Button>
          <Button variant="default" onClick={() => setWindow({ from: 0, to: last })}>
            Whole series
          </Button>
          {review.columns.length > 1 && (
            <SegmentedControl aria-label="Column" data={review.columns} value={review.column ?? ""} onChange={review.setColumn} />
          )}
        </Group>
        <Group gap="xs">
          <Button variant="default" onClick={() => review.step(-1)}>
            Previous blink
          </Button>
          <Button variant="default" onClick={() => review.step(1)}>
            Next blink
          </Button>
          <Button variant="default" onClick={review.undo} disabled={!review.canUndo}>
            Undo
          </Button>
          <Button variant="default" onClick={review.redo} disabled={!review.canRedo}>
            Redo
          </Button>
        </Group>
      </Group>
      <TraceView
        values={values}
        fps={review.fps}
        blinks={review.blinks}
        decisions={review.decisions}
        chosen={chosen}
        window={window}
        onWindow={setWindow}
        onChoose={review.choose}
        onEdge={review.moveEdge}
      />
      {chosen !== null && <BlinkCard key={`${chosen.column}:${chosen.minimum}`} review={review} blink={chosen} />}
      <BlinkList review={review} />
      <Text size="sm" c="dimmed">
        <kbd>N</kbd> <kbd>P</kbd> next, previous blink · <kbd>A</kbd> accept · <kbd>R</kbd> reject: type the reason, then <kbd>Enter</kbd> ·
        start and end: drag them, or <kbd>Tab</kbd> to them and arrows (1 frame, with <kbd>Shift</kbd> 10) · <kbd>Ctrl Z</kbd>{" "}
        <kbd>Ctrl Shift Z</kbd> undo, redo · <kbd>+</kbd> <kbd>-</kbd> <kbd>0</kbd> zoom
      </Text>
    </>
  );
}
