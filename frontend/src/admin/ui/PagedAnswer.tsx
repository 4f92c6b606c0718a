/** A long list that the server gives a page at a time: what there is of it, how much that is, and the way to more. */

import { Button, Center, Group, Loader, Text } from "@mantine/core";
import type { InfiniteData, UseInfiniteQueryResult } from "@tanstack/react-query";
import type { ReactNode } from "react";
import { ErrorAlert } from "./Answer";

interface Props<Page> {
  of: UseInfiniteQueryResult<InfiniteData<Page>>;
  shown: number;
  /** How many there are on all pages, where the server says so. */
  total?: number | undefined;
  /** What the button for the next page says. */
  more: string;
  children: ReactNode;
}

export function PagedAnswer<Page>({ of, shown, total, more, children }: Props<Page>) {
  return (
    <>
      {of.error !== null && <ErrorAlert error={of.error} retry={() => void of.refetch()} />}
      {of.isPending && (
        <Center py="xl">
          <Loader role="status" aria-label="Loading" />
        </Center>
      )}
      {of.data !== undefined && children}
      {of.hasNextPage && (
        <Group>
          <Button variant="default" loading={of.isFetchingNextPage} onClick={() => void of.fetchNextPage()}>
            {more}
          </Button>
          {total !== undefined && (
            <Text size="sm" c="dimmed">
              {shown.toLocaleString("en")} of {total.toLocaleString("en")}
            </Text>
          )}
        </Group>
      )}
    </>
  );
}
