/** What the pages share on which somebody signs in: the frame, the fields, providers, and what comes after. */

import { Button, Container, Paper, Stack, Title, PasswordInput, type PasswordInputProps, TextInput, Alert, Text } from "@mantine/core";
import { useDocumentTitle } from "@mantine/hooks";
import { type UseMutationResult, useQueryClient, useMutation, useQuery } from "@tanstack/react-query";
import type { SubmitEvent, ReactNode } from "react";
import { ErrorAlert } from "../ui/Answer";
import { useNavigate, useSearch } from "@tanstack/react-router";
import { type Schemas, sessionQuery, api, unwrap } from "../api";

// The frame of the pages before somebody is signed in: a title, a form, a note.

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
  /** What is said from the click until the next page is there. */
  busy?: string;
  children: ReactNode;
}

/** Fields, the server's refusal where there is one, and the button that sends. */
export function EntryForm<T>({ sending, button, busy, children }: FormProps<T>) {
  const isBusy = sending.isPending || (busy !== undefined && sending.isSuccess);
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    sending.mutate();
  };
  return (
    <Paper withBorder p="lg" component="form" onSubmit={submit}>
      <Stack>
        {children}
        {sending.error !== null && <ErrorAlert error={sending.error} />}
        <Button type="submit" loading={isBusy}>
          {button}
        </Button>
        {busy !== undefined && (
          <Text size="sm" role="status">
            {isBusy && busy}
          </Text>
        )}
      </Stack>
    </Paper>
  );
}

// The two fields of every form that asks who somebody is.

interface Field {
  label: string;
  value: string;
  onChange: (value: string) => void;
}

export function NameField({ label, value, onChange }: Field) {
  return (
    <TextInput label={label} autoComplete="username" required value={value} onChange={(event) => onChange(event.currentTarget.value)} />
  );
}

type PasswordProps = Field & Omit<PasswordInputProps, "onChange" | "value"> & { fresh?: boolean };

/** `fresh`: a password to be chosen, not the present one. */
export function PasswordField({ onChange, fresh = false, ...rest }: PasswordProps) {
  const chosen = { description: "At least 12 characters. A few uncommon words work well.", autoComplete: "new-password", minLength: 12 };
  return (
    <PasswordInput
      required
      {...(fresh ? chosen : { autoComplete: "current-password" })}
      {...rest}
      onChange={(event) => onChange(event.currentTarget.value)}
      visibilityToggleButtonProps={{ "aria-label": "Show the password" }}
    />
  );
}

/** What happens once the server knows who somebody is: the session is kept, the page asked for opens. */
export function useEntered(next = "/") {
  const navigate = useNavigate();
  const queries = useQueryClient();
  return (me: Schemas["Me"]) => {
    queries.setQueryData(sessionQuery.queryKey, me);
    void navigate({ to: next });
  };
}

/** Where somebody wanted to go before they had to sign in; only within this site. */
export function usePageAskedFor(): string {
  const { next }: { next?: unknown } = useSearch({ strict: false });
  return typeof next === "string" && /^\/(?!\/)/.test(next) ? next : "/";
}

// Signing in with a university's or ORCID's own service: a button each, and what came of it.

export const waysQuery = { queryKey: ["ways"], queryFn: () => unwrap(api.GET("/api/admin/session/ways")), staleTime: 60_000 };

const REFUSED: Record<string, string> = {
  not_admitted: "No account here uses that login. Sign in with your password and add the login under My account, or ask an owner.",
  provider_away: "That service did not respond correctly. Please try again later.",
  too_many_requests: "Too many sign-ins from your network. Please try again in a minute.",
  conflict: "That login belongs to another account, or the invitation was already used.",
  sign_in_again: "Please sign in again for this change: your last sign-in was more than 15 minutes ago.",
};

/** Why a sign-in by a provider came to nothing, in words of our own: the address is anybody's to write. */
export function Refusal() {
  const { refused }: { refused?: unknown } = useSearch({ strict: false });
  if (typeof refused !== "string") return null;
  return (
    <Alert color="yellow" mb="md" role="alert" title="Not signed in">
      {REFUSED[refused] ?? "The sign-in was not confirmed. Please start over."}
    </Alert>
  );
}

interface Props {
  next?: string;
  invitation?: string;
  /** In another tab, so that this page and what was typed on it stay. */
  elsewhere?: boolean;
}

/** A button for each service; with an invitation, they make the account that it is for. */
export function ProviderButtons({ next = "/", invitation, elsewhere = false }: Props) {
  const { data } = useQuery(waysQuery);
  const begin = useMutation({
    mutationFn: (provider: string) =>
      unwrap(
        invitation === undefined
          ? api.POST("/api/admin/session/providers/{provider}", { params: { path: { provider } }, body: { next } })
          : api.POST("/api/admin/invitations/{token}/providers/{provider}", { params: { path: { token: invitation, provider } } }),
      ),
    onSuccess: ({ url }) => (elsewhere ? window.open(url, "_blank", "noopener") : window.location.assign(url)),
  });
  const providers = data?.providers ?? [];
  if (providers.length === 0) return null;
  return (
    <Stack mt="md">
      <Text size="sm" c="dimmed" ta="center">
        or
      </Text>
      {begin.error !== null && <ErrorAlert error={begin.error} />}
      {providers.map(({ id, label }) => (
        <Button key={id} variant="default" loading={begin.isPending && begin.variables === id} onClick={() => begin.mutate(id)}>
          Sign in with {label}
          {elsewhere && " (in another tab, then return here)"}
        </Button>
      ))}
    </Stack>
  );
}
