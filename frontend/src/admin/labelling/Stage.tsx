/** A frame with its points: drag, zoom, pan; every point can be reached and moved by keyboard. */

import { Button, Group, Text } from "@mantine/core";
import { type PointerEvent, useEffect, useRef } from "react";
import { EYE_POINTS, eyeCount, eyeOf, nearestPoint, type Point, pointName, type Shape, type Size } from "../../labelling/points";
import type { MoveKind } from "../../labelling/work";
import { useShortcuts } from "../ui/useShortcuts";
import { toPicture, toScreen, useView, type View } from "./useView";

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
