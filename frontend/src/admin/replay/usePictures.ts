/** The decoded clips of a trial, given up with it. */

import { useEffect, useState } from "react";
import type { Pictures } from "./pictures";
import type { Clip } from "./shown";

interface Opened {
  pictures: ReadonlyMap<string, Pictures>;
  /** Why a clip has no pictures. */
  problem: string | null;
  isReady: boolean;
}

const NOTHING: Opened = { pictures: new Map(), problem: null, isReady: false };

export function usePictures(clips: readonly Clip[]): Opened {
  const [opened, setOpened] = useState<Opened>(NOTHING);
  useEffect(() => {
    let isGone = false;
    let made: [string, Pictures][] = [];
    const close = (): void => made.forEach(([, pictures]) => pictures.close());
    // The video reader is loaded when a replay is opened, not with the page.
    const asked = clips.map(async (clip): Promise<[string, Pictures]> => {
      const { openPictures } = await import("./pictures");
      return [clip.clip_sha256, await openPictures(clip)];
    });
    void Promise.allSettled(asked).then((outcomes) => {
      made = outcomes.flatMap((outcome) => (outcome.status === "fulfilled" ? [outcome.value] : []));
      if (isGone) return close();
      const failed = outcomes.find((outcome) => outcome.status === "rejected");
      setOpened({ pictures: new Map(made), problem: failed ? problemOf(failed.reason) : null, isReady: true });
    });
    return () => {
      isGone = true;
      // Not in an updater of the state: React drops those of a component that goes.
      close();
      setOpened(NOTHING);
    };
  }, [clips]);
  return opened;
}

const problemOf = (reason: unknown): string => (reason instanceof Error ? reason.message : String(reason));
