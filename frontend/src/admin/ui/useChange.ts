/** A change on the server: what it touches is loaded again, and a refusal is told. */

import { notifications } from "@mantine/notifications";
import { type QueryKey, useMutation, useQueryClient } from "@tanstack/react-query";

interface Options<T> {
  touches: QueryKey[];
  done?: string;
  then?: (result: T) => void;
  /** Done before what it touches is loaded again. */
  before?: () => void;
}

export function useChange<Input, T>(change: (input: Input) => Promise<T>, { touches, done, then, before }: Options<T>) {
  const queries = useQueryClient();
  return useMutation<T, Error, Input>({
    mutationFn: change,
    onSuccess: async (result) => {
      before?.();
      await Promise.all(touches.map((queryKey) => queries.invalidateQueries({ queryKey })));
      if (done !== undefined) notifications.show({ message: done, color: "teal" });
      then?.(result);
    },
    onError: (error) => notifications.show({ title: "That did not work", message: error.message, color: "red" }),
  });
}
