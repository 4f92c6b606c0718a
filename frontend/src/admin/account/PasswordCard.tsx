import { Button, Card, Stack, Title } from "@mantine/core";
import { type SubmitEvent, useState } from "react";
import { api, unwrap } from "../api";
import { useChange } from "../ui/useChange";
import { PasswordField } from "./fields";

export function PasswordCard() {
  const [password, setPassword] = useState("");
  const [fresh, setFresh] = useState("");
  const change = useChange(() => unwrap(api.PUT("/api/admin/password", { body: { password, new_password: fresh } })), {
    touches: [["sessions"]],
    done: "Password changed; your other sessions have ended.",
    then: () => {
      setPassword("");
      setFresh("");
    },
  });
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    change.mutate(undefined);
  };
  return (
    <Card withBorder component="form" onSubmit={submit}>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Password
        </Title>
        <PasswordField w="100%" maw={360} label="Present password" value={password} onChange={setPassword} />
        <PasswordField w="100%" maw={360} label="New password" fresh value={fresh} onChange={setFresh} />
        <Button type="submit" loading={change.isPending}>
          Change the password
        </Button>
      </Stack>
    </Card>
  );
}
