/** A schematic eye whose upper lid is drawn at a closure; it plays a blink again and again. */

import { useReducedMotion } from "@mantine/hooks";
import { useEffect, useRef } from "react";

const OPEN_Y = 22;
const SHUT_Y = 78;

export function Eye({ closure, fps }: { closure: readonly number[]; fps: number }) {
  const lid = useRef<SVGPathElement>(null);
  const still = useReducedMotion();
  useEffect(() => {
    const length = closure.length / fps + 1;
    const draw = (value: number) => {
      const y = OPEN_Y + value * (SHUT_Y - OPEN_Y);
      lid.current?.setAttribute("d", `M20 52 Q100 ${String(2 * y - 52)} 180 52 L180 0 L20 0 Z`);
    };
    if (still) {
      draw(Math.max(...closure));
      return;
    }
    let handle = 0;
    const tick = (now: number) => {
      const frame = Math.floor(((now / 1000) % length) * fps);
      draw(closure[frame] ?? 0);
      handle = requestAnimationFrame(tick);
    };
    handle = requestAnimationFrame(tick);
    return () => cancelAnimationFrame(handle);
  }, [closure, fps, still]);
  return (
    <svg viewBox="0 0 200 100" role="img" aria-label="An eye that plays this blink" style={{ maxWidth: 360 }}>
      <defs>
        <clipPath id="fissure">
          <path d="M20 52 Q100 -8 180 52 Q100 104 20 52 Z" />
        </clipPath>
      </defs>
      <path d="M20 52 Q100 -8 180 52 Q100 104 20 52 Z" fill="#f7f5f1" />
      <g clipPath="url(#fissure)">
        <circle cx={100} cy={48} r={27} fill="#4f8794" stroke="#27474f" strokeWidth={3} />
        <circle cx={100} cy={48} r={11} fill="#15191c" />
        <circle cx={91} cy={39} r={5} fill="#fff" />
        <path ref={lid} fill="#d9a07c" stroke="#4a2f22" strokeWidth={4} />
      </g>
      <path d="M20 52 Q100 -8 180 52 Q100 104 20 52 Z" fill="none" stroke="#4a2f22" strokeWidth={2} />
    </svg>
  );
}
