/** A change on the server: what it touches is loaded again, and a refusal is told. */

import { type QueryKey, useMutation, useQueryClient } from "@tanstack/react-query";
import { notify } from "./notify";

interface Options<T> {
  touches: QueryKey[];
  /** What the corner of the page says then; null where the page says it in another way. */
  done?: string | ((result: T) => string | null);
  then?: (result: T) => void;
  /** Done before what it touches is loaded again. */
  before?: () => void;
  /** Tells a refusal in the page itself and says so; any other is told in the corner. */
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
      if (!refused?.(error)) notify({ title: "That did not work", message: error.message, color: "red" });
    },
  });
}
