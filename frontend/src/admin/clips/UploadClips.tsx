/** The user's own clips: choose or drop them, upload and examine them, and see the result of each. */

import type { Schemas } from "../api";
import { Alert, Button, FileInput, Group, Progress, Select, Stack, Text } from "@mantine/core";
import { type ReactNode, useState } from "react";
import { onDemand } from "../ui/Answer";
import { DropZone } from "../ui/DropZone";
import { counted } from "../ui/format";
import { LeftOut, type Upload } from "./useUpload";

type Sized = Pick<Schemas["UploadedFile"], "name" | "width_px" | "height_px">;

const sizeOf = ({ width_px, height_px }: Sized) => `${width_px} x ${height_px}`;
const isUpright = ({ width_px, height_px }: Sized) => (height_px ?? 0) > (width_px ?? 0);

/** A remark on clips whose size differs from that of most; null where all have one size. */
export function sizeRemark(files: readonly Sized[]): string | null {
  const groups = new Map<string, Sized[]>();
  for (const file of files.filter(({ width_px, height_px }) => width_px != null && height_px != null))
    groups.set(sizeOf(file), [...(groups.get(sizeOf(file)) ?? []), file]);
  const [most = [], ...others] = [...groups.values()].sort((a, b) => b.length - a.length);
  const odd = others.flat();
  const [usual] = most;
  const [first] = odd;
  if (usual === undefined || first === undefined) return null;
  const named = odd.length === 1 ? `${first.name} is` : `${first.name} and ${odd.length - 1} more are`;
  const sizes = others.slice(0, 3).flatMap(([one]) => (one === undefined ? [] : sizeOf(one)));
  const turned = odd.some((file) => isUpright(file) !== isUpright(usual)) ? " Is one rotated incorrectly?" : "";
  const rest = most.length > odd.length ? "most" : "others";
  return `${named} ${sizes.join(" or ")} pixels, ${rest} are ${sizeOf(usual)}.${turned} Participants will notice the size difference. Is this intended?`;
}

const MAX_PAIRS = 8;
const RATES = ["24", "25", "30", "50", "60"];
const ENDINGS = ".mp4,.m4v,.mov,.webm,.mkv,.avi,.mpg,.mpeg,.m2v,.ts,.mts,.m2ts,.wmv,.flv,.gif,.apng,.ogv,.3gp,.mxf,.y4m";
const FileTable = onDemand(async () => (await import("./FileTable")).FileTable);

interface Props {
  upload: Upload;
  label?: string;
  description?: ReactNode;
  accept?: string;
}

export function UploadClips({ upload, label = "Clips", description, accept = `.zip,${ENDINGS},.csv` }: Props) {
  return (
    <Stack gap="sm">
      <DropZone onDrop={upload.send}>
        <FileInput
          label={label}
          description={
            description ??
            "Videos in any common format, or a zip file. A CSV with the levels may be included. Sound is removed. Choose files, or drop them here."
          }
          placeholder="Choose files"
          accept={accept}
          multiple
          value={[]}
          onChange={(files) => files.length > 0 && upload.send(files)}
        />
      </DropZone>
      <details>
        <summary className="small-summary">More: frame rate</summary>
        <Select
          label="Frame rate"
          description="A video with a variable rate gets its most common rate. Frames are repeated or dropped, never blended."
          data={[
            { value: "own", label: "Keep each clip's rate" },
            ...RATES.map((rate) => ({ value: rate, label: `${rate} frames per second` })),
          ]}
          value={upload.fps === null ? "own" : String(upload.fps)}
          allowDeselect={false}
          onChange={(value) => upload.askFps(value === null || value === "own" ? null : Number(value))}
          maw={500}
        />
      </details>
      <UploadProgress upload={upload} />
      {upload.received !== null && <Received upload={upload} received={upload.received} />}
    </Stack>
  );
}

function UploadProgress({ upload: { sending, broken, progress, goOn } }: { upload: Upload }) {
  if (broken instanceof LeftOut) {
    return (
      <Alert color="yellow" title={`${count(broken.reasons.length)} of the files left out`} role="alert">
        {broken.reasons.slice(0, MAX_PAIRS).map((reason) => (
          <Text key={reason} size="sm">
            {reason}
          </Text>
        ))}
        {broken.reasons.length > MAX_PAIRS && <Text size="sm">And {count(broken.reasons.length - MAX_PAIRS)} more.</Text>}
      </Alert>
    );
  }
  if (broken !== null) {
    return (
      <Alert color="red" variant="light" title="The upload stopped" role="alert">
        <Text size="sm">{broken.message} The part uploaded so far is kept.</Text>
        <Button mt="xs" size="xs" variant="default" onClick={goOn}>
          Continue
        </Button>
      </Alert>
    );
  }
  const looked = progress === null ? 0 : progress.files - progress.waiting;
  const isLooking = progress !== null && progress.waiting > 0;
  return (
    <div role="status" aria-label="Upload">
      {sending !== null && (
        <Bar words={`Sending: ${count(sending.sent)} of ${count(sending.of)} files`} share={sending.sent / sending.of} name="Files sent" />
      )}
      {isLooking && (
        <Bar
          words={`Checking and converting clips: ${count(looked)} of ${count(progress.files)}`}
          share={looked / progress.files}
          name="Clips checked"
        />
      )}
    </div>
  );
}

