import { Button, Code, Modal, Stack, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";

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
      <Modal size="xl" opened={opened} onClose={close} title="Signed addresses" closeButtonProps={{ "aria-label": "Close" }}>
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
          <Text>Secret, for the recruiter’s side alone:</Text>
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
            Who has a signed address goes on with that visit, on any device. The audit log notes that you have looked.
          </Text>
        </Stack>
      )}
    </Answer>
  );
}
