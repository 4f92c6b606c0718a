/** A clip with what it shows, and what it was converted from. */

import { Button, Anchor, Card, Text, SimpleGrid } from "@mantine/core";
import { useRef, useState, useLayoutEffect } from "react";
import type { Schemas } from "../api";
import { counted } from "../ui/format";
import { onDemand } from "../ui/Answer";
import { useElementSize } from "@mantine/hooks";
import { useWindowVirtualizer } from "@tanstack/react-virtual";

// A clip without controls over the eyes: a button below plays it from its start.

function ClipVideo({ url, label }: { url: string; label: string }) {
  const video = useRef<HTMLVideoElement>(null);
  const [playing, setPlaying] = useState(false);
  const play = () => {
    if (video.current === null) return;
    video.current.currentTime = 0;
    void video.current.play();
  };
  return (
    <>
      <video
        ref={video}
        className="clip"
        src={url}
        muted
        playsInline
        preload="auto"
        aria-label={label}
        onPlay={() => setPlaying(true)}
        onPause={() => setPlaying(false)}
      />
      <Button
        size="compact-sm"
        variant="default"
        mt="xs"
        style={{ alignSelf: "flex-start" }}
        disabled={playing}
        onClick={play}
        aria-label={`Play ${label}`}
      >
        Play
      </Button>
    </>
  );
}

/** What a conversion did, in words: its steps, and how far the clip is from what was encoded. */
export function changesOf(source: Schemas["SourceVideo"]): string {
  const { changes, encoded_again, lowest_psnr_db, colour_range } = source;
  if (!encoded_again) return `${changes.join("; ")}; frames copied unchanged`;
  const quality = lowest_psnr_db == null ? "identical pixels" : `worst frame ${lowest_psnr_db.toFixed(1)} dB PSNR`;
  return [...changes, quality, colour_range === "not said" ? "color range not stated, assumed limited" : ""].filter(Boolean).join("; ");
}

const ClosureFigure = onDemand(async () => (await import("../ui/PlotFigure")).ClosureFigure);

/** @param label the cell's name; by itself that of its levels */
export function ClipCard({ study, clip, label = clip.cell }: { study: string; clip: Schemas["ClipOut"]; label?: string | undefined }) {
  const name = `${label}, no. ${clip.exemplar}`;
  return (
    <Card withBorder padding="sm">
      <Text size="sm" fw={600} className="wrap-anywhere" mb={6}>
        {name}
      </Text>
      <ClipVideo url={clip.url} label={name} />
      <Text size="xs" c="dimmed" mt={6} className="wrap-anywhere">
        {clip.profile !== "" && `${clip.profile}, `}
        {counted(clip.frames, "frame")} at {Number(clip.fps.toFixed(3))} fps, {Math.round(clip.bytes / 1024)} KiB
      </Text>
      {clip.source != null && <Origin study={study} source={clip.source} />}
      {clip.closure.length > 0 && <ClosureFigure closure={clip.closure} label="Closure over time" />}
    </Card>
  );
}

function Origin({ study, source }: { study: string; source: Schemas["SourceVideo"] }) {
  const address = `/api/admin/studies/${study}/originals/${source.sha256}`;
  return (
    <Text size="xs" c="dimmed" className="wrap-anywhere">
      Converted from{" "}
      <Anchor href={address} download size="xs" underline="always">
        {source.file}
      </Anchor>
      : {changesOf(source)}.{" "}
      <Anchor href={`${address}/frame-map.csv`} download size="xs" underline="always">
        Frame map
      </Anchor>
    </Text>
  );
}

// Clips in rows that follow the page's scrolling; of thousands only those in sight are there.

const CARD_PX = 330;
const ROW_PX = 260;
const GAP_PX = 16;

export function ClipGrid({ study, clips }: { study: string; clips: Schemas["ClipOut"][] }) {
  const { ref: measured, width } = useElementSize<HTMLDivElement>();
  const list = useRef<HTMLUListElement>(null);
  const [scrollMargin, setScrollMargin] = useState(0);
  useLayoutEffect(() => setScrollMargin(list.current?.offsetTop ?? 0), [width]);
  const columns = Math.min(3, Math.max(1, Math.round(width / CARD_PX)));
  const rows = useWindowVirtualizer({
    count: width === 0 ? 0 : Math.ceil(clips.length / columns),
    estimateSize: () => ROW_PX,
    gap: GAP_PX,
    overscan: 2,
    scrollMargin,
  });
  return (
    <div ref={measured}>
      <ul ref={list} className="clip-rows" aria-label="Clips" style={{ blockSize: rows.getTotalSize() }}>
        {rows.getVirtualItems().map(({ key, index, start }) => (
          <li key={key} ref={rows.measureElement} data-index={index} style={{ transform: `translateY(${String(start - scrollMargin)}px)` }}>
            <SimpleGrid cols={columns} spacing={GAP_PX}>
              {clips.slice(index * columns, (index + 1) * columns).map((clip) => (
                <ClipCard key={`${clip.cell}${String(clip.exemplar)}`} study={study} clip={clip} />
              ))}
            </SimpleGrid>
          </li>
        ))}
      </ul>
    </div>
  );
}
