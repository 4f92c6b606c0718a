import { Accordion, Button, Card, Code, Stack, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { type Schemas, studyQuery } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { Design } from "./Design";
import { TurnedAway } from "./StatusBadge";

const Preflight = onDemand(async () => (await import("./Preflight")).Preflight);

/** A study that people can still be kept from: its checklist is on its first page. */
const isAhead = ({ status, archived_at }: Schemas["StudySummary"]) => (status === "draft" || status === "pilot") && archived_at === null;

export function DesignTab() {
  const { study = "" } = useParams({ strict: false });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {(detail) => (
        <Stack>
          {isAhead(detail.summary) && (
            <Card withBorder id="before">
              <Title order={2} size="h4" mb="sm">
                Before it goes live
              </Title>
              <Preflight study={study} />
            </Card>
          )}
          <Design design={detail.design} />
          {!isAhead(detail.summary) && <TurnedAway study={study} design={detail.design} />}
          <Accordion variant="contained">
            <Accordion.Item value="toml">
              <Accordion.Control>Definition (TOML)</Accordion.Control>
              <Accordion.Panel>
                <Code block tabIndex={0} aria-label="Definition">
                  {detail.toml}
                </Code>
                <Button
                  component="a"
                  variant="default"
                  mt="sm"
                  href={`/api/admin/studies/${study}/versions/${String(detail.summary.version)}`}
                  download={`${study}.toml`}
                >
                  Download {study}.toml
                </Button>
              </Accordion.Panel>
            </Accordion.Item>
          </Accordion>
        </Stack>
      )}
    </Answer>
  );
}
