/** What a recruiter is given: the study's address with its parameters, and the key of signed links; the preview. */

import { Button, Code, CopyButton, Group, Modal, Stack, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { useChange } from "../ui/useChange";

/** Opens a preview in a new tab. */
export function PreviewButton({ study, small = false }: { study: string; small?: boolean }) {
  const preview = useChange(
    () =>
      unwrap(
        api.POST("/api/admin/studies/{study}/links", {
          params: { path: { study } },
          body: { kind: "preview", label: "preview", labels: [], count: 1, days: 1 },
        }),
      ),
    { touches: [], then: ([link]) => link && window.open(link.url, "_blank", "noopener") },
  );
  return (
    <Button variant="default" size={small ? "compact-xs" : "sm"} onClick={() => preview.mutate(undefined)} loading={preview.isPending}>
      Preview as a participant
    </Button>
  );
}

interface SigningProps {
  study: string;
  /** One whose recruiter is its own; the study's recruiter where left out. */
  link?: string | undefined;
}

/** For owners: the secret that signs recruiters' addresses, asked for only when it is opened. */
export function SigningButton({ study, link }: SigningProps) {
  const [opened, { open, close }] = useDisclosure(false);
  return (
    <>
      <Button variant="default" size={link ? "compact-xs" : "sm"} onClick={open}>
        Show signing secret
      </Button>
      <Modal size="xl" opened={opened} onClose={close} title="Signed URLs" closeButtonProps={{ "aria-label": "Close" }}>
        {opened && <Signing study={study} link={link} />}
      </Modal>
    </>
  );
}

function Signing({ study, link }: SigningProps) {
  const signing = useQuery({
    queryKey: ["signing", study, link],
    queryFn: () =>
      unwrap(api.GET("/api/admin/studies/{study}/links/signing", { params: { path: { study }, query: link ? { link } : {} } })),
    gcTime: 0,
    staleTime: 0,
  });
  return (
    <Answer of={signing}>
      {(data) => (
        <Stack gap="xs">
          <Text>Secret, for the recruiter only:</Text>
          <Code block tabIndex={0}>
            {data.secret}
          </Code>
          <Text>Added to the link for the participant {data.identifier}:</Text>
          <Code block tabIndex={0}>
            ?{data.query}
          </Code>
          <Text>In Python:</Text>
          <Code block tabIndex={0}>
            {data.python}
          </Code>
          <Text>By OpenSSL:</Text>
          <Code block tabIndex={0}>
            {data.shell}
          </Code>
          <Text size="sm" c="dimmed">
            Anyone with a signed URL can continue that visit on any device. This access is recorded in the audit log.
          </Text>
        </Stack>
      )}
    </Answer>
  );
}

// The address that a recruiter is given: with the parameter by which it names the participant.

/** What each recruiter fills in by itself, in the form that its pages ask for. */
const PARAMETERS: Record<string, readonly (readonly [name: string, value: string])[]> = {
  prolific: [
    ["PROLIFIC_PID", "{{%PROLIFIC_PID%}}"],
    ["STUDY_ID", "{{%STUDY_ID%}}"],
    ["SESSION_ID", "{{%SESSION_ID%}}"],
  ],
  sona: [["survey_code", "%SURVEY_CODE%"]],
  mturk: [["workerId", "${workerId}"]],
  generic: [["participant", "ID"]],
};

export const RECRUITER_NAMES: Record<string, string> = { prolific: "Prolific", sona: "SONA", mturk: "MTurk", generic: "another recruiter" };

/** `url` as `recruiter` needs it; the parameter of the id may have another name. */
export function addressFor(url: string, recruiter: Record<string, unknown> | null | undefined): string {
  const kind = recruiter?.["kind"];
  const [first, ...others] = typeof kind === "string" ? (PARAMETERS[kind] ?? []) : [];
  if (first === undefined) return url;
  const own = recruiter?.["id_parameter"];
  const name = typeof own === "string" && own !== "" ? own : first[0];
  // Written unencoded: the recruiter looks for its signs, and replaces them before anybody opens the address.
  const signed = recruiter?.["signature_parameter"];
  const signature = typeof signed === "string" && signed !== "" ? [[signed, "SIGNATURE"]] : [];
  const query = [[name, first[1]], ...others, ...signature].map(([key, value]) => `${key}=${value}`).join("&");
  return `${url}?${query}`;
}

/** An address to hand on, with a button that copies it. */
export function Address({ label, url }: { label: string; url: string }) {
  return (
    <div>
      <Text size="sm" fw={600}>
        {label}
      </Text>
      <Group gap="xs" wrap="nowrap">
        <Code className="wrap-anywhere">{url}</Code>
        <CopyButton value={url}>
          {({ copied, copy }) => (
            <Button size="compact-xs" variant="default" flex="none" onClick={copy} aria-label={`Copy: ${label}`}>
              {copied ? "Copied" : "Copy"}
            </Button>
          )}
        </CopyButton>
      </Group>
    </div>
  );
}
