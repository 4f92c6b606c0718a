/** A clip without controls over the eyes: a button below plays it from its start. */

import { Button } from "@mantine/core";
import { useRef, useState } from "react";

export function ClipVideo({ url, label }: { url: string; label: string }) {
  const video = useRef<HTMLVideoElement>(null);
  const [playing, setPlaying] = useState(false);
  const play = () => {
    if (video.current === null) return;
    video.current.currentTime = 0;
    void video.current.play();
  };
  return (
    <>
      <video
        ref={video}
        className="clip"
        src={url}
        muted
        playsInline
        preload="auto"
        aria-label={label}
        onPlay={() => setPlaying(true)}
        onPause={() => setPlaying(false)}
      />
      <Button
        size="compact-sm"
        variant="default"
        mt="xs"
        style={{ alignSelf: "flex-start" }}
        disabled={playing}
        onClick={play}
        aria-label={`Play ${label}`}
      >
        Play
      </Button>
    </>
  );
}
