/** Where a one-time link leads: make an account. The token stands behind '#', so no log ever sees it. */

import { Button, Container, Paper, PasswordInput, Stack, Text, TextInput, Title } from "@mantine/core";
import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { type FormEvent, useState } from "react";
import { api, unwrap } from "../api";
import { sessionQuery } from "../queries";
import { Answer, ErrorAlert } from "../ui/Answer";

export function InvitationPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const navigate = useNavigate();
  const queries = useQueryClient();
  const path = { params: { path: { token } } };
  const invitation = useQuery({
    queryKey: ["invitation", token],
    queryFn: () => unwrap(api.GET("/api/admin/invitations/{token}/state", path)),
  });
  const accept = useMutation({
    mutationFn: () =>
      unwrap(api.POST("/api/admin/invitations/{token}/account", { ...path, body: { name, password } })),
    onSuccess: (me) => {
      queries.setQueryData(sessionQuery.queryKey, me);
      void navigate({ to: "/" });
    },
  });
  const submit = (event: FormEvent) => {
    event.preventDefault();
    accept.mutate();
  };
  return (
    <Container size={420} py={64} component="main">
      <Title order={1} ta="center" mb="lg">
        Welcome to Palpebra
      </Title>
      <Answer of={invitation}>
        {({ role, status }) =>
          status !== "open" ? (
            <Text ta="center">This link was {status === "used" ? "used already" : "valid for a week and has expired"}; ask for a new one.</Text>
          ) : (
            <Paper withBorder p="lg" component="form" onSubmit={submit}>
              <Stack>
                <Text>You will be: {role}.</Text>
                <TextInput
                  label="Name to sign in with"
                  autoComplete="username"
                  required
                  value={name}
                  onChange={(event) => setName(event.currentTarget.value)}
                />
                <PasswordInput
                  label="Password"
                  description="At least 10 characters."
                  autoComplete="new-password"
                  required
                  minLength={10}
                  value={password}
                  onChange={(event) => setPassword(event.currentTarget.value)}
                  visibilityToggleButtonProps={{ "aria-label": "Show the password" }}
                />
                {accept.error !== null && <ErrorAlert error={accept.error} />}
                <Button type="submit" loading={accept.isPending}>
                  Make the account
                </Button>
              </Stack>
            </Paper>
          )
        }
      </Answer>
    </Container>
  );
}
