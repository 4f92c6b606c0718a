/** The blink engine live (src/playground), with this server's characters. */

import { Text } from "@mantine/core";
import { useEffect, useRef } from "react";
import { mountPlayground } from "../../playground/playground";
import "../../playground/playground.css";
import type { Schemas } from "../api";
import { stripAddress, WithStrips } from "./Character";

export function Playground() {
  return (
    <>
      <Text maw={720} mb="md">
        Blinks with these settings, compared with a uniform timer as in most programs. It is the same engine as{" "}
        <code>stimuli performance</code>, of the Blender add-on and of the package for the web: the same seed gives the same blinks there.
      </Text>
      <WithStrips>{(strips) => <Mounted strips={strips} />}</WithStrips>
    </>
  );
}

function Mounted({ strips }: { strips: Schemas["Strips"] }) {
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => (root.current === null ? undefined : mountPlayground(root.current, { strips, address: stripAddress })), [strips]);
  return <div ref={root} className="playground" />;
}