const count = (number: number) => number.toLocaleString("en");

function Bar({ words, share, name }: { words: string; share: number; name: string }) {
  return (
    <Stack gap={4} mb="xs">
      <Text size="sm" className="number">
        {words}
      </Text>
      <Progress value={100 * share} aria-label={name} />
    </Stack>
  );
}

function Received({ upload, received }: { upload: Upload; received: Schemas["UploadOut"] }) {
  const { files } = received;
  const [isListed, setListed] = useState(false);
  const refused = files.filter(({ state }) => state === "refused").length;
  const changed = files.filter(({ source }) => source != null).length;
  const size = sizeRemark(files);
  const twice = files.filter(({ same_as }) => same_as != null);
  return (
    <Stack gap="xs">
      <Group justify="space-between">
        <Text>
          {count(files.length)} {files.length === 1 ? "clip" : "clips"} uploaded
          {!received.has_manifest && refused + changed > 0 && summary(files.length - refused - changed, changed, refused)}.
        </Text>
        <Button size="compact-sm" variant="default" onClick={upload.forget}>
          Start over
        </Button>
      </Group>
      {refused > 0 && (
        <Alert color="red" variant="light" title={`${counted(refused, "file")} cannot be used`}>
          <Text size="sm">The list below says what to correct; choose the corrected files there. The other files stay.</Text>
        </Alert>
      )}
      {upload.plays === null && (
        <Text size="sm" role="status">
          Testing the clips in this browser…
        </Text>
      )}
      {upload.plays === "unknown" && (
        <Alert color="yellow">
          This browser cannot test whether participants will see these clips: it has no H.264 decoder, or the address is not https. Open
          this page in a current Chrome, Edge, Firefox or Safari.
        </Alert>
      )}
      {upload.isReplacing && (
        <Text size="sm" role="status">
          Sending the file…
        </Text>
      )}
      {upload.notReplaced !== null && (
        <Alert color="red" variant="light" title="The file was not replaced" role="alert">
          {upload.notReplaced.message}
        </Alert>
      )}
      {twice.length > 0 && (
        <Alert color="yellow">
          The same bytes:{" "}
          {twice
            .slice(0, MAX_PAIRS)
            .map(({ name, same_as }) => `${name} as ${same_as}`)
            .join(", ")}
          {twice.length > MAX_PAIRS && ` and ${count(twice.length - MAX_PAIRS)} more`}. Where they stand for different levels, one is the
          wrong file.
        </Alert>
      )}
      {size !== null && <Alert color="yellow">{size}</Alert>}
      {upload.remarks.map((remark) => (
        <Alert key={remark} color="yellow">
          {remark}
        </Alert>
      ))}
      {!received.has_manifest && (
        <details open={isListed || refused > 0 || received.left_out.length > 0} onToggle={(event) => setListed(event.currentTarget.open)}>
          <summary className="small-summary">Review the files, or leave some out</summary>
          <FileTable files={inOrder(files)} leftOut={received.left_out} upload={upload} />
        </details>
      )}
    </Stack>
  );
}

const ORDER = { refused: 0, waiting: 1, ready: 2 };

/** What needs a hand first, then what was converted. */
function inOrder(files: Schemas["UploadedFile"][]): Schemas["UploadedFile"][] {
  const rank = ({ state, source }: Schemas["UploadedFile"]) => ORDER[state] + (source == null ? 0.5 : 0);
  return [...files].sort((a, b) => rank(a) - rank(b));
}

function summary(shown: number, changed: number, refused: number): string {
  if (shown + refused === 0) return changed === 1 ? " and converted" : ", all converted";
  const parts = [
    shown > 0 && `${count(shown)} unchanged`,
    changed > 0 && `${count(changed)} converted`,
    refused > 0 && `${count(refused)} unusable`,
  ];
  return `: ${parts.filter(Boolean).join(", ")}`;
}

/** Why a button cannot be pressed: what has to be given before. */
export function StillNeeded({ parts }: { parts: readonly (string | false)[] }) {
  const needed = parts.filter((part) => part !== false);
  if (needed.length === 0) return null;
  return (
    <Text size="sm" role="status">
      Still needed: {needed.join(", ")}.
    </Text>
  );
}
