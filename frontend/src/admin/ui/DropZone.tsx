/** A place to drop files on, around the field that chooses them; and what any place to drop on needs. */
import { type DragEvent, type ReactNode, useState } from "react";

/** Handlers of a place that takes what `accepts` says, and whether something it takes is over it. */
export function useDropTarget(accepts: () => boolean, take: (event: DragEvent) => void) {
  const [over, setOver] = useState(false);
  const handlers = {
    onDragOver: (event: DragEvent) => {
      if (!accepts()) return;
      event.preventDefault();
      setOver(true);
    },
    onDragLeave: () => setOver(false),
    onDrop: (event: DragEvent) => {
      event.preventDefault();
      setOver(false);
      take(event);
    },
  };
  return { over, handlers };
}

export function DropZone({ onDrop, children }: { onDrop: (files: File[]) => void; children: ReactNode }) {
  const { over, handlers } = useDropTarget(
    () => true,
    ({ dataTransfer }) => dataTransfer.files.length > 0 && onDrop([...dataTransfer.files]),
  );
  return (
    <div className={over ? "drop-here over" : "drop-here"} {...handlers}>
      {children}
    </div>
  );
}
