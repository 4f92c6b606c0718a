import { TextInput, Alert, Anchor, Text } from "@mantine/core";
import { useMutation, useQueryClient, useQuery } from "@tanstack/react-query";
import { useNavigate, Link, useSearch } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap, sessionQuery, Refused, type Schemas } from "../api";
import { EntryForm, EntryPage, NameField, PasswordField, ProviderButtons, Refusal, waysQuery, useEntered, usePageAskedFor } from "./entry";

// The account's own second factor, after another service has signed one in.

function CodeForm() {
  const [code, setCode] = useState("");
  const navigate = useNavigate();
  const queries = useQueryClient();
  const send = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/session/code", { body: { code } })),
    onSuccess: async ({ next }) => {
      await queries.invalidateQueries({ queryKey: sessionQuery.queryKey });
      await navigate({ to: next ?? "/" });
    },
  });
  return (
    <EntryForm sending={send} button="Continue">
      <CodeField value={code} onChange={setCode} />
    </EntryForm>
  );
}

function CodeField({ value, onChange }: { value: string; onChange: (value: string) => void }) {
  return (
    <TextInput
      label="Code from your authenticator app, or a recovery code"
      autoComplete="one-time-code"
      autoFocus
      value={value}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}

export function SignInPage() {
  const { code }: { code?: unknown } = useSearch({ strict: false });
  return (
    <EntryPage title="Palpebra">
      <Refusal />
      {code === "asked" ? <CodeForm /> : <ByPassword />}
    </EntryPage>
  );
}

/** The form of the page to sign in, over a page whose session ended: what was typed there stays. */
export function SignInHere({ name, then }: { name: string; then: (me: Schemas["Me"]) => void }) {
  return <ByPassword known={name} then={then} />;
}

interface ByPasswordProps {
  known?: string;
  /** What happens next; without it the page asked for opens. */
  then?: (me: Schemas["Me"]) => void;
}

function ByPassword({ known = "", then }: ByPasswordProps) {
  const [name, setName] = useState(known);
  const [password, setPassword] = useState("");
  const [code, setCode] = useState("");
  const next = usePageAskedFor();
  const session = useQuery(sessionQuery);
  const ways = useQuery(waysQuery);
  const entered = useEntered(next);
  const signIn = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/session", { body: { name, password, code: code === "" ? null : code } })),
    onSuccess: then ?? entered,
  });
  const error = signIn.error;
  const asksCode = code !== "" || (error instanceof Refused && error.code === "second_factor_required");
  return (
    <>
      {session.data?.accounts_exist === false && (
        <Alert title="No account yet" mb="md">
          Create the first account with the one-time link that the server printed when it started. Lost it? Run{" "}
          <code>server admin link</code>.
        </Alert>
      )}
      <EntryForm sending={signIn} button="Sign in">
        <NameField label="Name" value={name} onChange={setName} />
        <PasswordField label="Password" value={password} onChange={setPassword} />
        {asksCode && <CodeField value={code} onChange={setCode} />}
      </EntryForm>
      {then === undefined && ways.data?.resets_by_mail === true && (
        <Anchor component={Link} to="/letter/forgotten" size="sm" display="block" ta="center" mt="sm">
          Forgot your password?
        </Anchor>
      )}
      <ProviderButtons next={next} elsewhere={then !== undefined} />
      {then === undefined && (
        <Text size="sm" c="dimmed" ta="center" mt="md">
          Participants do not sign in; they open the link they received.
        </Text>
      )}
    </>
  );
}
