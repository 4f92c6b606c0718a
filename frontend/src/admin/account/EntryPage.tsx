/** The frame of the pages before somebody is signed in: a title, a form, a note. */

import { Button, Container, Paper, Stack, Title } from "@mantine/core";
import { useDocumentTitle } from "@mantine/hooks";
import type { UseMutationResult } from "@tanstack/react-query";
import type { SubmitEvent, ReactNode } from "react";
import { ErrorAlert } from "../ui/Answer";

export function EntryPage({ title, children }: { title: string; children: ReactNode }) {
  useDocumentTitle(title === "Palpebra" ? "Sign in – Palpebra" : `${title} – Palpebra`);
  return (
    <Container size={420} py={64} component="main">
      <Title order={1} ta="center" mb="lg">
        {title}
      </Title>
      {children}
    </Container>
  );
}

interface FormProps<T> {
  sending: UseMutationResult<T, Error, void>;
  button: string;
  children: ReactNode;
}

/** Fields, the server's refusal where there is one, and the button that sends. */
export function EntryForm<T>({ sending, button, children }: FormProps<T>) {
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    sending.mutate();
  };
  return (
    <Paper withBorder p="lg" component="form" onSubmit={submit}>
      <Stack>
        {children}
        {sending.error !== null && <ErrorAlert error={sending.error} />}
        <Button type="submit" loading={sending.isPending}>
          {button}
        </Button>
      </Stack>
    </Paper>
  );
}
