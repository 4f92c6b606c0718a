/** A study's status, its step between draft and live with what comes next, and whom its design turns away. */

import { Badge, Group, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { launchChecksQuery, type Schemas, studyQuery } from "../api";
import { counted } from "../ui/format";

const COLOURS = { draft: "gray.7", pilot: "indigo.8", live: "teal.9", closed: "dark.4" };

export function StatusBadge({ status }: { status: Schemas["StudySummary"]["status"] }) {
  return <Badge color={COLOURS[status]}>{status}</Badge>;
}

const SCREEN_PAGE = "Screen and playback";

/** Which devices can take no part, for the page that changes it: without the sentence that names this page. */
export const turnedAwayHere = (words: string) => words.replace(new RegExp(` [^.]*${SCREEN_PAGE}\\.$`), "");

interface TurnedAwayProps {
  study: string;
  design: Schemas["DesignOut"] | undefined;
  /** Whether it is on the page that changes it. */
  isHere?: boolean;
}

/** Devices that can take no part, said before somebody sends them a link; the page that changes it is a link. */
export function TurnedAway({ study, design, isHere = false }: TurnedAwayProps) {
  if (!design?.turned_away) return null;
  const [before = "", after] = (isHere ? turnedAwayHere(design.turned_away) : design.turned_away).split(SCREEN_PAGE);
  return (
    <Text size="sm">
      {before}
      {after !== undefined && (
        <Link to="/studies/$study/build" params={{ study }} search={{ section: "screen" }}>
          {SCREEN_PAGE}
        </Link>
      )}
      {after}
    </Text>
  );
}

// Where a study is between draft and live, and what comes next.

const STEPS = [
  ["draft", "Draft"],
  ["preview", "Preview"],
  ["rehearsal", "Rehearsal"],
  ["pilot", "Pilot"],
  ["live", "Live"],
] as const;

interface Next {
  /** The step of the study that this is. */
  step: (typeof STEPS)[number][0];
  text: string;
  /** The page on which it is done; null where the buttons above do it. */
  page: "" | "/rehearsal" | "/results" | "/monitor" | "/settings" | "/data" | null;
}

/** The step of a study by its status alone, as far as it is known without the checklist. */
export const stepOf = (status: Schemas["StudySummary"]["status"]): Next["step"] => (status === "closed" ? "live" : status);

/** What to do next with a study, by its status and what its checklist says. */
export function nextStep(
  summary: Pick<Schemas["StudySummary"], "status" | "paused" | "archived_at" | "complete" | "quota">,
  checks: readonly Schemas["LaunchCheck"][],
): Next {
  const { status, paused, archived_at, complete, quota } = summary;
  const step = stepOf(status);
  if (archived_at !== null)
    return { step, text: "This study is in the archive. Restore it under Settings to change it.", page: "/settings" };
  if (status === "closed") return { step, text: "Build the report and download the data.", page: "/data" };
  const fix = checks.filter(({ blocks }) => blocks).length;
  const has = (kind: string) => checks.some((check) => check.kind === kind);
  if (status !== "live" && fix > 0) return { step, text: `Fix ${counted(fix, "problem")} on the checklist.`, page: "" };
  if (paused) return { step, text: "The study is paused. Let participants begin under Settings.", page: "/settings" };
  if (status === "live")
    return {
      step,
      text: `Follow the participants on the monitor (${String(complete)}${quota === null ? "" : ` of ${String(quota)}`} complete).`,
      page: "/monitor",
    };
  if (status === "pilot")
    return { step, text: `Look at the results of the pilot (${String(complete)} complete), then set the study live.`, page: "/results" };
  if (has("not_tried")) return { step: "preview", text: "Preview the study as a participant.", page: null };
  if (has("rehearsal")) return { step: "rehearsal", text: "Rehearse the study with simulated people.", page: "/rehearsal" };
  return { step: "pilot", text: "Open the study as a pilot, or set it live.", page: null };
}

const FRESH_MS = 20_000;

export function StudySteps({ summary }: { summary: Schemas["StudySummary"] }) {
  // Runs end while somebody looks at the page.
  useQuery({ ...studyQuery(summary.name), refetchInterval: summary.status === "live" || summary.status === "pilot" ? FRESH_MS : false });
  const checks = useQuery(launchChecksQuery(summary.name)).data;
  const next = checks === undefined ? null : nextStep(summary, checks);
  const now = STEPS.findIndex(([step]) => step === (next?.step ?? stepOf(summary.status)));
  return (
    <Group gap="md" justify="space-between" className="study-steps">
      <ol aria-label="Steps of the study">
        {STEPS.map(([step, label], index) => (
          <li key={step} className={index < now ? "done" : ""} aria-current={index === now ? "step" : undefined}>
            {step === "live" && summary.status === "closed" ? "Closed" : label}
          </li>
        ))}
      </ol>
      {next !== null && (
        <Text size="sm">
          <b>Next:</b>{" "}
          {next.page === null ? (
            next.text
          ) : (
            <Link to={`/studies/$study${next.page}`} params={{ study: summary.name }}>
              {next.text}
            </Link>
          )}
        </Text>
      )}
    </Group>
  );
}
