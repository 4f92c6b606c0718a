/** The plan of the study, sealed before its first participant. */

import { Button, Card, FileInput, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { sealQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { ConfirmButton } from "../ui/ConfirmButton";
import { counted, when } from "../ui/format";
import { useChange } from "../ui/useChange";
import { notify } from "../ui/notify";

export function SealCard({ study }: { study: string }) {
  const seal = useQuery(sealQuery(study));
  return (
    <Card withBorder>
      <Title order={2} size="h4">
        Sealed plan
      </Title>
      <Text size="sm" mt={4} mb="sm">
        Design, exclusions, analysis plan and power, fixed with a hash before the first participant. Reports list each deviation from it.
      </Text>
      <Answer of={seal}>
        {(record) => (record.sealed_at === null ? <Unsealed study={study} seal={record} /> : <Sealed study={study} seal={record} />)}
      </Answer>
    </Card>
  );
}

interface Props {
  study: string;
  seal: Schemas["SealOut"];
}

function Sealed({ study, seal }: Props) {
  const address = (ending: string) => `/api/admin/studies/${study}/seal/plan.${ending}`;
  return (
    <Stack gap="xs">
      <Text size="sm" className="wrap-anywhere">
        Version {seal.version} was sealed {when(seal.sealed_at ?? "")}, {seal.power ? "with its power" : "without power"}; sha256{" "}
        <code>{seal.sha256}</code>
      </Text>
      <Group>
        <Button component="a" variant="default" size="xs" href={address("json")} download>
          Sealed file (JSON)
        </Button>
        <Button component="a" variant="default" size="xs" href={address("html")} download>
          Page to print
        </Button>
      </Group>
    </Stack>
  );
}

function Unsealed({ study, seal }: Props) {
  const mayChange = useMay(study, "edit");
  const [power, setPower] = useState<Record<string, unknown> | null>(null);
  const make = useChange(() => unwrap(api.POST("/api/admin/studies/{study}/seal", { params: { path: { study } }, body: { power } })), {
    touches: [["study", study, "seal"]],
    done: "The plan is sealed.",
  });
  if (seal.participants > 0) return <Text size="sm">Not sealed: begun already by {counted(seal.participants, "participant")}.</Text>;
  if (!mayChange) return <Text size="sm">Not sealed yet.</Text>;
  return (
    <Group align="end">
      <FileInput
        label="Power (may be left out)"
        description="JSON that analysis power --json wrote"
        accept=".json"
        clearable
        w={300}
        onChange={(file) => void readObject(file).then(setPower)}
      />
      <ConfirmButton
        label="Seal the plan"
        question="A seal is never replaced: what is declared in this version is what reports will be held against."
        confirm="Seal"
        harmless
        onConfirm={() => make.mutate(undefined)}
      />
    </Group>
  );
}

/** The JSON object in a file; null, and said so, where there is none. */
async function readObject(file: File | null): Promise<Record<string, unknown> | null> {
  if (file === null) return null;
  try {
    const parsed: unknown = JSON.parse(await file.text());
    if (typeof parsed === "object" && parsed !== null && !Array.isArray(parsed)) return { ...parsed };
  } catch {
    // Said below, as for JSON of another kind.
  }
  notify({ title: "That did not work", message: `${file.name}: expected the JSON of analysis power, got another file.`, color: "red" });
  return null;
}
