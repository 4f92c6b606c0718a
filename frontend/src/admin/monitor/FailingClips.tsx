/** Clips that participants could not see: which, for how many people of how many, and why. */
import { Alert, List } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useEffect, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { Sentence } from "../ui/Answer";
import { counted, ruleWords } from "../ui/format";

type Failing = Schemas["FailingClip"];
const MAX_LISTED = 5;

const failingClipsQuery = (study: string) => ({
  queryKey: ["study", study, "failing-clips"],
  queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/failing-clips", { params: { path: { study } } })),
  refetchInterval: 30_000,
});

const warningsQuery = (study: string) => ({
  queryKey: ["study", study, "warnings"],
  queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/warnings", { params: { path: { study } } })),
  refetchInterval: 60_000,
});

const LATEST_MS = 800;

/** Whether it is known what goes wrong with a study, so that no warning moves the page later; true soon in any case. */
export function useWarningsKnown(study: string): boolean {
  const pending = [useQuery(failingClipsQuery(study)).isPending, useQuery(warningsQuery(study)).isPending];
  const [isLate, setLate] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setLate(true), LATEST_MS);
    return () => clearTimeout(timer);
  }, []);
  return isLate || !pending.includes(true);
}

/** On every page of a study: what its owners are sent. Clips that fail have their own box. */
export function StudyWarnings({ study }: { study: string }) {
  const warnings = (useQuery(warningsQuery(study)).data ?? []).filter(({ kind }) => kind !== "clip");
  if (warnings.length === 0) return null;
  return (
    <Alert role="status" color="yellow" title="This study needs attention">
      <List size="sm">
        {warnings.map(({ event, text }) => (
          <List.Item key={event}>
            <Sentence text={text} />
          </List.Item>
        ))}
      </List>
    </Alert>
  );
}

/** Why, as the browsers said it, or else by the rule that most of its plays failed by. */
function reasonOf({ reason, rules }: Failing): string {
  const [rule] = Object.keys(rules);
  const words = rule === undefined ? "" : ruleWords(rule);
  return [words, reason].filter((part) => part !== "").join("; ");
}

function inWords(clip: Failing): string {
  const reason = reasonOf(clip);
  return `${clip.file}: not shown to ${clip.failed_for.toLocaleString()} of ${counted(clip.people, "person", "people")}${reason === "" ? "" : ` (${reason})`}`;
}

/** On every page of a study: the clips that fail for everybody or for most. On the monitor all that failed. */
export function FailingClips({ study, all = false }: { study: string; all?: boolean }) {
  const every = useQuery(failingClipsQuery(study)).data ?? [];
  const clips = every.filter(({ alarm }) => alarm !== all);
  if (clips.length === 0) return null;
  const which = clips.length === 1 ? "A clip" : `${clips.length.toLocaleString()} clips`;
  return (
    <Alert
      role={all ? "status" : "alert"}
      color={all ? "yellow" : "red"}
      title={all ? `${which} failed for some participants` : `${which} cannot be shown to participants`}
    >
      <List size="sm">
        {clips.slice(0, MAX_LISTED).map((clip) => (
          <List.Item key={clip.clip_sha256}>{inWords(clip)}</List.Item>
        ))}
      </List>
      {clips.length > MAX_LISTED && `and ${(clips.length - MAX_LISTED).toLocaleString()} more. `}
      {!all && (
        <>
          Pause the study, play the clip under{" "}
          <Link to="/studies/$study/clips" params={{ study }}>
            Clips
          </Link>{" "}
          and replace it.
        </>
      )}
    </Alert>
  );
}
