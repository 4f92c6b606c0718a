/** A button that asks once more before something is lost, or begins. */

import { Button, type ButtonProps, Group, Modal, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import type { ReactNode } from "react";

interface Props extends ButtonProps {
  label: string;
  question: string;
  /** What else to know before, below the question. */
  children?: ReactNode;
  confirm: string;
  /** True where nothing is lost by it. */
  harmless?: boolean;
  /** True where something named below the question has to be done first. */
  blocked?: boolean;
  /** How wide the dialog is: "lg" where it shows more than the question. */
  wide?: boolean;
  onConfirm: () => void;
}

export function ConfirmButton({
  label,
  question,
  children,
  confirm,
  harmless = false,
  blocked = false,
  wide = false,
  onConfirm,
  ...button
}: Props) {
  const [opened, { open, close }] = useDisclosure(false);
  return (
    <>
      <Button variant="default" {...button} onClick={open}>
        {label}
      </Button>
      <Modal opened={opened} onClose={close} title={label} size={wide ? "lg" : "md"} closeButtonProps={{ "aria-label": "Close" }}>
        <Text>{question}</Text>
        {/* A link leads to a page, perhaps the one under this dialog: it closes. */}
        <div onClickCapture={(event) => event.target instanceof Element && event.target.closest("a") !== null && close()}>{children}</div>
        <Group justify="flex-end" mt="md" className="dialog-actions">
          <Button variant="default" onClick={close}>
            Cancel
          </Button>
          <Button
            {...(harmless ? {} : { color: "red" })}
            disabled={blocked}
            onClick={() => {
              close();
              onConfirm();
            }}
          >
            {confirm}
          </Button>
        </Group>
      </Modal>
    </>
  );
}
