/** A study's heading and tabs. */

import { Alert, Group, Stack, Tabs, Text, Title } from "@mantine/core";
import { useEffect, useRef } from "react";
import { useQuery } from "@tanstack/react-query";
import { Outlet, useLocation, useNavigate, useParams } from "@tanstack/react-router";
import type { Schemas } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { onDemand } from "../ui/onDemand";
import { StatusBadge } from "./StatusBadge";
import { StatusButtons } from "./StatusButtons";

const FailingClips = onDemand(async () => (await import("../monitor/FailingClips")).FailingClips);

const TABS = [
  ["design", "Design"],
  ["build", "Build"],
  ["clips", "Clips"],
  ["rehearsal", "Rehearsal"],
  ["links", "Links"],
  ["monitor", "Monitor"],
  ["results", "Results"],
  ["data", "Data"],
  ["participants", "Participants"],
  ["settings", "Settings"],
] as const;
type Right = Schemas["StudySummary"]["rights"][number];
const NEEDED: Partial<Record<string, Right>> = { build: "edit", links: "run", settings: "run", data: "export", participants: "export" };

/** In the place of a page that somebody opened by its address and whose right is missing. */
function RightMissing({ needed, held }: { needed: Right; held: readonly Right[] }) {
  return (
    <Alert color="yellow" title={`This page needs the right “${needed}”`}>
      You have {held.map((right) => `“${right}”`).join(", ")} on this study. An owner of the study can give you more under Settings.
    </Alert>
  );
}

export function StudyLayout() {
  const { study = "" } = useParams({ strict: false });
  const { pathname } = useLocation();
  const navigate = useNavigate();
  const current = pathname.split("/")[3] || "design";
  const needed = NEEDED[current] ?? "view";
  const line = useRef<HTMLDivElement>(null);
  useEffect(() => {
    // On a phone the tabs are wider than the screen: the open one is brought into view.
    line.current?.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest", inline: "center" });
  });
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {({ summary }) => (
        <Stack gap="sm">
          <Group justify="space-between" align="start">
            <div>
              <Group gap="sm">
                <Title order={1}>{summary.title}</Title>
                <StatusBadge status={summary.status} />
              </Group>
              <Text c="dimmed" size="sm">
                {summary.name}, version {summary.version}
                {summary.paused && ", paused: nobody can begin"}
                {summary.archived_at !== null && ", in the archive: it can be read, and not changed"}
              </Text>
            </div>
            {summary.rights.includes("run") && summary.archived_at === null && <StatusButtons summary={summary} />}
          </Group>
          <FailingClips study={study} />
          <Tabs
            value={current}
            keepMounted={false}
            onChange={(to) => void navigate({ to: `/studies/${study}${to === "design" ? "" : `/${to ?? ""}`}` })}
          >
            <Tabs.List ref={line} className="tabs-line">
              {TABS.filter(([path]) => summary.rights.includes(NEEDED[path] ?? "view")).map(([path, label]) => (
                <Tabs.Tab key={path} value={path}>
                  {label}
                </Tabs.Tab>
              ))}
            </Tabs.List>
            <Tabs.Panel value={current} pt="md">
              {summary.rights.includes(needed) ? <Outlet /> : <RightMissing needed={needed} held={summary.rights} />}
            </Tabs.Panel>
          </Tabs>
        </Stack>
      )}
    </Answer>
  );
}
