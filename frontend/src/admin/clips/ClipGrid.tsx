/** Clips in rows that follow the page's scrolling; of thousands only those in sight are there. */

import { SimpleGrid } from "@mantine/core";
import { useElementSize } from "@mantine/hooks";
import { useWindowVirtualizer } from "@tanstack/react-virtual";
import { useLayoutEffect, useRef, useState } from "react";
import type { Schemas } from "../api";
import { ClipCard } from "./ClipCard";

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
