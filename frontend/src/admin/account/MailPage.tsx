/** Where the link of a letter leads: confirm an address of mail. A click does it, for programs open links by themselves. */

import { Alert, Anchor, Text } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { api, unwrap } from "../api";
import { EntryForm, EntryPage } from "./EntryPage";

export function MailPage() {
  const [token] = useState(() => window.location.hash.slice(1));
  const send = useMutation({ mutationFn: () => unwrap(api.POST("/api/admin/session/mail", { body: { token: token || "-" } })) });
  return (
    <EntryPage title="Confirm your address">
      {send.isSuccess ? (
        <Alert title="The address is confirmed" role="status">
          <Anchor component={Link} to="/">
            Go on
          </Anchor>
        </Alert>
      ) : (
        <EntryForm sending={send} button="Confirm">
          <Text size="sm">Links for a new password will go to this address.</Text>
        </EntryForm>
      )}
    </EntryPage>
  );
}
