/** Where the link of a letter leads: choose a new password. The token stands behind '#', so no log ever sees it. */

import { Alert, Anchor } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap } from "../api";
import { EntryForm, EntryPage } from "./EntryPage";
import { PasswordField } from "./fields";

export function NewPasswordPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const [password, setPassword] = useState("");
  const send = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/session/new-password", { body: { token: token || "-", password } })),
  });
  return (
    <EntryPage title="New password">
      {send.isSuccess ? (
        <Alert title="Your password is changed" role="status">
          Everybody who was signed in to the account is signed out, and its API tokens have ended.{" "}
          <Anchor component={Link} to="/sign-in">
            Sign in
          </Anchor>
        </Alert>
      ) : (
        <EntryForm sending={send} button="Change the password">
          <PasswordField label="New password" fresh value={password} onChange={setPassword} />
        </EntryForm>
      )}
    </EntryPage>
  );
}
