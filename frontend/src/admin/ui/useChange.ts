/** A change on the server and its consequences: data loaded again, a message in the corner, a saved file. */

import type { NotificationData } from "@mantine/notifications";
import { type QueryKey, useMutation, useQueryClient } from "@tanstack/react-query";
import { titleOf } from "../api";

// Short messages in the corner of the page; their code loads after the page itself.

export const loadNotifications = () => import("@mantine/notifications");

export function notify(message: NotificationData): void {
  void loadNotifications().then(({ notifications }) => notifications.show({ closeButtonProps: { "aria-label": "Dismiss" }, ...message }));
}

// A change on the server: what it touches is loaded again, and a refusal is reported.

interface Options<T> {
  touches: QueryKey[];
  /** What the corner of the page says then; null where the page says it in another way. */
  done?: string | ((result: T) => string | null);
  then?: (result: T) => void;
  /** Done before what it touches is loaded again. */
  before?: () => void;
  /** Shows a refusal in the page itself and returns true; any other refusal is reported in the corner. */
  refused?: (error: Error) => boolean;
}

export function useChange<Input, T>(change: (input: Input) => Promise<T>, { touches, done, then, before, refused }: Options<T>) {
  const queries = useQueryClient();
  return useMutation<T, Error, Input>({
    mutationFn: change,
    onSuccess: async (result) => {
      before?.();
      await Promise.all(touches.map((queryKey) => queries.invalidateQueries({ queryKey })));
      const message = typeof done === "function" ? done(result) : done;
      if (message) notify({ message, color: "teal" });
      then?.(result);
    },
    onError: (error) => {
      if (!refused?.(error)) notify({ title: titleOf(error), message: error.message, color: "red" });
    },
  });
}

/** Offer text as a file to save. */
export function downloadText(name: string, text: string, type = "text/csv"): void {
  download(name, new Blob([text], { type }));
}

export function download(name: string, content: Blob): void {
  const address = URL.createObjectURL(content);
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  URL.revokeObjectURL(address);
}
