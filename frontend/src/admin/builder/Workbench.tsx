/** What is edited: pages of forms, the TOML next to them, and the bar that saves. */

import { Alert, List, Button, Group, Modal, NavLink, SegmentedControl, Select, Stack, Switch, Text, TextInput, Title } from "@mantine/core";
import { useDebouncedValue, useHotkeys } from "@mantine/hooks";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { api, Refused, type Schemas, unwrap } from "../api";
import { adminKind } from "../kinds";
import { counted, plain } from "../ui/format";
import { Link, useNavigate, useSearch } from "@tanstack/react-router";
import { useState } from "react";
import { DesignLine, TomlText } from "../studies/Design";
import { TurnedAway } from "../studies/StatusBadge";
import { onDemand } from "../ui/Answer";
import { useChange } from "../ui/useChange";
import { isTable, placeOf, placeTitle, type Section } from "./data";
import { Field } from "./fields/Field";
import { Forms, Texts } from "./Forms";
import { type Meeting, type MeetingEdit, placeInWords, placeName, withChange } from "./history";
import { forgetUpload } from "../clips/useUpload";
import { forgetWork } from "./kept";
import { type ClipMeeting, placesToSave } from "./places";
import { EXPERIMENT, sectionOf, SECTIONS } from "./schema";
import { TrialPreview } from "./TrialPreview";
import { type Builder, BuilderContext, useBuilder, useBuilderHere } from "./useBuilder";

const SentDraft = onDemand(async () => (await import("./Drafts")).SentDraft, null);
const LevelGrid = onDemand(async () => (await import("./LevelGrid")).LevelGrid);

// What saving an edited definition would do to the answers that are there: said before it is saved.

function JudgedEdit({ detail, builder }: { detail: Schemas["StudyDetail"]; builder: Builder }) {
  const { name } = detail.summary;
  const [settled] = useDebouncedValue(JSON.stringify(editOf(builder)), 500);
  const { data } = useQuery({
    queryKey: ["study", name, "judged", settled],
    queryFn: () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/versions/check", {
          params: { path: { study: name } },
          body: JSON.parse(settled) as Schemas["EditedVersion"],
        }),
      ),
    retry: false,
  });
  if (data === undefined || data.changes.length === 0) return null;
  return (
    <Alert color={data.begins_series ? "yellow" : "blue"} variant="light" title={title(data, detail)} role="status">
      {effect(data, detail)}
      <List size="sm" mt="xs">
        {data.changes.map((change) => (
          <List.Item key={change.path}>
            {inWords(change)}
            {data.begins_series && change.effect === "wording" ? " (wording)" : ""}
          </List.Item>
        ))}
      </List>
    </Alert>
  );
}

/** "The text “Consent” in English: A becomes B", of a text that names the key as the TOML has it. */
function inWords({ path, text }: Schemas["JudgedEdit"]["changes"][number]): string {
  if (!text.startsWith(path)) return text;
  return `${placeTitle(path.split("."))}${text.slice(path.length)}`;
}

/** What is saved, and judged before: the text, and the clips if some were moved. */
function editOf({ toml, data, places, moved }: Builder): Schemas["EditedVersion"] {
  return { toml, places: moved && places !== null ? placesToSave(places, data) : null };
}

/** Whether nobody has taken part in any version, so that nothing can be pooled or kept apart. */
const isUntouched = (edit: Schemas["JudgedEdit"], detail: Schemas["StudyDetail"]) =>
  edit.runs === 0 && elsewhere(detail, edit.present_series) === "";

function title(edit: Schemas["JudgedEdit"], detail: Schemas["StudyDetail"]): string {
  if (edit.begins_series) return "Saving starts a new data series";
  if (isUntouched(edit, detail)) return "Not saved yet";
  return edit.series === edit.present_series ? "Answers may be pooled" : `Answers join series ${edit.series}`;
}

