/** What a page shows while it waits, when the server refused, and when there is no page. */

import { Alert, Button, Center, Loader, Group, Text, Anchor, Container, Title } from "@mantine/core";
import type { UseQueryResult, InfiniteData, UseInfiniteQueryResult } from "@tanstack/react-query";
import { type ReactNode, type ComponentType, lazy, Suspense } from "react";
import { Link } from "@tanstack/react-router";
import { titleOf } from "../api";

// What a page shows while it waits, and where the server refused.

export function ErrorAlert({ error, retry }: { error: Error; retry?: () => void }) {
  return (
    <Alert color="red" variant="light" title={titleOf(error)} role="alert" my="sm">
      {error.message}
      {retry !== undefined && (
        <Button mt="sm" size="xs" variant="default" onClick={retry} display="block">
          Try again
        </Button>
      )}
    </Alert>
  );
}

interface AnswerProps<T> {
  of: UseQueryResult<T>;
  /** True while something else is waited for, too. */
  waits?: boolean;
  children: (data: T) => ReactNode;
}

export function Answer<T>({ of, waits = false, children }: AnswerProps<T>) {
  if (of.data !== undefined && !waits) return <>{children(of.data)}</>;
  if (of.error !== null) return <ErrorAlert error={of.error} retry={() => void of.refetch()} />;
  return <Waiting />;
}

function Waiting() {
  return (
    <Center py="xl">
      <Loader role="status" aria-label="Loading" />
    </Center>
  );
}

/** A sentence with commands between backticks, which are shown as code. */
export function Sentence({ text }: { text: string }) {
  return text.split("`").map((part, index) => (index % 2 === 1 ? <code key={index}>{part}</code> : part));
}

// A long list that the server gives a page at a time: what there is of it, how much that is, and the way to more.

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

export function NotFound() {
  return (
    <Container size="sm" py="xl">
      <Title order={1}>Page not found</Title>
      <Text my="md">The address may be mistyped, or the study was deleted.</Text>
      <Anchor component={Link} to="/">
        All studies
      </Anchor>
    </Container>
  );
}

// Parts of a page whose code loads when they are first shown: charts, the builder's forms.

/** `load`'s component; a loader, or `meanwhile`, takes its place until its code is here. */
export function onDemand<Props extends object>(
  load: () => Promise<ComponentType<Props>>,
  meanwhile: ReactNode = <Waiting />,
): ComponentType<Props> {
  const Loaded = lazy(async () => ({ default: await load() }));
  return function OnDemand(props: Props) {
    return (
      <Suspense fallback={meanwhile}>
        <Loaded {...props} />
      </Suspense>
    );
  };
}
