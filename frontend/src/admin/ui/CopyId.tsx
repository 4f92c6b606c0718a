/** Hex ids, and the first letters of hashes, each with a button that copies the whole. */

import { Button, CopyButton } from "@mantine/core";
import { Fragment } from "react";

const SHOWN_LETTERS = 12;
/** Public ids have 16 hex digits and are shown whole, as some have to be typed; hashes have 40 to 128. */
const ID_LETTERS = 16;
const HEX_ID = /\b([0-9a-f]{16,128})\b/;

/** An id or a hash; `what` says of what to someone who listens to the page, such as "run id". */
export function CopyId({ value, what }: { value: string; what: string }) {
  const start = value.slice(0, SHOWN_LETTERS);
  return (
    <span className="copy-id">
      <code title={value}>{value.length > ID_LETTERS ? `${start}…` : value}</code>
      <CopyButton value={value}>
        {({ copied, copy }) => (
          <Button size="compact-xs" variant="default" onClick={copy} aria-label={`${copied ? "Copied" : "Copy"} ${what} ${start}`}>
            {copied ? "Copied" : "Copy"}
          </Button>
        )}
      </CopyButton>
    </span>
  );
}

/** A text with each id in it as above. */
export function TextWithIds({ text }: { text: string }) {
  // Split by a pattern with a group: every second part is an id.
  return text
    .split(HEX_ID)
    .map((part, index) => (index % 2 === 1 ? <CopyId key={index} value={part} what="id" /> : <Fragment key={index}>{part}</Fragment>));
}