/** What happens to the answers that are there once a new data series begins, in sentences. */
function consequence(edit: Schemas["JudgedEdit"], { series, definition }: Schemas["StudyDetail"]): string {
  const present = series.find(({ number }) => number === edit.present_series);
  const people = present?.runs["participant"] ?? 0;
  const raters = people > 0 ? counted(people, "participant") : counted(edit.runs, "run");
  // The ends of a scale are what its answers mean.
  const { trial } = definition;
  const scale = edit.changes.some(({ path }) => path.startsWith("trial.scale")) ? adminKind(trial.kind).scaleEnds?.(trial) : null;
  const on = scale ? ` on ${scale.minimum}-${scale.maximum}` : "";
  const kept = present === undefined ? `series ${edit.present_series}` : present.name;
  return `${raters} answered${on}. This version starts a new data series (series ${edit.series}). Existing answers stay separate, in ${kept}; results and reports do not combine the two.`;
}

/** Where the runs are if the present series has none. */
function elsewhere({ series }: Schemas["StudyDetail"], present: number): string {
  const total = (runs: Record<string, number>) => Object.values(runs).reduce((sum, number) => sum + number, 0);
  return series
    .filter(({ number, runs }) => number !== present && total(runs) > 0)
    .map(({ name, runs }) => `${counted(total(runs), "run is", "runs are")} in ${name}`)
    .join("; ");
}

function effect(edit: Schemas["JudgedEdit"], detail: Schemas["StudyDetail"]): string {
  if (edit.begins_series) return `This changes what is measured. ${consequence(edit, detail)}`;
  if (edit.runs === 0) {
    const others = elsewhere(detail, edit.present_series);
    return others === ""
      ? "Saving makes a new version of the draft. No one has taken part yet, so no answers are affected."
      : `Series ${edit.present_series} has no runs yet; ${others}.`;
  }
  return `Further runs belong to series ${edit.series}.`;
}

interface Props {
  detail: Schemas["StudyDetail"];
  start: Parameters<typeof useBuilder>[1];
  meeting: Meeting | null;
}

export function Workbench({ detail, start, meeting }: Props) {
  const { name } = detail.summary;
  const builder = useBuilder(detail, start);
  const [withToml, setWithToml] = useState(false);
  const { section: asked }: { section?: unknown } = useSearch({ strict: false });
  const section = SECTIONS.find(({ id }) => id === asked) ?? SECTIONS[0];
  useHotkeys(
    [
      ["mod+Z", () => builder.undo?.()],
      ["mod+shift+Z", () => builder.redo?.()],
      ["mod+Y", () => builder.redo?.()],
    ],
    [],
  );
  if (section === undefined) return null;
  const wrong = builder.problems.length > 0;
  return (
    <BuilderContext value={builder}>
      <Bar detail={detail} builder={builder} withToml={withToml} onWithToml={setWithToml} />
      {meeting !== null && <Met meeting={meeting} version={detail.summary.version} />}
      <div className={withToml ? "builder with-toml" : "builder"}>
        <Sections study={name} builder={builder} current={section.id} />
        <Stack gap="sm" className="builder-page">
          <div>
            <Title order={2} size="h3">
              {section.label}
            </Title>
            <Text size="sm" c="dimmed">
              {section.about}
            </Text>
          </div>
          {builder.broken ? (
            <Alert color="yellow">This is not valid TOML. Correct the text or undo; the forms return then.</Alert>
          ) : (
            <Page key={section.id} study={name} section={section} rendered={detail.rendered} />
          )}
        </Stack>
        {withToml && <TomlText toml={builder.toml} onChange={builder.setToml} problems={builder.problems} rows={40} />}
      </div>
      {wrong && <Wrong study={name} builder={builder} />}
      {builder.changed && !builder.writing && !wrong && <JudgedEdit detail={detail} builder={builder} />}
      {builder.design !== null && !wrong && <DesignLine design={builder.design} />}
    </BuilderContext>
  );
}

