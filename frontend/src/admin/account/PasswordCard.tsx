import { Button, Card, PasswordInput, Stack, Title } from "@mantine/core";
import { type FormEvent, useState } from "react";
import { api, unwrap } from "../api";
import { useChange } from "../ui/useChange";

export function PasswordCard() {
  const [password, setPassword] = useState("");
  const [fresh, setFresh] = useState("");
  const change = useChange(
    () => unwrap(api.PUT("/api/admin/password", { body: { password, new_password: fresh } })),
    {
      touches: [["sessions"]],
      done: "Password changed; your other sessions have ended.",
      then: () => {
        setPassword("");
        setFresh("");
      },
    },
  );
  const submit = (event: FormEvent) => {
    event.preventDefault();
    change.mutate(undefined);
  };
  const eye = { visibilityToggleButtonProps: { "aria-label": "Show the password" } };
  return (
    <Card withBorder component="form" onSubmit={submit}>
      <Stack>
        <Title order={2} size="h4">
          Password
        </Title>
        <PasswordInput
          label="Present password"
          autoComplete="current-password"
          required
          value={password}
          onChange={(event) => setPassword(event.currentTarget.value)}
          {...eye}
        />
        <PasswordInput
          label="New password"
          description="At least 10 characters."
          autoComplete="new-password"
          required
          minLength={10}
          value={fresh}
          onChange={(event) => setFresh(event.currentTarget.value)}
          {...eye}
        />
        <Button type="submit" loading={change.isPending} maw={220}>
          Change the password
        </Button>
      </Stack>
    </Card>
  );
}
