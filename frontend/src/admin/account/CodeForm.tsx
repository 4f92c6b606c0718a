/** The account's own second factor, after another service has signed one in. */

import { TextInput } from "@mantine/core";
import { useMutation, useQueryClient } from "@tanstack/react-query";
import { useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap } from "../api";
import { sessionQuery } from "../queries";
import { EntryForm } from "./EntryPage";

export function CodeForm() {
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
    <EntryForm sending={send} button="Go on">
      <CodeField value={code} onChange={setCode} />
    </EntryForm>
  );
}

export function CodeField({ value, onChange }: { value: string; onChange: (value: string) => void }) {
  return (
    <TextInput
      label="Code of your authenticator app, or a recovery code"
      autoComplete="one-time-code"
      autoFocus
      value={value}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}