/** What somebody else changed meanwhile, and for each field that both changed, whose words stay. */
function Met({ meeting: { both, theirs, lostComments = [], clips }, version }: { meeting: Meeting; version: number }) {
  const builder = useBuilderHere();
  const [taken, setTaken] = useState<readonly string[]>([]);
  const choose = ({ path, mine, theirs: other }: MeetingEdit, whose: string) => {
    const change = whose === "theirs" ? other : mine;
    setTaken(whose === "theirs" ? [...taken, path] : taken.filter((one) => one !== path));
    builder.set([], withChange(builder.data, change.at, change.after));
  };
  const moved = { both: clips?.both ?? [], theirs: clips?.theirs ?? [] };
  if ([both, theirs, lostComments, moved.both, moved.theirs].every(({ length }) => length === 0)) return null;
  return (
    <Alert
      color={both.length + moved.both.length > 0 ? "yellow" : "blue"}
      variant="light"
      title={`Version ${String(version)} was saved while you edited`}
    >
      {theirs.length > 0 && (
        <>
          <Text size="sm">Kept from version {version}:</Text>
          <List size="sm">
            {theirs.map((change) => (
              <List.Item key={placeName(change.at)} className="wrap-anywhere">
                {placeInWords(change.at)}: {shortly(change.after)}
              </List.Item>
            ))}
          </List>
        </>
      )}
      {lostComments.length > 0 && (
        <Text size="sm" className="wrap-anywhere">
          You both changed comments in the TOML. These of yours are not in the merged text: {lostComments.join(" ")}
        </Text>
      )}
      {moved.theirs.length > 0 && (
        <Text size="sm" className="wrap-anywhere">
          Clips where version {version} has them: {namesOf(moved.theirs)}
        </Text>
      )}
      {clips !== undefined && moved.both.length > 0 && <MetClips clips={clips} version={version} />}
      {both.length > 0 && <Text size="sm">You both changed {counted(both.length, "field")}. Choose what stays:</Text>}
      {both.map((edit) => (
        <Stack key={edit.path} gap={4} mt="xs" role="group" aria-label={placeTitle(edit.path.split("."))}>
          <Text size="sm" className="wrap-anywhere">
            {placeTitle(edit.path.split("."))} in version {version}: {shortly(edit.theirs.after)}; yours: {shortly(edit.mine.after)}
          </Text>
          <SegmentedControl
            size="xs"
            aria-label={`Keep which version of ${placeOf(edit.path.split("."))}`}
            style={{ alignSelf: "flex-start" }}
            value={taken.includes(edit.path) ? "theirs" : "mine"}
            onChange={(whose) => choose(edit, whose)}
            data={[
              { value: "mine", label: "Yours" },
              { value: "theirs", label: `Version ${String(version)}` },
            ]}
          />
        </Stack>
      ))}
    </Alert>
  );
}

/** Clips that both moved: theirs until somebody takes their own, as those would undo moves that are saved. */
function MetClips({ clips, version }: { clips: ClipMeeting; version: number }) {
  const { arrange } = useBuilderHere();
  const [whose, setWhose] = useState("theirs");
  const choose = (next: string) => {
    setWhose(next);
    arrange(next === "mine" ? clips.mine : clips.places);
  };
  return (
    <Stack gap={4} mt="xs" role="group" aria-label="Clips that you both moved">
      <Text size="sm" className="wrap-anywhere">
        You both moved clips: {namesOf(clips.both)}. They are where version {version} has them until you choose yours.
      </Text>
      <SegmentedControl
        size="xs"
        aria-label="Where these clips are"
        style={{ alignSelf: "flex-start" }}
        value={whose}
        onChange={choose}
        data={[
          { value: "theirs", label: `Version ${String(version)}` },
          { value: "mine", label: "Yours" },
        ]}
      />
    </Stack>
  );
}

const MAX_SHOWN = 160;

