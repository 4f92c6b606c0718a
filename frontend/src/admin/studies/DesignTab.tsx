import { Accordion, Code, Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { studyQuery } from "../api";
import { Answer } from "../ui/Answer";
import { Design } from "./Design";
import { TurnedAway } from "./StatusBadge";

export function DesignTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => (
        <Stack>
          <Design design={detail.design} />
          <TurnedAway design={detail.design} />
          <Accordion variant="contained">
            <Accordion.Item value="toml">
              <Accordion.Control>Definition (TOML)</Accordion.Control>
              <Accordion.Panel>
                <Code block tabIndex={0} aria-label="Definition">
                  {detail.toml}
                </Code>
              </Accordion.Panel>
            </Accordion.Item>
          </Accordion>
        </Stack>
      )}
    </Answer>
  );
}
