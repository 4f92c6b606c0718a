import { Alert, Button, Container, Paper, PasswordInput, Stack, Text, TextInput, Title } from "@mantine/core";
import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { type FormEvent, useState } from "react";
import { api, Refused, unwrap } from "../api";
import { sessionQuery } from "../queries";
import { ErrorAlert } from "../ui/Answer";

export function SignInPage() {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [code, setCode] = useState("");
  const navigate = useNavigate();
  const queries = useQueryClient();
  const session = useQuery(sessionQuery);
  const signIn = useMutation({
    mutationFn: () =>
      unwrap(api.POST("/api/admin/session", { body: { name, password, code: code === "" ? null : code } })),
    onSuccess: (me) => {
      queries.setQueryData(sessionQuery.queryKey, me);
      void navigate({ to: "/" });
    },
  });
  const error = signIn.error;
  const asksCode = code !== "" || (error instanceof Refused && error.code === "second_factor_required");
  const submit = (event: FormEvent) => {
    event.preventDefault();
    signIn.mutate();
  };
  return (
    <Container size={420} py={64} component="main">
      <Title order={1} ta="center" mb="lg">
        Palpebra
      </Title>
      {session.data?.accounts_exist === false && (
        <Alert title="No account yet" mb="md">
          The first account is made with the one-time link that the server printed when it started. Lost it? Run{" "}
          <code>server admin link</code>.
        </Alert>
      )}
      <Paper withBorder p="lg" component="form" onSubmit={submit}>
        <Stack>
          <TextInput
            label="Name"
            autoComplete="username"
            required
            value={name}
            onChange={(event) => setName(event.currentTarget.value)}
          />
          <PasswordInput
            label="Password"
            autoComplete="current-password"
            required
            value={password}
            onChange={(event) => setPassword(event.currentTarget.value)}
            visibilityToggleButtonProps={{ "aria-label": "Show the password" }}
          />
          {asksCode && (
            <TextInput
              label="Code of your authenticator app, or a recovery code"
              autoComplete="one-time-code"
              autoFocus
              value={code}
              onChange={(event) => setCode(event.currentTarget.value)}
            />
          )}
          {error !== null && <ErrorAlert error={error} />}
          <Button type="submit" loading={signIn.isPending}>
            Sign in
          </Button>
        </Stack>
      </Paper>
      <Text size="sm" c="dimmed" ta="center" mt="md">
        Participants do not sign in: they open the link they were given.
      </Text>
    </Container>
  );
}
