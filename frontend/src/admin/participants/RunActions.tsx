import { Button, Group, Modal, Text, TextInput } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

interface Props {
  study: string;
  summary: Schemas["RunSummary"];
  mayErase: boolean;
}

export function RunActions({ study, summary, mayErase }: Props) {
  const path = { params: { path: { study, run: summary.run } } };
  const touches = [
    ["timeline", study, summary.run],
    ["runs", study],
    ["results", study],
  ];
  const include = useChange(() => unwrap(api.DELETE("/api/admin/studies/{study}/runs/{run}/exclusion", path)), {
    touches,
    done: "The run counts again.",
  });
  const exclude = useChange(
    (reason: string) => unwrap(api.PUT("/api/admin/studies/{study}/runs/{run}/exclusion", { ...path, body: { reason } })),
    { touches, done: "The run is excluded." },
  );
  const erase = useChange(
    (confirm: string) => unwrap(api.POST("/api/admin/studies/{study}/runs/{run}/erase", { ...path, body: { confirm } })),
    {
      touches,
      done: "The person's data are erased, in every visit known to be theirs. Reports made before still hold them: make those again.",
    },
  );
  return (
    <Group>
      {summary.excluded ? (
        <Button variant="default" onClick={() => include.mutate(undefined)}>
          Undo the exclusion
        </Button>
      ) : (
        <Ask
          label="Exclude"
          words="The data stay, marked as excluded, with your reason beside them. You can undo this."
          field="Reason"
          ready={(text) => text.trim().length >= 3}
          onDone={(reason) => exclude.mutate(reason)}
        />
      )}
      {mayErase && (
        <Ask
          label="Erase this person's data"
          words={`Ratings, questionnaires and events of this person are deleted for good. To go on, type ${summary.run}.`}
          field="Identifier of the run"
          ready={(text) => text === summary.run}
          onDone={(confirm) => erase.mutate(confirm)}
        />
      )}
    </Group>
  );
}

interface AskProps {
  label: string;
  words: string;
  field: string;
  ready: (text: string) => boolean;
  onDone: (text: string) => void;
}

function Ask({ label, words, field, ready, onDone }: AskProps) {
  const [opened, { open, close }] = useDisclosure(false);
  const [text, setText] = useState("");
  return (
    <>
      <Button variant="default" onClick={open}>
        {label}
      </Button>
      <Modal opened={opened} onClose={close} title={label} closeButtonProps={{ "aria-label": "Close" }}>
        <Text mb="md">{words}</Text>
        <TextInput label={field} value={text} onChange={(event) => setText(event.currentTarget.value)} data-autofocus />
        <Group justify="flex-end" mt="md">
          <Button variant="default" onClick={close}>
            Cancel
          </Button>
          <Button
            color="red"
            disabled={!ready(text)}
            onClick={() => {
              close();
              onDone(text);
            }}
          >
            {label}
          </Button>
        </Group>
      </Modal>
    </>
  );
}
