import { Button, Modal, Stack, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { api, unwrap } from "../api";
import { Answer } from "../ui/Answer";
import { plain } from "../ui/format";

interface Props {
  study: string;
  run: string;
}

/** For owners: who the participant is to the recruiter, asked for only when it is opened. */
export function IdentityButton({ study, run }: Props) {
  const [opened, { open, close }] = useDisclosure(false);
  return (
    <>
      <Button variant="default" onClick={open}>
        Show identity
      </Button>
      <Modal opened={opened} onClose={close} title="Identity" closeButtonProps={{ "aria-label": "Close" }}>
        {opened && <Identity study={study} run={run} />}
      </Modal>
    </>
  );
}

function Identity({ study, run }: Props) {
  const identity = useQuery({
    queryKey: ["identity", study, run],
    queryFn: () => unwrap(api.GET("/api/admin/studies/{study}/runs/{run}/identity", { params: { path: { study, run } } })),
    gcTime: 0,
    staleTime: Infinity,
  });
  return (
    <Answer of={identity}>
      {(data) => (
        <Stack gap="xs">
          <Text>Recruiter’s id: {data.identifier || "none"}</Text>
          <Text>Link: {data.link || "without a label"}</Text>
          {Object.entries(data.parameters).map(([name, value]) => (
            <Text size="sm" key={name} className="wrap-anywhere">
              {name}: {plain(value)}
            </Text>
          ))}
          <Text size="sm" c="dimmed">
            The audit log notes that you have looked.
          </Text>
        </Stack>
      )}
    </Answer>
  );
}
