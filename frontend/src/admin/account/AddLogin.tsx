/** Gives the own account a login with a service, once the password was asked for: an open browser alone does not do. */

import { Button, Modal, Stack } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { type SubmitEvent, useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";
import { PasswordField } from "./fields";

export function AddLogin({ id, label }: Schemas["ProviderOut"]) {
  const [opened, { open, close }] = useDisclosure(false);
  const [proof, setProof] = useState("");
  const begin = useChange(() => unwrap(api.POST("/api/admin/logins/{provider}", { params: { path: { provider: id } }, body: { proof } })), {
    touches: [],
    then: ({ url }) => window.location.assign(url),
  });
  const leave = () => {
    setProof("");
    close();
  };
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    begin.mutate(undefined);
  };
  return (
    <>
      <Button variant="default" onClick={open}>
        Add {label}
      </Button>
      <Modal opened={opened} onClose={leave} title={`Add ${label}`} closeButtonProps={{ "aria-label": "Close" }}>
        <Stack component="form" onSubmit={submit}>
          <PasswordField
            label="Your password"
            description="Where the account has none: a code of your authenticator app, or a recovery code."
            value={proof}
            onChange={setProof}
            data-autofocus
          />
          <Button type="submit" loading={begin.isPending}>
            Go to {label}
          </Button>
        </Stack>
      </Modal>
    </>
  );
}