function shortly(value: unknown): string {
  if (value === undefined) return "removed";
  const text = plain(value);
  return text.length > MAX_SHOWN ? `${text.slice(0, MAX_SHOWN)} …` : text;
}

function Page({ study, section, rendered }: { study: string; section: Section; rendered: boolean }) {
  const builder = useBuilderHere();
  // Clips that were uploaded have no rendering: its keys would say nothing.
  const keys = section.keys.filter((key) => key !== "render" || rendered || isTable(builder.data["render"]));
  if (section.id === "forms") return <Forms />;
  if (section.id === "texts") return <Texts />;
  return (
    <Stack gap="sm">
      {section.id === "trial" && <TrialPreview />}
      {section.id === "factors" && builder.places !== null && <LevelGrid study={study} />}
      {section.id === "screen" && <TurnedAway study={study} design={builder.design ?? undefined} isHere />}
      {keys
        .map((key) => [key, EXPERIMENT.properties?.[key]] as const)
        .map(([key, schema]) =>
          schema === undefined ? null : (
            <Field key={key} path={[key]} schema={schema} required={EXPERIMENT.required?.includes(key) ?? false} />
          ),
        )}
    </Stack>
  );
}

interface BeginSeriesProps {
  edit: Schemas["JudgedEdit"];
  detail: Schemas["StudyDetail"];
  onClose: () => void;
  onConfirm: () => void;
}

/** Asked before an edit is saved that keeps the answers so far apart from those to come. */
function BeginSeries({ edit, detail, onClose, onConfirm }: BeginSeriesProps) {
  return (
    <Modal opened onClose={onClose} title={`Start data series ${edit.series}?`} closeButtonProps={{ "aria-label": "Close" }}>
      <Text>{consequence(edit, detail)}</Text>
      <List size="sm" mt="xs">
        {edit.changes
          .filter(({ effect }) => effect === "measured")
          .map(({ path, text }) => (
            <List.Item key={path}>{inWords({ path, text, effect: "measured" })}</List.Item>
          ))}
      </List>
      <Group justify="flex-end" mt="md">
        <Button variant="default" onClick={onClose}>
          Cancel
        </Button>
        <Button color="red" onClick={onConfirm}>
          Save and start series {edit.series}
        </Button>
      </Group>
    </Modal>
  );
}

interface BarProps {
  detail: Schemas["StudyDetail"];
  builder: Builder;
  withToml: boolean;
  onWithToml: (withToml: boolean) => void;
}

