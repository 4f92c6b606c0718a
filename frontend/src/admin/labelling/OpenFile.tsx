import { Button, FileButton } from "@mantine/core";

interface Props {
  label: string;
  accept: string;
  disabled?: boolean;
  primary?: boolean;
  onOpen: (file: File) => Promise<void>;
}

/** A button that opens a file in the page; the file stays on this computer. */
export function OpenFile({ label, accept, disabled = false, primary = false, onOpen }: Props) {
  return (
    <FileButton
      accept={accept}
      disabled={disabled}
      inputProps={{ "aria-label": label }}
      onChange={(file) => {
        if (file !== null) void onOpen(file);
      }}
    >
      {(button) => (
        <Button {...button} disabled={disabled} variant={primary ? "filled" : "default"}>
          {label}
        </Button>
      )}
    </FileButton>
  );
}
