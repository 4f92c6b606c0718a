/** Asks for the password over the page that was open, so that nothing that was typed there is lost. */
import { Anchor, Modal, Text } from "@mantine/core";
import { useQueryClient } from "@tanstack/react-query";
import { useEffect } from "react";
import { SignInHere } from "../account/SignInPage";
import { type Schemas, sessionQuery } from "../api";

interface Props {
  account: Schemas["AccountOut"];
  /** The session has ended; else a change asks for a sign-in of the last minutes. */
  ended: boolean;
  onDone: () => void;
}

export function SignInAgain({ account, ended, onDone }: Props) {
  const queries = useQueryClient();
  useEffect(() => {
    // Signed in by another service, in another tab: this one looks when it is seen again.
    const look = () => void queries.invalidateQueries({ queryKey: sessionQuery.queryKey });
    window.addEventListener("focus", look);
    return () => window.removeEventListener("focus", look);
  }, [queries]);
  const entered = (me: Schemas["Me"]) => {
    if (me.account?.id !== account.id) {
      // Somebody else: nothing of what the first one loaded or typed stays in memory.
      window.location.assign("/admin/");
      return;
    }
    queries.setQueryData(sessionQuery.queryKey, me);
    void queries.invalidateQueries();
    onDone();
  };
  return (
    <Modal
      opened
      onClose={onDone}
      withCloseButton={!ended}
      closeOnEscape={!ended}
      closeOnClickOutside={false}
      overlayProps={ended ? { backgroundOpacity: 0.95, blur: 8 } : {}}
      title={ended ? "Your session has expired" : "Sign in again"}
      closeButtonProps={{ "aria-label": "Close" }}
    >
      <Text size="sm" mb="sm">
        {ended
          ? "Sign in to continue. Your input on this page is preserved."
          : "This change requires a sign-in within the last 15 minutes. Sign in, then press the button again. Your input is preserved."}
      </Text>
      <SignInHere name={account.name} then={entered} />
      {ended && (
        <Anchor href="/admin/sign-in" size="sm" display="block" ta="center" mt="sm">
          Leave this page
        </Anchor>
      )}
    </Modal>
  );
}
