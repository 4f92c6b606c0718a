/** A study's heading and tabs. */

import { Group, Stack, Tabs, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Outlet, useLocation, useNavigate, useParams } from "@tanstack/react-router";
import { studyQuery, useMay } from "../queries";
import { Answer } from "../ui/Answer";
import { StatusBadge } from "./StatusBadge";
import { StatusButtons } from "./StatusButtons";

const TABS = [
  ["design", "Design"],
  ["texts", "Texts"],
  ["clips", "Clips"],
  ["links", "Links"],
  ["monitor", "Monitor"],
  ["results", "Results"],
  ["data", "Data"],
  ["participants", "Participants"],
  ["settings", "Settings"],
] as const;

export function StudyLayout() {
  const { study = "" } = useParams({ strict: false });
  const { pathname } = useLocation();
  const navigate = useNavigate();
  const mayChange = useMay("experimenter");
  const current = pathname.split("/")[3] || "design";
  return (
    <Answer of={useQuery(studyQuery(study))}>
      {({ summary }) => (
        <Stack gap="sm">
          <Group justify="space-between" align="start">
            <div>
              <Group gap="sm">
                <Title order={1} size="h2">
                  {summary.title}
                </Title>
                <StatusBadge status={summary.status} />
              </Group>
              <Text c="dimmed" size="sm">
                {summary.name}, version {summary.version}
              </Text>
            </div>
            {mayChange && <StatusButtons summary={summary} />}
          </Group>
          <Tabs
            value={current}
            keepMounted={false}
            onChange={(to) => void navigate({ to: `/studies/${study}${to === "design" ? "" : `/${to ?? ""}`}` })}
          >
            <Tabs.List>
              {TABS.filter(([path]) => mayChange || (path !== "links" && path !== "settings")).map(([path, label]) => (
                <Tabs.Tab key={path} value={path}>
                  {label}
                </Tabs.Tab>
              ))}
            </Tabs.List>
            <Tabs.Panel value={current} pt="md">
              <Outlet />
            </Tabs.Panel>
          </Tabs>
        </Stack>
      )}
    </Answer>
  );
}
