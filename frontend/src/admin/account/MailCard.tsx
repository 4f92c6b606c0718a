/** The address of mail of the own account. Shown only where this server sends mail. */

import { Button, Card, Group, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { type SubmitEvent, useState } from "react";
import { api, unwrap } from "../api";
import { useChange } from "../ui/useChange";
import { PasswordField } from "./fields";
import { waysQuery } from "./ProviderButtons";

export function MailCard() {
  const ways = useQuery(waysQuery);
  const mail = useQuery({ queryKey: ["mail"], queryFn: () => unwrap(api.GET("/api/admin/mail")) });
  const [address, setAddress] = useState("");
  const [password, setPassword] = useState("");
  const change = useChange(() => unwrap(api.PUT("/api/admin/mail", { body: { address, password } })), {
    touches: [],
    done: "A letter is on its way; open the link in it within half an hour.",
    then: () => setPassword(""),
  });
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/mail", { body: { password } })), {
    touches: [["mail"]],
    done: "The address is removed.",
    then: () => setPassword(""),
  });
  if (ways.data?.resets_by_mail !== true) return null;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    change.mutate(undefined);
  };
  const known = mail.data?.address ?? null;
  return (
    <Card withBorder component="form" onSubmit={submit}>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Address of mail
        </Title>
        <Text size="sm">
          {known === null ? "None: a forgotten password cannot be reset by mail." : `Links for a new password go to ${known}.`}
        </Text>
        <TextInput
          w="100%"
          maw={360}
          type="email"
          label="Address"
          autoComplete="email"
          required
          value={address}
          onChange={(event) => setAddress(event.currentTarget.value)}
        />
        <PasswordField w="100%" maw={360} label="Your password" value={password} onChange={setPassword} />
        <Group>
          <Button type="submit" loading={change.isPending}>
            Send a letter to confirm it
          </Button>
          {known !== null && (
            <Button variant="default" disabled={password === ""} onClick={() => remove.mutate(undefined)}>
              Remove
            </Button>
          )}
        </Group>
      </Stack>
    </Card>
  );
}
