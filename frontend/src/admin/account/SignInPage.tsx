import { Alert, Text, TextInput } from "@mantine/core";
import { useMutation, useQuery } from "@tanstack/react-query";
import { useSearch } from "@tanstack/react-router";
import { useState } from "react";
import { api, Refused, unwrap } from "../api";
import { sessionQuery } from "../queries";
import { EntryForm, EntryPage } from "./EntryPage";
import { NameField, PasswordField } from "./fields";
import { useEntered } from "./useEntered";

export function SignInPage() {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [code, setCode] = useState("");
  const session = useQuery(sessionQuery);
  const signIn = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/session", { body: { name, password, code: code === "" ? null : code } })),
    onSuccess: useEntered(usePageAskedFor()),
  });
  const error = signIn.error;
  const asksCode = code !== "" || (error instanceof Refused && error.code === "second_factor_required");
  return (
    <EntryPage title="Palpebra">
      {session.data?.accounts_exist === false && (
        <Alert title="No account yet" mb="md">
          The first account is made with the one-time link that the server printed when it started. Lost it? Run{" "}
          <code>server admin link</code>.
        </Alert>
      )}
      <EntryForm sending={signIn} button="Sign in">
        <NameField label="Name" value={name} onChange={setName} />
        <PasswordField label="Password" value={password} onChange={setPassword} />
        {asksCode && (
          <TextInput
            label="Code of your authenticator app, or a recovery code"
            autoComplete="one-time-code"
            autoFocus
            value={code}
            onChange={(event) => setCode(event.currentTarget.value)}
          />
        )}
      </EntryForm>
      <Text size="sm" c="dimmed" ta="center" mt="md">
        Participants do not sign in: they open the link they were given.
      </Text>
    </EntryPage>
  );
}

/** Where somebody wanted to go before they had to sign in; only within this site. */
function usePageAskedFor(): string {
  const { next }: { next?: unknown } = useSearch({ strict: false });
  return typeof next === "string" && /^\/(?!\/)/.test(next) ? next : "/";
}
