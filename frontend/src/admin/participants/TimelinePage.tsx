import { Anchor, Button, Card, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link, useParams } from "@tanstack/react-router";
import { api, type Schemas, unwrap } from "../api";
import { useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { plain, when, words } from "../ui/format";
import { IdentityButton } from "./IdentityButton";
import { RunActions } from "./RunActions";
import { TrialTable } from "./TrialTable";

/** A calibration as it is shown: what was not measured is left out. */
function calibrationFacts(one: Schemas["TimelineCalibration"]): Record<string, string | number> {
  const facts = {
    "px per mm": one.px_per_mm.toFixed(2),
    method: one.method,
    why: words(one.occasion),
    measurements: one.repeats,
    "spread, %": one.spread_percent,
    "ruler says": one.ruler_check && words(one.ruler_check),
    "off at a later look, %": one.recheck_percent,
    "distance, mm": one.viewing_distance_mm,
    "distance by": one.distance_method && words(one.distance_method),
    "distance spread, mm": one.distance_spread_mm,
    zoom: one.zoom,
  };
  return Object.fromEntries(Object.entries(facts).filter((fact): fact is [string, string | number] => fact[1] !== null));
}

export function TimelinePage() {
  const { study = "", run = "" } = useParams({ strict: false });
  const mayChange = useMay(study, "run");
  const mayErase = useMay(study, "edit");
  const owns = useMay(study, "own");
  const timeline = useQuery({
    queryKey: ["timeline", study, run],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs/{run}", { params: { path: { study, run } } })),
  });
  return (
    <Stack>
      <Anchor component={Link} to={`/studies/${study}/participants`}>
        All participants
      </Anchor>
      <Answer of={timeline}>
        {(data) => (
          <Stack>
            <Group justify="space-between" align="start">
              <div>
                <Title order={2} size="h3">
                  {data.summary.participant}
                </Title>
                <Text size="sm" c="dimmed">
                  {words(data.summary.status)}, began {when(data.summary.started_at)},{" "}
                  {data.consented_at === null ? "has not agreed" : `agreed ${when(data.consented_at)}`}, {data.summary.minutes.toFixed(1)}{" "}
                  minutes, language {data.summary.language}, through “{data.summary.link}”
                </Text>
                {data.summary.excluded && <Text c="var(--mantine-color-error)">Excluded: {data.summary.exclusion_reason}</Text>}
              </div>
              <Group>
                {data.summary.erased_at === null && (
                  <Button component={Link} to={`/studies/${study}/participants/${run}/replay`} variant="default">
                    Replay
                  </Button>
                )}
                {owns && data.summary.erased_at === null && (
                  <>
                    <IdentityButton study={study} run={run} />
                    <Button
                      component="a"
                      variant="default"
                      href={`/api/admin/studies/${study}/runs/${run}/subject-access`}
                      title="Everything stored of this person, as JSON"
                      download
                    >
                      Subject access
                    </Button>
                  </>
                )}
                {mayChange && data.summary.erased_at === null && <RunActions study={study} summary={data.summary} mayErase={mayErase} />}
              </Group>
            </Group>
            <Group align="stretch">
              {data.forms.map((form) => (
                <Facts key={form.form} title={`Form “${words(form.form)}”`} values={form.answers} />
              ))}
              {data.calibrations.map((one) => (
                <Facts key={one.saved_at} title="Calibration" values={calibrationFacts(one)} />
              ))}
              <Facts title="Device" values={data.device} />
            </Group>
            <RefusedRecords events={data.events} />
            <TrialTable trials={data.trials} />
            {data.events.length > 0 && (
              <Card withBorder>
                <Title order={3} size="h5">
                  Events
                </Title>
                {data.events.map((event, index) => (
                  <Text size="sm" key={`${event.received_at}${String(index)}`}>
                    {when(event.received_at)}: {words(event.type)}
                  </Text>
                ))}
              </Card>
            )}
          </Stack>
        )}
      </Answer>
    </Stack>
  );
}

/** Answers and views that the server could not store, with the reason; the participant was not held up by them. */
function RefusedRecords({ events }: { events: Schemas["TimelineEvent"][] }) {
  const refused = events.filter(({ type }) => type === "record_refused");
  if (refused.length === 0) return null;
  return (
    <Card withBorder>
      <Title order={3} size="h5">
        Not stored: {refused.length}
      </Title>
      <Text size="sm">The participant went on without these records. They count as given; the exports do not contain them.</Text>
      {refused.map(({ received_at, data }, index) => (
        <Text size="sm" key={`${received_at}${String(index)}`} className="wrap-anywhere">
          {when(received_at)}: {data["trial_index"] === undefined ? plain(data["path"]) : `trial ${plain(data["trial_index"])}`},{" "}
          {plain(data["reason"]) || words(plain(data["code"]))} ({plain(data["status"])})
        </Text>
      ))}
    </Card>
  );
}

function Facts({ title, values }: { title: string; values: Record<string, unknown> }) {
  const entries = Object.entries(values);
  if (entries.length === 0) return null;
  return (
    <Card withBorder padding="sm" maw={420}>
      <Title order={3} size="h5">
        {title}
      </Title>
      {entries.map(([name, value]) => (
        <Text size="sm" key={name} className="wrap-anywhere">
          {words(name)}: {plain(value)}
        </Text>
      ))}
    </Card>
  );
}
