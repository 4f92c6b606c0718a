/** Every file of an upload and what became of it; of thousands only those in sight are drawn. */

import { Alert, Badge, Button, Group, Stack, Text } from "@mantine/core";
import { useVirtualizer } from "@tanstack/react-virtual";
import { type RefObject, useRef } from "react";
import { type Schemas, titleOf } from "../api";
import { counted } from "../ui/format";
import { changesOf } from "./ClipCard";
import type { Upload } from "./useUpload";

const ROW_PX = 56;
const MAX_ROWS = 6;

interface Props {
  files: Schemas["UploadedFile"][];
  /** Names of those that are set aside. */
  leftOut: string[];
  upload: Upload;
}

export function FileTable({ files, leftOut, upload }: Props) {
  const frame = useRef<HTMLDivElement>(null);
  // The button that was pressed goes; who works by keyboard stays at the list.
  const leaveOut = (name: string, isLeft: boolean) => {
    upload.leaveOut(name, isLeft);
    frame.current?.focus();
  };
  return (
    <Stack gap="xs">
      {upload.notLeftOut !== null && (
        <Alert color="red" variant="light" title={titleOf(upload.notLeftOut)} role="alert">
          {upload.notLeftOut.message}
        </Alert>
      )}
      <div role="status" aria-label="Left out">
        {leftOut.map((name) => (
          <Group key={name} gap="xs" wrap="nowrap">
            <Text size="sm" className="wrap-anywhere">
              {name} is left out.
            </Text>
            <Button
              size="compact-sm"
              variant="default"
              style={{ flexShrink: 0 }}
              aria-label={`Put back ${name}`}
              onClick={() => leaveOut(name, false)}
            >
              Put back
            </Button>
          </Group>
        ))}
      </div>
      {files.length > 0 && <Rows files={files} frame={frame} onReplace={upload.replace} onLeaveOut={(name) => leaveOut(name, true)} />}
    </Stack>
  );
}

interface RowProps {
  onReplace: (name: string, file: File) => void;
  onLeaveOut: (name: string) => void;
}

function Rows({ files, frame, ...does }: RowProps & { files: Props["files"]; frame: RefObject<HTMLDivElement | null> }) {
  // eslint-disable-next-line react-hooks/incompatible-library -- what it returns is used here alone
  const rows = useVirtualizer({
    count: files.length,
    getScrollElement: () => frame.current,
    estimateSize: () => ROW_PX,
    overscan: 4,
    initialRect: { width: 0, height: ROW_PX * MAX_ROWS },
  });
  return (
    <div
      ref={frame}
      className="long-list"
      style={{ maxBlockSize: ROW_PX * MAX_ROWS }}
      tabIndex={0}
      role="region"
      aria-label="Result for each file"
    >
      <ul style={{ blockSize: rows.getTotalSize() }}>
        {rows.getVirtualItems().map(({ key, index, start }) => {
          const file = files[index];
          return file === undefined ? null : (
            <li
              key={key}
              ref={rows.measureElement}
              data-index={index}
              aria-setsize={files.length}
              aria-posinset={index + 1}
              style={{ transform: `translateY(${String(start)}px)` }}
            >
              <OneFile file={file} {...does} />
            </li>
          );
        })}
      </ul>
    </div>
  );
}

function OneFile({ file, onReplace, onLeaveOut }: RowProps & { file: Schemas["UploadedFile"] }) {
  const { state, source } = file;
  const received = state === "waiting" ? "being checked" : "unchanged";
  const [colour, word] = state === "refused" ? ["red", "refused"] : source != null ? ["blue", "converted"] : ["gray", received];
  return (
    <Group justify="space-between" align="start" wrap="nowrap" gap="xs">
      <div>
        <Text size="sm" className="wrap-anywhere">
          <Badge variant="default" color={colour} size="sm" mr="xs">
            {word}
          </Badge>
          {file.name}
          {state === "refused" && (
            <label>
              {" "}
              Replace with:{" "}
              <input
                type="file"
                accept="video/*,.mkv,.mxf,.y4m"
                aria-label={`Replace ${file.name} by`}
                onChange={({ target }) => {
                  if (target.files?.[0]) onReplace(file.name, target.files[0]);
                  // The same file, corrected, is a change again.
                  target.value = "";
                }}
              />
            </label>
          )}
        </Text>
        <Text size="xs" c={state === "refused" ? "var(--mantine-color-error)" : "dimmed"} className="wrap-anywhere">
          {file.problem ?? `${sizeOf(file)}${source == null ? "" : `; ${changesOf(source)}`}`}
        </Text>
      </div>
      <Button
        size="compact-sm"
        variant="default"
        style={{ flexShrink: 0 }}
        aria-label={`Leave out ${file.name}`}
        onClick={() => onLeaveOut(file.name)}
      >
        Leave out
      </Button>
    </Group>
  );
}

function sizeOf({ frames, fps, width_px, height_px }: Schemas["UploadedFile"]): string {
  return frames == null || fps == null ? "" : `${counted(frames, "frame")} at ${Number(fps.toFixed(3))} fps, ${width_px} x ${height_px}`;
}
