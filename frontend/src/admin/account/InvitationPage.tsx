/** The page of a one-time link: create an account. The token follows '#', so no log ever contains it. */
import { Alert, Anchor, Text } from "@mantine/core";
import { useMutation, useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { api, Refused, type Schemas, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { EntryForm, EntryPage, NameField, PasswordField, ProviderButtons, useEntered, usePageAskedFor } from "./entry";

const CLOSED: Record<string, string> = {
  used: "This link has already been used.",
  expired: "This link was valid for a week and has expired.",
  not_found: "This link is incomplete or was withdrawn.",
};

export function InvitationPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const invitation = useQuery({
    queryKey: ["invitation", token],
    queryFn: () => unwrap(api.GET("/api/admin/invitations/{token}/state", { params: { path: { token: token || "-" } } })),
  });
  const unknown = invitation.error instanceof Refused && invitation.error.status === 404;
  return (
    <EntryPage title="Welcome to Palpebra">
      {unknown ? (
        <Closed why="not_found" />
      ) : (
        <Answer of={invitation}>
          {({ role, status }) => (status === "open" ? <MakeAccount token={token} role={role} /> : <Closed why={status} />)}
        </Answer>
      )}
    </EntryPage>
  );
}

function Closed({ why }: { why: string }) {
  return (
    <Alert color="yellow" title={CLOSED[why] ?? CLOSED["not_found"]} role="alert">
      <Text size="sm" mb="xs">
        Ask an owner of this server for a new one (People, “Create one-time link”).
      </Text>
      <Anchor component={Link} to="/sign-in" size="sm">
        I have an account
      </Anchor>
    </Alert>
  );
}

const MAY: Record<Schemas["InvitationState"]["role"], string> = {
  owner: "You will be an owner: you can do everything in your workspace and manage this server.",
  experimenter: "You will be an experimenter: you can create and change studies.",
  viewer: "You will be a viewer: you can see studies and their data.",
};

/** Why somebody who chose this on the start page gets a form first. */
const AFTER: Readonly<Record<string, string>> = {
  "/studies/new": "Studies belong to an account of this server. Create yours; the next page takes your clips.",
  "/analyze": "Tables are analyzed by this server, for people with an account. Create yours; the next page takes your table.",
};

function MakeAccount({ token, role }: { token: string; role: Schemas["InvitationState"]["role"] }) {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const next = usePageAskedFor();
  const accept = useMutation({
    mutationFn: () => unwrap(api.POST("/api/admin/invitations/{token}/account", { params: { path: { token } }, body: { name, password } })),
    onSuccess: useEntered(next),
  });
  return (
    <>
      <EntryForm sending={accept} button="Create account" busy="Creating your account. This takes a few seconds.">
        {AFTER[next] !== undefined && <Text size="sm">{AFTER[next]}</Text>}
        <Text size="sm">{MAY[role]}</Text>
        <NameField label="User name" value={name} onChange={setName} />
        <PasswordField label="Password" fresh value={password} onChange={setPassword} />
      </EntryForm>
      <ProviderButtons invitation={token} />
    </>
  );
}
