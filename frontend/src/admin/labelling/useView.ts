/** Zoom and pan of a picture in an element: screen = (pixel + 0.5) * scale + offset. */

import { useElementSize } from "@mantine/hooks";
import { useCallback, useMemo, useState } from "react";
import type { Point, Shape, Size } from "../../labelling/points";

export interface View {
  readonly scale: number;
  readonly x: number;
  readonly y: number;
}

const LARGEST_SCALE = 40;

/** The view that shows a rectangle of the picture whole. */
function showing([left, top]: Point, [right, bottom]: Point, width: number, height: number): View {
  const scale = Math.min(LARGEST_SCALE, width / (right - left), height / (bottom - top));
  return { scale, x: width / 2 - ((left + right) / 2) * scale, y: height / 2 - ((top + bottom) / 2) * scale };
}

export function toScreen({ scale, x, y }: View, point: Point): Point {
  return [(point[0] + 0.5) * scale + x, (point[1] + 0.5) * scale + y];
}

export function toPicture({ scale, x, y }: View, [sx, sy]: Point): Point {
  return [(sx - x) / scale - 0.5, (sy - y) / scale - 0.5];
}

export function useView([imageWidth, imageHeight]: Size) {
  const { ref, width, height } = useElementSize<HTMLDivElement>();
  const [state, setState] = useState<{ of: string; view: View } | null>(null);
  const fitted = useMemo(() => {
    const ready = width > 0 && height > 0;
    return ready ? showing([0, 0], [imageWidth, imageHeight], width, height) : { scale: 1, x: 0, y: 0 };
  }, [imageWidth, imageHeight, width, height]);
  // A view chosen for one picture means nothing in a picture of another size.
  const picture = `${imageWidth} x ${imageHeight}`;
  const view = state?.of === picture ? state.view : fitted;
  const change = useCallback(
    (next: (now: View) => View) => setState((before) => ({ of: picture, view: next(before?.of === picture ? before.view : fitted) })),
    [picture, fitted],
  );

  const zoom = useCallback(
    (factor: number, at: Point = [width / 2, height / 2]) =>
      change((now) => {
        const scale = Math.min(LARGEST_SCALE, Math.max(fitted.scale / 2, now.scale * factor));
        const ratio = scale / now.scale;
        return { scale, x: at[0] - (at[0] - now.x) * ratio, y: at[1] - (at[1] - now.y) * ratio };
      }),
    [width, height, fitted, change],
  );
  const pan = useCallback((dx: number, dy: number) => change((now) => ({ ...now, x: now.x + dx, y: now.y + dy })), [change]);
  const showShape = useCallback(
    (shape: Shape) => {
      const [xs, ys] = [shape.map(([x]) => x), shape.map(([, y]) => y)];
      const [left, right] = [Math.min(...xs), Math.max(...xs)];
      const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
      const room = 0.15 * (right - left) + 4;
      change(() => showing([left - room, top - room], [right + room, bottom + room], width, height));
    },
    [width, height, change],
  );
  return { ref, width, height, view, zoom, pan, showShape, fit: () => setState(null) };
}
