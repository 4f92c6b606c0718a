/** Make links: one for everybody, one per person, or to look at the study oneself. */
import { Button, Card, Group, SegmentedControl, Select, Stack, Text, Textarea, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap, studyQuery } from "../api";
import { useChange } from "../ui/useChange";
import { faultOf, type Typed, WholeNumber } from "../ui/WholeNumber";

const MEANS: Record<Schemas["NewLinks"]["kind"], string> = {
  general: "Anyone can use the same link.",
  personal: "Each link is for one person, who can continue on another device.",
  preview: "For yourself, also for a draft. Preview answers are not part of the results and are deleted later.",
};
const LINKS = { min: 1, max: 5000 };
const RECRUITERS = ["none", "prolific", "sona", "mturk", "generic"] as const;

export function NewLinks({ study }: { study: string }) {
  const [kind, setKind] = useState<Schemas["NewLinks"]["kind"]>("general");
  const [label, setLabel] = useState("");
  const [names, setNames] = useState("");
  const [count, setCount] = useState<Typed>(20);
  const [recruiter, setRecruiter] = useState<(typeof RECRUITERS)[number]>("none");
  const [code, setCode] = useState("");
  const groups = useQuery(studyQuery(study)).data?.design.groups ?? [];
  const [chosen, setChosen] = useState<string | null>(null);
  const group = kind === "preview" ? "" : (chosen ?? groups[0] ?? "");
  // Names decide how many links there are.
  const named = names.trim() !== "";
  const make = useChange(
    () => {
      const labels = names
        .split("\n")
        .map((name) => name.trim())
        .filter((name) => name !== "");
      const sent =
        recruiter === "none"
          ? null
          : { kind: recruiter, code_complete: code, id_parameter: "", redirect_url: "", code_failed_check: "", code_screened_out: "" };
      const body = { kind, label, group, labels: kind === "personal" ? labels : [], count: named ? 1 : Number(count), recruiter: sent };
      return unwrap(api.POST("/api/admin/studies/{study}/links", { params: { path: { study } }, body }));
    },
    { touches: [["links", study]], done: "Links created." },
  );
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        New links
      </Title>
      <Stack>
        <SegmentedControl
          aria-label="Kind of link"
          value={kind}
          onChange={(word) => setKind(word === "personal" || word === "preview" ? word : "general")}
          data={[
            { value: "general", label: "Everybody" },
            { value: "personal", label: "One person each" },
            { value: "preview", label: "Preview" },
          ]}
        />
        <Text size="sm">{MEANS[kind]}</Text>
        <Group align="end">
          <TextInput label="Label" value={label} onChange={(event) => setLabel(event.currentTarget.value)} />
          {kind !== "preview" && groups.length > 0 && (
            <Select label="Group" data={groups} value={group} allowDeselect={false} onChange={setChosen} />
          )}
          {kind === "personal" && <WholeNumber label="How many" {...LINKS} optional={named} value={count} onChange={setCount} w={110} />}
          {kind === "general" && (
            <>
              <Select
                label="Recruited through"
                data={[...RECRUITERS]}
                value={recruiter}
                allowDeselect={false}
                onChange={(word) => setRecruiter(RECRUITERS.find((one) => one === word) ?? "none")}
              />
              {recruiter !== "none" && (
                <TextInput label="Completion code" value={code} onChange={(event) => setCode(event.currentTarget.value)} />
              )}
            </>
          )}
          <Button
            disabled={kind === "personal" && !named && faultOf(count, LINKS) !== null}
            onClick={() => make.mutate(undefined)}
            loading={make.isPending}
          >
            {kind === "personal" ? "Create links" : "Create link"}
          </Button>
        </Group>
        {kind === "personal" && (
          <Textarea
            label="Or one name per line"
            autosize
            minRows={2}
            maxRows={8}
            value={names}
            onChange={(event) => setNames(event.currentTarget.value)}
          />
        )}
      </Stack>
    </Card>
  );
}
