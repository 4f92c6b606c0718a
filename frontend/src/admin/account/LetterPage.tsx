/** Asking for a letter with a link, and where the links of letters lead. */

import { Alert, Anchor, Text, TextInput } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { Link, useParams } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap } from "../api";
import { EntryForm, EntryPage, PasswordField } from "./entry";

/** Asks for a link by mail. The answer is the same whether there is such an account. */
function ForgottenPage() {
  const [name, setName] = useState("");
  const send = useMutation({ mutationFn: () => unwrap(api.POST("/api/admin/session/forgotten", { body: { name } })) });
  return (
    <EntryPage title="Forgot your password?">
      {send.isSuccess ? (
        <Alert title="Check your email" role="status">
          If an account has this name or address and a confirmed email address, we have sent a link for a new password. It works once, for
          half an hour.
        </Alert>
      ) : (
        <EntryForm sending={send} button="Send link">
          <TextInput
            label="User name or email address"
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

// Where the link of a letter leads: confirm an address of mail. A click does it, for programs open links by themselves.

function MailPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const send = useMutation({ mutationFn: () => unwrap(api.POST("/api/admin/session/mail", { body: { token: token || "-" } })) });
  return (
    <EntryPage title="Confirm your email address">
      {send.isSuccess ? (
        <Alert title="Email address confirmed" role="status">
          <Anchor component={Link} to="/">
            Continue
          </Anchor>
        </Alert>
      ) : (
        <EntryForm sending={send} button="Confirm">
          <Text size="sm">Password reset links will go to this address.</Text>
        </EntryForm>
      )}
    </EntryPage>
  );
}

// The page of an emailed link: choose a new password. The token follows '#', so no log ever contains it.

function NewPasswordPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const [password, setPassword] = useState("");
  const send = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/session/new-password", { body: { token: token || "-", password } })),
  });
  return (
    <EntryPage title="New password">
      {send.isSuccess ? (
        <Alert title="Password changed" role="status">
          All sessions of this account were signed out and its API tokens revoked.{" "}
          <Anchor component={Link} to="/sign-in">
            Sign in
          </Anchor>
        </Alert>
      ) : (
        <EntryForm sending={send} button="Change password">
          <PasswordField label="New password" fresh value={password} onChange={setPassword} />
        </EntryForm>
      )}
    </EntryPage>
  );
}

/** `/letter/forgotten` asks for one; `/letter/password#TOKEN` and `/letter/address#TOKEN` are in them. */
export function LetterPage() {
  const { about }: { about?: string } = useParams({ strict: false });
  if (about === "password") return <NewPasswordPage />;
  return about === "address" ? <MailPage /> : <ForgottenPage />;
}
