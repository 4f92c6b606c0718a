/** Signing in with a university's or ORCID's own service: a button each, and what came of it. */

import { Alert, Button, Stack, Text } from "@mantine/core";
import { useMutation, useQuery } from "@tanstack/react-query";
import { useSearch } from "@tanstack/react-router";
import { api, unwrap } from "../api";
import { ErrorAlert } from "../ui/Answer";

export const waysQuery = { queryKey: ["ways"], queryFn: () => unwrap(api.GET("/api/admin/session/ways")), staleTime: 60_000 };

const REFUSED: Record<string, string> = {
  not_admitted:
    "That service knows you, but nobody here belongs to that login. Sign in by password and add it under My account, or ask an owner.",
  provider_away: "That service does not answer as it should. Please try again later.",
  too_many_requests: "Too many sign-ins come from your network at this moment. Please begin again in a minute.",
  conflict: "That login belongs to another account of this server, or the invitation was used already.",
  sign_in_again: "Please sign in again for this change: you did so more than 15 minutes ago.",
};

/** Why a sign-in by a provider came to nothing, in words of our own: the address is anybody's to write. */
export function Refusal() {
  const { refused }: { refused?: unknown } = useSearch({ strict: false });
  if (typeof refused !== "string") return null;
  return (
    <Alert color="yellow" mb="md" role="alert" title="Not signed in">
      {REFUSED[refused] ?? "The sign-in was not confirmed. Please begin it again."}
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
          {elsewhere && " (in another tab; then come back)"}
        </Button>
      ))}
    </Stack>
  );
}
