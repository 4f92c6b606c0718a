/** A run played back from its stored frame logs, trial by trial. */

import { Anchor, Button, Group, Select, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link, useNavigate, useParams, useSearch } from "@tanstack/react-router";
import { api, type Schemas, unwrap } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { words } from "../ui/format";
import { useShortcuts } from "../ui/page-events";
import "./replay.css";

type Replay = Schemas["Replay"];

const Player = onDemand(async () => (await import("./Player")).Player);

export function ReplayPage() {
  const { study = "", run = "" } = useParams({ strict: false });
  const replay = useQuery({
    queryKey: ["replay", study, run],
    // The client's types do not keep tuples.
    queryFn: async () =>
      (await unwrap<unknown>(api.GET("/api/admin/studies/{study}/runs/{run}/replay", { params: { path: { study, run } } }))) as Replay,
    staleTime: 60_000,
  });
  return (
    <Stack>
      <Anchor component={Link} to={`/studies/${study}/participants/${run}`}>
        Everything of this run
      </Anchor>
      <Answer of={replay}>{(data) => <Trials study={study} replay={data} />}</Answer>
    </Stack>
  );
}

function Trials({ study, replay }: { study: string; replay: Replay }) {
  const { trial: asked }: { trial?: unknown } = useSearch({ strict: false });
  const navigate = useNavigate();
  const { trials } = replay;
  const named = trials.findIndex(({ trial_index }) => trial_index === Number(asked ?? NaN));
  const reached = trials.findIndex(({ views, plays }) => views > 0 || plays > 0);
  const row = named >= 0 ? named : Math.max(0, reached);
  const trial = trials[row];
  const go = (to: number): void => {
    const next = trials[to];
    if (next) void navigate({ to: ".", search: { trial: next.trial_index } as never, replace: true });
  };
  // A key that is held down would load every trial on its way.
  const goOnce = (to: number) => (event: KeyboardEvent) => event.repeat || go(to);
  useShortcuts({ arrowup: goOnce(row - 1), arrowdown: goOnce(row + 1) });
  if (replay.erased) return <Text>This person’s data were erased; nothing can be replayed.</Text>;
  if (trial === undefined) return <Text>This run has no trials yet.</Text>;
  return (
    <Stack>
      <Title order={2} size="h3">
        Replay of {replay.participant}
      </Title>
      <Group align="end" gap="xs">
        <Button variant="default" onClick={() => go(row - 1)} disabled={row === 0}>
          Previous trial
        </Button>
        <Select
          label="Trial"
          searchable
          allowDeselect={false}
          w={320}
          maw="100%"
          data={trials.map((one) => ({ value: String(one.trial_index), label: titleOf(one) }))}
          value={String(trial.trial_index)}
          onChange={(value) => go(trials.findIndex(({ trial_index }) => String(trial_index) === value))}
        />
        <Button variant="default" onClick={() => go(row + 1)} disabled={row === trials.length - 1}>
          Next trial
        </Button>
      </Group>
      <OneTrial key={trial.trial_index} study={study} replay={replay} number={trial.trial_index} />
      <Text size="sm" c="dimmed">
        <kbd>Space</kbd> plays and stops · <kbd>←</kbd> <kbd>→</kbd> the frame before and after · <kbd>↑</kbd> <kbd>↓</kbd> the trial before
        and after. Each trial that is opened is noted in the audit log.
      </Text>
    </Stack>
  );
}

function OneTrial({ study, replay, number }: { study: string; replay: Replay; number: number }) {
  const trial = useQuery({
    queryKey: ["replay", study, replay.run, number],
    queryFn: async () =>
      (await unwrap<unknown>(
        api.GET("/api/admin/studies/{study}/runs/{run}/replay/trials/{trial_index}", {
          params: { path: { study, run: replay.run, trial_index: number } },
        }),
      )) as Schemas["ReplayedTrial"],
    staleTime: 60_000,
  });
  return <Answer of={trial}>{(data) => <Player replay={replay} trial={data} />}</Answer>;
}

/** "12 main: slow 2, flagged" */
function titleOf({ trial_index, kind, clips, verdict, plays, views }: Replay["trials"][number]): string {
  const shown = clips.map(({ cell, exemplar }) => `${cell} ${exemplar}`).join(" | ") || "no clip";
  const state = plays === 0 && views === 0 ? "not reached" : (verdict ?? "no answer");
  return `${trial_index} ${words(kind)}: ${shown}, ${state}`;
}
