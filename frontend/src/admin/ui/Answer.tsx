/** What a page shows while it waits, and where the server refused. */

import { Alert, Button, Center, Loader } from "@mantine/core";
import type { UseQueryResult } from "@tanstack/react-query";
import type { ReactNode } from "react";

export function ErrorAlert({ error, retry }: { error: Error; retry?: () => void }) {
  return (
    <Alert color="red" variant="light" title="That did not work" role="alert" my="sm">
      {error.message}
      {retry !== undefined && (
        <Button mt="sm" size="xs" variant="default" onClick={retry} display="block">
          Try again
        </Button>
      )}
    </Alert>
  );
}

export function Answer<T>({ of, children }: { of: UseQueryResult<T>; children: (data: T) => ReactNode }) {
  if (of.data !== undefined) return <>{children(of.data)}</>;
  if (of.error !== null) return <ErrorAlert error={of.error} retry={() => void of.refetch()} />;
  return <Waiting />;
}

export function Waiting() {
  return (
    <Center py="xl">
      <Loader role="status" aria-label="Loading" />
    </Center>
  );
}
