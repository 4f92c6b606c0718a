import { Alert, Anchor, Text, TextInput } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap } from "../api";
import { EntryForm, EntryPage } from "./EntryPage";

/** Asks for a link by mail. The answer is the same whether there is such an account. */
export function ForgottenPage() {
  const [name, setName] = useState("");
  const send = useMutation({ mutationFn: () => unwrap(api.POST("/api/admin/session/forgotten", { body: { name } })) });
  return (
    <EntryPage title="Forgotten password">
      {send.isSuccess ? (
        <Alert title="Look into your mail" role="status">
          If an account has this name or address, and a confirmed address, a link for a new password is on its way. It works once, for half
          an hour.
        </Alert>
      ) : (
        <EntryForm sending={send} button="Send me a link">
          <TextInput
            label="Name to sign in with, or your address of mail"
            autoComplete="username"
            required
            value={name}
            onChange={(event) => setName(event.currentTarget.value)}
          />
        </EntryForm>
      )}
      <Text size="sm" ta="center" mt="md">
        <Anchor component={Link} to="/sign-in">
          Back to sign in
        </Anchor>
      </Text>
    </EntryPage>
  );
}
