/** Parts of a page whose code loads when they are first shown: charts, the builder's forms. */

import { type ComponentType, lazy, Suspense } from "react";
import { Waiting } from "./Answer";

/** `load`'s component; a loader stands in its place until its code is there. */
export function onDemand<Props extends object>(load: () => Promise<ComponentType<Props>>): ComponentType<Props> {
  const Loaded = lazy(async () => ({ default: await load() }));
  return function OnDemand(props: Props) {
    return (
      <Suspense fallback={<Waiting />}>
        <Loaded {...props} />
      </Suspense>
    );
  };
}
