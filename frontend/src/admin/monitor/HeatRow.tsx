/** One run of the heat map: a picture one pixel a trial, stretched by the page. */

import { useEffect, useRef } from "react";
import { TRIAL_COLOURS } from "./colours";

export function HeatRow({ heat, label }: { heat: string; label: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const drawing = canvas.current?.getContext("2d");
    if (drawing == null) return;
    drawing.clearRect(0, 0, heat.length, 1);
    for (let trial = 0; trial < heat.length; trial += 1) {
      drawing.fillStyle = TRIAL_COLOURS[heat[trial] as keyof typeof TRIAL_COLOURS][0];
      drawing.fillRect(trial, 0, 1, 1);
    }
  }, [heat]);
  return <canvas ref={canvas} className="heat" width={heat.length} height={1} role="img" aria-label={label} />;
}
