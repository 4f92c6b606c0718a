/** The builder: the declaration by forms, its TOML beneath, saved as a new version. */
import { Button, Group, Stack } from "@mantine/core";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, clipsQuery, type Schemas, unwrap, studyQuery } from "../api";
import { Answer, onDemand } from "../ui/Answer";
import { when } from "../ui/format";
import { isTable } from "./data";
import { isSame, type Meeting, meetingOf } from "./history";
import { type Draft, forgetDraft, forgetWork, isUnsaved, type Kept, keptWork, otherWork, tabOf } from "./kept";
import { meetingOfClips, type Place, storedPlaces } from "./places";

const Workbench = onDemand(async () => (await import("./Workbench")).Workbench);
const OfferedDrafts = onDemand(async () => (await import("./Drafts")).OfferedDrafts, null);
const OtherEditors = onDemand(async () => (await import("./Drafts")).OtherEditors, null);
const UnsavedWork = onDemand(async () => (await import("./Drafts")).UnsavedWork, null);

export function BuilderTab() {
  const { study = "" } = useParams({ strict: false });
  return <Answer of={useQuery(studyQuery(study))}>{(detail) => <Begun key={detail.summary.revision} detail={detail} />}</Answer>;
}

const read = (body: Schemas["EditDefinition"]) => unwrap(api.POST("/api/admin/definitions/edit", { body }));

interface Start {
  toml: string;
  data: unknown;
  places: Kept["places"];
  /** How edits of two were brought together; null where there was one alone. */
  meeting: Meeting | null;
}

async function edit({ places, ...body }: Schemas["EditDefinition"] & Pick<Kept, "places">): Promise<Start> {
  const { toml, data } = await read(body);
  return { toml, data, places, meeting: null };
}

/** Kept work put into a version that somebody else saved meanwhile. Text that is not valid TOML stays as it is. */
async function broughtTogether({ toml, data, base, places }: Kept, present: string, stored: readonly Place[]): Promise<Start> {
  const [mine, before, theirs] = await Promise.all([
    read({ toml, data }),
    read({ toml: base ?? "", data: null }),
    read({ toml: present, data: null }),
  ]);
  if (!isTable(mine.data) || !isTable(theirs.data)) return { toml: mine.toml, data: mine.data, places, meeting: null };
  // The merged data are written into the text whose comments were edited; where both were, into theirs.
  const [old, my, their] = [before, mine, theirs].map(({ comments }) => comments);
  const intoMine = isSame(old, their);
  const lost = intoMine || isSame(old, my) ? [] : (my ?? []).filter((comment) => !old?.includes(comment) && !their?.includes(comment));
  const declarations = { base: isTable(before.data) ? before.data : {}, mine: mine.data, theirs: theirs.data };
  const clips = places === null ? undefined : meetingOfClips(places, stored, declarations);
  const meeting = { ...meetingOf(before.data, mine.data, theirs.data), lostComments: lost, ...(clips && { clips }) };
  const merged = await read({ toml: intoMine ? mine.toml : present, data: meeting.merged });
  return { toml: merged.toml, data: merged.data, places: clips?.places ?? null, meeting };
}

/** Begins with work kept in this browser, where there is some, else with what is stored. */
function Begun({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name, revision, rights } = detail.summary;
  const mayEdit = rights.includes("edit");
  const [kept, setKept] = useState<Kept | null>(() => {
    const work = keptWork(name);
    return work !== null && isUnsaved(work, detail.toml) ? work : null;
  });
  const [from, setFrom] = useState({ toml: kept?.toml ?? detail.toml, data: kept?.data ?? null, places: kept?.places ?? null });
  const [others, setOthers] = useState(() => otherWork(name).filter((work) => isUnsaved(work, detail.toml)));
  const isMet =
    kept !== null &&
    from.toml === kept.toml &&
    from.places === kept.places &&
    kept.base !== null &&
    kept.revision !== revision &&
    (kept.base !== detail.toml || kept.places !== null);
  const queries = useQueryClient();
  const meet = async (work: Kept) => {
    const clips = work.places === null ? [] : await queries.query({ ...clipsQuery(name), staleTime: 0 });
    return broughtTogether(work, detail.toml, storedPlaces(clips));
  };
  const start = useQuery({
    queryKey: ["builder start", from, isMet, revision],
    queryFn: () => (isMet ? meet(kept) : edit(from)),
    staleTime: Infinity,
  });
  const without = (draft: Draft) => setOthers((before) => before.filter((one) => one.key !== draft.key));
  // What it replaces in this tab is asked for first; the other tab's draft stays where it is.
  const open = (draft: Draft) => {
    if (keptWork(name) !== null && !window.confirm("Replace the unsaved work in this tab?")) return false;
    without(draft);
    setKept(draft);
    setFrom({ toml: draft.toml, data: draft.data, places: draft.places });
    return true;
  };
  // Also where the server has it, which would offer it again.
  const discard = async (draft: Draft) => {
    forgetDraft(draft.key);
    if (mayEdit) await (await import("./Drafts")).discardDraft(queries, name, tabOf(draft));
    without(draft);
  };
  const startOver = () => {
    forgetWork(name);
    setFrom({ toml: detail.toml, data: null, places: null });
  };
  // What came of the kept work: put into what others saved, or still what saving would replace theirs by.
  const noteOf = (meeting: Meeting | null) => {
    if (kept === null || from.toml !== kept.toml) return null;
    const restored = `Unsaved work from ${when(kept.at)} was restored.`;
    if (kept.revision === revision) return restored;
    const isReplacing = isMet && meeting === null;
    return isReplacing
      ? `${restored} The study has changed since then. Your text is not valid TOML, so saving it would replace those changes.`
      : `${restored} The study has changed since then; ${isMet ? "your changes were put into its present version. The" : "the"} changes that saving would make are listed below.`;
  };
  return (
    <Answer of={start}>
      {(begun) => (
        <Stack key={`${begun.toml}${JSON.stringify(begun.places)}`} gap="sm">
          {noteOf(begun.meeting) !== null && (
            <Group gap="xs" role="status">
              <span>{noteOf(begun.meeting)}</span>
              <Button size="compact-xs" variant="default" onClick={startOver}>
                Discard it
              </Button>
            </Group>
          )}
          {others.map((draft) => (
            <UnsavedWork
              key={draft.key}
              detail={detail}
              draft={draft}
              words={`Another tab has unsaved work from ${when(draft.at)} on this study${draft.revision === revision ? "" : ", based on an earlier version"}.`}
              actions={["Open it here", "Discard it there", "Discard the work"]}
              onOpen={() => open(draft)}
              onDiscard={() => void discard(draft)}
            />
          ))}
          {mayEdit && <OfferedDrafts detail={detail} onOpen={open} />}
          {mayEdit && <OtherEditors study={name} />}
          <Workbench
            detail={detail}
            meeting={begun.meeting}
            start={{
              toml: begun.toml,
              data: isTable(begun.data) ? begun.data : {},
              places: begun.places,
              isUndecided: (begun.meeting?.clips?.both.length ?? 0) > 0,
            }}
          />
        </Stack>
      )}
    </Answer>
  );
}
