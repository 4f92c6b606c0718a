/** A trace with its blinks: zoom, pan, choose a blink, move its start and end by dragging or by keyboard. */
import { useElementSize } from "@mantine/hooks";
import { type KeyboardEvent, type PointerEvent, useEffect, useMemo, useRef } from "react";
import {
  type Blink,
  blinkKey,
  decisionOn,
  type Decisions,
  type Edge,
  edgeLimits,
  edgesOf,
  extent,
  movedWindow,
  tracePath,
  type Window,
  zoomedWindow,
} from "../../labelling/review";

const HEIGHT = 320;
const BOTTOM = 22;

interface Props {
  values: Float64Array;
  fps: number;
  blinks: readonly Blink[];
  decisions: Decisions;
  chosen: Blink | null;
  window: Window;
  onWindow: (change: (before: Window) => Window) => void;
  onChoose: (blink: Blink) => void;
  onEdge: (blink: Blink, edge: Edge, frame: number, step: string | null) => void;
}

interface Drag {
  edge: Edge | null;
  step: string;
  x: number;
}

export function TraceView(props: Props) {
  const { values, fps, blinks, decisions, chosen, window, onWindow, onChoose, onEdge } = props;
  const { ref, width: measured } = useElementSize<HTMLDivElement>();
  const width = measured || 800;
  const svg = useRef<SVGSVGElement>(null);
  const drag = useRef<Drag | null>(null);
  const drags = useRef(0);
  const last = values.length - 1;
  const scale = width / (window.to - window.from);
  const range = useMemo(() => extent(values), [values]);
  const path = useMemo(() => tracePath(values, window, width, HEIGHT - BOTTOM, range), [values, window, width, range]);
  const x = (frame: number): number => (frame - window.from) * scale;

  useEffect(() => {
    const element = svg.current;
    const wheel = (event: WheelEvent): void => {
      event.preventDefault();
      const share = event.offsetX / (element?.clientWidth || 1);
      onWindow((now) => zoomedWindow(now, Math.exp(event.deltaY / 400), now.from + share * (now.to - now.from), last));
    };
    // React listens passively to wheels, and then the page scrolls as well.
    element?.addEventListener("wheel", wheel, { passive: false });
    return () => element?.removeEventListener("wheel", wheel);
  }, [onWindow, last]);

  const press = (event: PointerEvent<SVGSVGElement>): void => {
    const edge = event.target instanceof Element ? event.target.getAttribute("data-edge") : null;
    const blink = event.target instanceof Element ? event.target.getAttribute("data-blink") : null;
    const hit = blinks.find((one) => blinkKey(one) === blink);
    if (hit !== undefined) onChoose(hit);
    drags.current += 1;
    drag.current = { edge: edge === "onset" || edge === "end" ? edge : null, step: `drag ${drags.current}`, x: event.clientX };
    event.currentTarget.setPointerCapture(event.pointerId);
  };
  const move = (event: PointerEvent<SVGSVGElement>): void => {
    const held = drag.current;
    if (held === null) return;
    if (held.edge !== null && chosen !== null) {
      const left = event.currentTarget.getBoundingClientRect().left;
      onEdge(chosen, held.edge, window.from + (event.clientX - left) / scale, held.step);
    } else onWindow((now) => movedWindow(now, (held.x - event.clientX) / scale, last));
    drag.current = { ...held, x: event.clientX };
  };
  const release = (): void => {
    drag.current = null;
  };

  const visible = blinks.filter((blink) => blink.end >= window.from && blink.onset <= window.to);
  return (
    <div ref={ref}>
      <svg
        ref={svg}
        className="trace"
        role="group"
        aria-label="Trace with its blinks"
        onPointerDown={press}
        onPointerMove={move}
        onPointerUp={release}
        onPointerCancel={release}
      >
        {visible.map((blink) => {
          const { onset, end } = edgesOf(blink, decisions);
          const rejected = decisionOn(decisions, blink).decision === "reject";
          return (
            <g key={blinkKey(blink)}>
              <rect
                className={`blink${rejected ? " rejected" : ""}${blink === chosen ? " chosen" : ""}`}
                data-blink={blinkKey(blink)}
                x={x(onset)}
                y={0}
                width={Math.max(1, x(end) - x(onset))}
                height={HEIGHT - BOTTOM}
              />
              <text x={x(blink.minimum)} y={12} textAnchor="middle">
                {blink.number}
                {rejected ? " ✕" : ""}
              </text>
            </g>
          );
        })}
        <path className="line" d={path} />
        <Times window={window} fps={fps} width={width} />
        {chosen !== null &&
          (["onset", "end"] as const).map((edge) => <EdgeHandle key={edge} {...props} blink={chosen} edge={edge} last={last} x={x} />)}
      </svg>
    </div>
  );
}

interface HandleProps extends Props {
  blink: Blink;
  edge: Edge;
  last: number;
  x: (frame: number) => number;
}

function EdgeHandle({ blink, edge, blinks, decisions, last, x, onEdge }: HandleProps) {
  const frame = edgesOf(blink, decisions)[edge];
  const [least, most] = edgeLimits(blink, edge, blinks, decisions, last);
  const press = (event: KeyboardEvent): void => {
    const far = event.shiftKey ? 10 : 1;
    const by = { ArrowLeft: -far, ArrowDown: -far, ArrowRight: far, ArrowUp: far }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    onEdge(blink, edge, frame + by, null);
  };
  return (
    <g
      role="slider"
      tabIndex={0}
      aria-label={`${edge === "onset" ? "Start" : "End"} of blink ${blink.number}`}
      aria-valuemin={least}
      aria-valuemax={most}
      aria-valuenow={frame}
      aria-valuetext={`frame ${frame}`}
      onKeyDown={press}
    >
      <line className="edge" x1={x(frame)} x2={x(frame)} y1={0} y2={HEIGHT - BOTTOM} />
      <rect className="handle" x={x(frame) - 4} y={(HEIGHT - BOTTOM) / 2 - 12} width={8} height={24} rx={2} />
      <rect className="grip" data-edge={edge} x={x(frame) - 10} y={0} width={20} height={HEIGHT - BOTTOM} />
    </g>
  );
}

/** Seconds along the bottom, about a hundred pixels apart. */
function Times({ window, fps, width }: { window: Window; fps: number; width: number }) {
  const seconds = (window.to - window.from) / fps;
  const rough = seconds / Math.max(1, width / 100);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((unit) => unit * power).find((unit) => unit >= rough) ?? rough;
  // A number half outside the figure cannot be read.
  const first = Math.ceil((window.from / fps + (16 * seconds) / width) / step);
  const ticks = Array.from({ length: Math.floor(window.to / fps / step) - first + 1 }, (_, index) => (first + index) * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  return (
    <g aria-hidden="true">
      {ticks.map((time) => (
        <text key={time} x={((time * fps - window.from) / (window.to - window.from)) * width} y={HEIGHT - 6} textAnchor="middle">
          {time.toFixed(digits)} s
        </text>
      ))}
    </g>
  );
}
