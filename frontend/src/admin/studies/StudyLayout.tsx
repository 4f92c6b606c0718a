/** The frame of a study's pages: its name, status and tabs, and the buttons that open and close it. */

import { Card, Group, Modal, Stack, Text, Alert, Tabs, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link, Outlet, useLocation, useNavigate, useParams } from "@tanstack/react-router";
import { api, unwrap, studyQuery, type Schemas, clipCheckQuery, launchChecksQuery } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { Address, addressFor, PreviewButton, RECRUITER_NAMES } from "./recruiting";
import { StatusBadge, StudySteps } from "./StatusBadge";
import { useState, useEffect, useRef } from "react";
import { keptWork, otherWork } from "../builder/kept";
import { ConfirmButton } from "../ui/ConfirmButton";
import { useChange } from "../ui/useChange";
import { FailingClips, StudyWarnings, useWarningsKnown } from "../monitor/FailingClips";

// After a study is opened: the link for participants, and what each recruiter needs.

interface Props {
  study: string;
  onClose: () => void;
}

function OpenedDialog({ study, onClose }: Props) {
  const link = useQuery({ queryKey: ["links", study, "general"], queryFn: () => generalLink(study) });
  const detail = useQuery(studyQuery(study)).data;
  const recruiter = detail?.recruiter;
  const kind = typeof recruiter?.["kind"] === "string" ? recruiter["kind"] : null;
  return (
    <Modal opened onClose={onClose} title="Participants can start" size="lg" closeButtonProps={{ "aria-label": "Close" }}>
      <Answer of={link}>
        {({ url }) => (
          <Stack>
            <Address label="Link for participants" url={url} />
            {kind === null ? (
              <Text size="sm">
                To recruit with Prolific, SONA or MTurk, first choose the service under{" "}
                <Link to="/studies/$study/settings" params={{ study }} onClick={onClose}>
                  Settings
                </Link>
                . The link then appears here and under Links. Until then links of these services are refused, because participants would
                have no id, get a random completion code, and could take part twice.
              </Text>
            ) : (
              <Address
                label={`For ${RECRUITER_NAMES[kind] ?? kind}, which fills in the participant's id`}
                url={addressFor(url, recruiter)}
              />
            )}
            <Text size="sm" c="dimmed">
              Personal links, quotas and completion codes are under{" "}
              <Link to="/studies/$study/links" params={{ study }} onClick={onClose}>
                Links
              </Link>{" "}
              and{" "}
              <Link to="/studies/$study/settings" params={{ study }} onClick={onClose}>
                Settings
              </Link>
              .
            </Text>
          </Stack>
        )}
      </Answer>
    </Modal>
  );
}

/** The first link for everybody; made where there is none. */
async function generalLink(study: string): Promise<{ url: string }> {
  const path = { params: { path: { study } } };
  const { links } = await unwrap(api.GET("/api/admin/studies/{study}/links", path));
  const known = links.find((one) => one.kind === "general" && one.recruiter === null);
  if (known !== undefined) return known;
  const body = { kind: "general" as const, label: "everybody", labels: [], count: 1 };
  const [made] = await unwrap(api.POST("/api/admin/studies/{study}/links", { ...path, body }));
  if (made === undefined) throw new Error("expected a new link, got none; create one under Links");
  return made;
}

const Preflight = onDemand(async () => (await import("./Preflight")).Preflight);

type Status = Schemas["StudySummary"]["status"];
const NEXT: Record<Status, Status[]> = { draft: ["pilot", "live"], pilot: ["draft", "live", "closed"], live: ["closed"], closed: ["live"] };
const WORDS: Record<Status, [label: string, question: string]> = {
  draft: ["Back to draft", "Participants can no longer start; pilot data stay."],
  pilot: ["Open as pilot", "Participants can start; their data are marked as pilot."],
  live: ["Set live", "Participants can start, and their data are used in the analysis. Every change now creates a new version."],
  closed: ["Close study", "No one can start any more. Runs in progress can finish."],
};

const isOpen = (status: Status) => status === "live" || status === "pilot";

function StatusButtons({ summary }: { summary: Schemas["StudySummary"] }) {
  const [opened, setOpened] = useState(false);
  const [anyway, setAnyway] = useState(false);
  const path = { params: { path: { study: summary.name } } };
  const change = useChange(
    (status: Status) =>
      unwrap(
        api.PUT("/api/admin/studies/{study}/status", {
          ...path,
          body: { revision: summary.revision, status, anyway: anyway && status === "live" },
        }),
      ),
    {
      touches: [["study", summary.name], ["studies"], ["links", summary.name]],
      // The dialog with the link says so itself; a message in the corner would lie over it on a phone.
      done: ({ summary: { status } }) => (isOpen(status) ? null : "Status changed."),
      then: (detail) => setOpened(isOpen(detail.summary.status)),
    },
  );
  // Loaded by what the dialog shows; the server refuses for the same reasons, but it cannot try the clips.
  const checks = useQuery({ ...launchChecksQuery(summary.name), enabled: false }).data;
  const clips = useQuery({ ...clipCheckQuery(summary.name, summary.version), enabled: false });
  const blocking = [...(checks ?? []), ...(clips.data?.findings ?? [])].filter(({ blocks }) => blocks);
  // Only what is wrong with clips can be overridden: server and browser may be mistaken about a clip.
  const mayOverride = blocking.length > 0 && blocking.every(({ page }) => page === "clips");
  const isBlocked = blocking.length > 0 && !(mayOverride && anyway);
  return (
    <Group gap="xs">
      <PreviewButton study={summary.name} />
      {NEXT[summary.status].map((status) => (
        <ConfirmButton
          key={status}
          label={WORDS[status][0]}
          question={`${WORDS[status][1]}${keptWork(summary.name) === null && otherWork(summary.name).length === 0 ? "" : " Unsaved work in the builder is not included."}`}
          confirm={WORDS[status][0]}
          harmless={status !== "closed"}
          blocked={status === "live" && (isBlocked || clips.isFetching || (clips.data === undefined && clips.error === null))}
          wide={isOpen(status)}
          onConfirm={() => change.mutate(status)}
        >
          {isOpen(status) && (
            <Card withBorder mt="sm">
              <Preflight
                study={summary.name}
                atOnce={status === "live"}
                {...(status === "live" && mayOverride ? { override: { isOn: anyway, onChange: setAnyway } } : {})}
              />
            </Card>
          )}
        </ConfirmButton>
      ))}
      {opened && <OpenedDialog study={summary.name} onClose={() => setOpened(false)} />}
    </Group>
  );
}

// A study's heading and tabs.

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
    <Answer of={useQuery(studyQuery(study))} waits={!useWarningsKnown(study)}>
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
                {summary.archived_at !== null && ", archived: read only"}
              </Text>
            </div>
            {summary.rights.includes("run") && summary.archived_at === null && <StatusButtons summary={summary} />}
          </Group>
          <StudySteps summary={summary} />
          <FailingClips study={study} />
          <StudyWarnings study={study} />
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
