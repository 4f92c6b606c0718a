/** A frame with its points: drag, zoom, pan; every point can be reached and moved by keyboard. */

import { useElementSize } from "@mantine/hooks";
import { useCallback, useMemo, useState, type PointerEvent, useEffect, useRef } from "react";
import { type Point, type Shape, type Size, EYE_POINTS, eyeCount, eyeOf, nearestPoint, pointName } from "../../labelling/points";
import { Button, Group, Text } from "@mantine/core";
import type { MoveKind } from "../../labelling/work";
import { useShortcuts } from "../ui/page-events";

// Zoom and pan of a picture in an element: screen = (pixel + 0.5) * scale + offset.

interface View {
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

function toScreen({ scale, x, y }: View, point: Point): Point {
  return [(point[0] + 0.5) * scale + x, (point[1] + 0.5) * scale + y];
}

function toPicture({ scale, x, y }: View, [sx, sy]: Point): Point {
  return [(sx - x) / scale - 0.5, (sy - y) / scale - 0.5];
}

function useView([imageWidth, imageHeight]: Size) {
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

const REACH_PX = 11;

interface Props {
  picture: HTMLCanvasElement;
  size: Size;
  shape: Shape;
  selected: number | null;
  onSelect: (index: number) => void;
  onMove: (index: number, to: Point, kind: MoveKind, step: string | null) => void;
}

interface Drag {
  index: number | null;
  step: string;
  last: Point;
  /** From the pointer to the point it took hold of, in pixels of the screen. */
  offset: Point;
}

export function Stage({ picture, size, shape, selected, onSelect, onMove }: Props) {
  const { ref, width, height, view, zoom, pan, showShape, fit } = useView(size);
  const drag = useRef<Drag | null>(null);
  const drags = useRef(0);
  const overlay = useRef<SVGSVGElement>(null);

  useEffect(() => {
    const element = overlay.current;
    const wheel = (event: WheelEvent): void => {
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 400), [event.offsetX, event.offsetY]);
    };
    // React listens passively to wheels, and then the page scrolls as well.
    element?.addEventListener("wheel", wheel, { passive: false });
    return () => element?.removeEventListener("wheel", wheel);
  }, [zoom]);

  useShortcuts({ "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), "0": fit, e: () => showShape(shape) });

  const pointOf = (event: PointerEvent<SVGSVGElement>): Point => {
    const box = event.currentTarget.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const press = (event: PointerEvent<SVGSVGElement>): void => {
    const last = pointOf(event);
    // In a view of the whole frame points overlap: the nearest is meant, not the one that lies on top.
    const onScreen = shape.map((point) => toScreen(view, point));
    const index = nearestPoint(onScreen, last, REACH_PX);
    const point = index === null ? undefined : shape[index];
    const screen = point === undefined ? last : toScreen(view, point);
    drags.current += 1;
    drag.current = { index, step: `drag ${drags.current}`, last, offset: [screen[0] - last[0], screen[1] - last[1]] };
    event.currentTarget.setPointerCapture(event.pointerId);
    if (index !== null) {
      onSelect(index);
      overlay.current?.querySelector<SVGElement>(`circle.point[data-point="${index}"]`)?.focus();
      event.preventDefault();
    }
  };
  const move = (event: PointerEvent<SVGSVGElement>): void => {
    const held = drag.current;
    if (held === null) return;
    const now = pointOf(event);
    if (held.index === null) pan(now[0] - held.last[0], now[1] - held.last[1]);
    else {
      const to = toPicture(view, [now[0] + held.offset[0], now[1] + held.offset[1]]);
      onMove(held.index, to, event.shiftKey ? "eye" : event.altKey ? "stretch" : "point", held.step);
    }
    drag.current = { ...held, last: now };
  };
  const release = (): void => {
    drag.current = null;
  };

  return (
    <>
      <Group gap="xs" mb={6}>
        {(
          [
            ["Zoom in", () => zoom(1.25)],
            ["Zoom out", () => zoom(0.8)],
            ["Whole frame", fit],
            ["Eyes", () => showShape(shape)],
          ] as const
        ).map(([name, act]) => (
          <Button key={name} size="compact-sm" variant="default" onClick={act}>
            {name}
          </Button>
        ))}
        <Text size="sm" c="dimmed" className="number">
          {(100 * view.scale).toFixed(0)} %
        </Text>
      </Group>
      <div className="stage" ref={ref}>
        <Picture picture={picture} view={view} width={width} height={height} />
        <svg
          ref={overlay}
          role="group"
          aria-label="Points on the frame"
          onPointerDown={press}
          onPointerMove={move}
          onPointerUp={release}
          onPointerCancel={release}
        >
          <Points shape={shape} view={view} selected={selected} onSelect={onSelect} />
        </svg>
      </div>
    </>
  );
}

function Picture({ picture, view, width, height }: { picture: HTMLCanvasElement; view: View; width: number; height: number }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const target = canvas.current;
    const context = target?.getContext("2d");
    if (!target || !context || width === 0) return;
    const density = window.devicePixelRatio;
    [target.width, target.height] = [Math.round(width * density), Math.round(height * density)];
    // Enlarged, the pixels themselves are what one labels.
    context.imageSmoothingEnabled = view.scale * density < 4;
    context.setTransform(view.scale * density, 0, 0, view.scale * density, view.x * density, view.y * density);
    context.drawImage(picture, 0, 0);
  }, [picture, view, width, height]);
  return <canvas ref={canvas} aria-hidden="true" />;
}

interface PointsProps {
  shape: Shape;
  view: View;
  selected: number | null;
  onSelect: (index: number) => void;
}

function Points({ shape, view, selected, onSelect }: PointsProps) {
  const eyes = eyeCount(shape);
  const lines = Array.from({ length: eyes }, (_, eye) => eyeOf(shape, eye).map((point) => toScreen(view, point)));
  const line = (points: readonly (Point | undefined)[]): string => points.map((point) => point?.join(",")).join(" ");
  return (
    <>
      {lines.map((eye, number) => (
        <g key={number}>
          <polyline className="lid" points={line(eye.slice(0, 6))} />
          <polyline className="lid lower" points={line([...eye.slice(5), eye[0]])} />
        </g>
      ))}
      {shape.map((point, index) => {
        const [x, y] = toScreen(view, point);
        const eyePoint = index % EYE_POINTS;
        const kind = eyePoint === 0 || eyePoint === 5 ? "canthus" : eyePoint > 5 ? "lower" : "upper";
        const [px, py] = point.map((value) => value.toFixed(1));
        return (
          <g key={index}>
            <circle className="reach" cx={x} cy={y} r={REACH_PX} />
            <circle
              className={`point ${kind}${selected === index ? " chosen" : ""}`}
              data-point={index}
              cx={x}
              cy={y}
              r={4.5}
              tabIndex={0}
              role="button"
              aria-pressed={selected === index}
              aria-label={`Point ${index + 1}, ${pointName(index, eyes)}, x ${px}, y ${py}`}
              onFocus={() => onSelect(index)}
            />
          </g>
        );
      })}
    </>
  );
}
