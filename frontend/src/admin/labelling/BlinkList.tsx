import { Button, Card, Group, Table, Text, TextInput } from "@mantine/core";
import { useState } from "react";
import { type Blink, blinkKey, decisionOn, edgesOf } from "../../labelling/review";
import { fixed } from "../ui/format";
import type { useBlinkReview } from "./useBlinkReview";

type Review = ReturnType<typeof useBlinkReview>;

/** The blink chosen: what was decided, and what can be. */
export function BlinkCard({ review, blink }: { review: Review; blink: Blink }) {
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
              label="Reason to reject it"
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
          Start and end as labelled
        </Button>
      </Group>
    </Card>
  );
}

/** All blinks of the column shown. */
export function BlinkList({ review }: { review: Review }) {
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

function Row({ review, blink }: { review: Review; blink: Blink }) {
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