function Bar({ detail, builder, withToml, onWithToml }: BarProps) {
  const { name, revision, status } = detail.summary;
  const [note, setNote] = useState("");
  const queries = useQueryClient();
  const save = useChange(
    () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/versions", {
          params: { path: { study: name } },
          body: {
            revision,
            note,
            ...editOf(builder),
            upload: builder.places?.find((one) => one.upload !== null && one.exemplar > 0)?.upload ?? null,
          },
        }),
      ),
    {
      touches: [
        ["study", name],
        ["clips", name],
      ],
      done: "Saved as a new version.",
      before: () => {
        forgetWork(name);
        if (builder.moved) forgetUpload(`study ${name}`);
      },
      // Somebody else saved meanwhile: their version is loaded, and the work kept here is put into it.
      refused: (error) => {
        if (!(error instanceof Refused) || error.status !== 409 || error.code !== "edited_meanwhile") return false;
        void queries.invalidateQueries({ queryKey: ["study", name] });
        return true;
      },
    },
  );
  const [asked, setAsked] = useState<Schemas["JudgedEdit"] | null>(null);
  // Judged at the press, not while typing: what is saved is what was judged.
  const judge = useChange(
    () => unwrap(api.POST("/api/admin/studies/{study}/versions/check", { params: { path: { study: name } }, body: editOf(builder) })),
    {
      touches: [],
      then: (edit) => {
        if (edit.begins_series) setAsked(edit);
        else save.mutate(undefined);
      },
    },
  );
  const ready = builder.changed && !builder.writing && !builder.broken && builder.problems.length === 0 && builder.empty.length === 0;
  return (
    <div className="builder-bar">
      <Group gap="xs" align="end">
        <Button disabled={!ready} loading={save.isPending || judge.isPending} onClick={() => judge.mutate(undefined)}>
          Save as a new version
        </Button>
        {asked !== null && (
          <BeginSeries
            edit={asked}
            detail={detail}
            onClose={() => setAsked(null)}
            onConfirm={() => {
              setAsked(null);
              save.mutate(undefined);
            }}
          />
        )}
        <TextInput
          aria-label="What changed"
          placeholder="What changed (a note)"
          value={note}
          onChange={(event) => setNote(event.currentTarget.value)}
          w={220}
        />
        <Button variant="default" disabled={builder.undo === null} onClick={() => builder.undo?.()}>
          Undo
        </Button>
        <Button variant="default" disabled={builder.redo === null} onClick={() => builder.redo?.()}>
          Redo
        </Button>
        <Button variant="default" disabled={!builder.changed} onClick={builder.reset}>
          Discard changes
        </Button>
        <Switch label="Show TOML" checked={withToml} onChange={(event) => onWithToml(event.currentTarget.checked)} mb={6} />
      </Group>
      <Text size="xs" c="dimmed" role="status" mt={4}>
        {builder.error !== null
          ? `${builder.error.message} Your work is still in this browser.`
          : builder.changed
            ? "Not saved; your work is in this browser."
            : `Saved as version ${detail.summary.version}.`}
        {detail.summary.rights.includes("edit") && <SentDraft detail={detail} builder={builder} />}
        {builder.empty.length > 0 && ` Clips are missing: ${namesOf(builder.empty)}.`}
        {status === "live" && " This study is live: saving creates a new version. Runs in progress keep theirs."}
      </Text>
    </div>
  );
}

const MAX_NAMED = 4;

/** "rosie/slow, no. 2; rosie/fast, no. 2 and 3 more" */
function namesOf(names: readonly string[]): string {
  const more = names.length - MAX_NAMED;
  return `${names.slice(0, MAX_NAMED).join("; ")}${more > 0 ? ` and ${String(more)} more` : ""}`;
}

function Sections({ study, builder, current }: { study: string; builder: Builder; current: string }) {
  const navigate = useNavigate();
  const count = (section: Section) => builder.problems.filter((problem) => sectionOf(problem.path)?.id === section.id).length;
  const mark = (section: Section) => (count(section) > 0 ? `${section.label} (${count(section)} to fix)` : section.label);
  return (
    <>
      <Select
        hiddenFrom="sm"
        label="Page of the builder"
        allowDeselect={false}
        data={SECTIONS.map((section) => ({ value: section.id, label: mark(section) }))}
        value={current}
        onChange={(id) => void navigate({ to: `/studies/${study}/build`, search: { section: id } })}
      />
      <nav className="builder-sections mantine-visible-from-sm" aria-label="Pages of the builder">
        {SECTIONS.map((section) => (
          <NavLink
            key={section.id}
            renderRoot={(props) => <Link {...props} to="/studies/$study/build" params={{ study }} search={{ section: section.id }} />}
            label={mark(section)}
            active={section.id === current}
          />
        ))}
      </nav>
    </>
  );
}

function Wrong({ study, builder }: { study: string; builder: Builder }) {
  return (
    <Alert color="red" variant="light" title="Not ready yet" role="status">
      {builder.problems.slice(0, 12).map((problem) => (
        <Text size="sm" key={`${problem.path}${problem.message}`}>
          <Link to="/studies/$study/build" params={{ study }} search={{ section: sectionOf(problem.path)?.id ?? "study" }}>
            {problem.path === "" ? "TOML" : placeTitle(problem.path.split("."))}
            {problem.line !== null && ` (line ${problem.line})`}
          </Link>
          : {problem.message}
        </Text>
      ))}
    </Alert>
  );
}
