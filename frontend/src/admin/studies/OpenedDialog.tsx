/** After a study is opened: the link for participants, and what each recruiter needs. */

import { Button, Code, CopyButton, Group, Modal, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { api, unwrap } from "../api";
import { studyQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { addressFor, RECRUITER_NAMES } from "./recruit";
import { TurnedAway } from "./TurnedAway";

interface Props {
  study: string;
  onClose: () => void;
}

export function OpenedDialog({ study, onClose }: Props) {
  const link = useQuery({ queryKey: ["links", study, "general"], queryFn: () => generalLink(study) });
  const detail = useQuery(studyQuery(study)).data;
  const recruiter = detail?.recruiter;
  const kind = typeof recruiter?.["kind"] === "string" ? recruiter["kind"] : null;
  return (
    <Modal opened onClose={onClose} title="Participants can begin" size="lg" closeButtonProps={{ "aria-label": "Close" }}>
      <Answer of={link}>
        {({ url }) => (
          <Stack>
            <Address label="Link for participants" url={url} />
            {kind === null ? (
              <Text size="sm">
                To recruit through Prolific, SONA or MTurk, first choose the service under{" "}
                <Link to="/studies/$study/settings" params={{ study }} onClick={onClose}>
                  Settings
                </Link>
                . The link then appears here and under Links. Until then links of these services are refused, because participants would
                have no id, get a random completion code, and could take part twice.
              </Text>
            ) : (
              <Address
                label={`For ${RECRUITER_NAMES[kind] ?? kind}, which fills in each participant's id`}
                url={addressFor(url, recruiter)}
              />
            )}
            <TurnedAway design={detail?.design} />
            <Text size="sm" c="dimmed">
              Personal links, quotas and completion codes are under{" "}
              <Link to="/studies/$study/links" params={{ study }} onClick={onClose}>
                Links
              </Link>{" "}
              and{" "}
              <Link to="/studies/$study/settings" params={{ study }} onClick={onClose}>
                Settings
              </Link>
              .
            </Text>
          </Stack>
        )}
      </Answer>
    </Modal>
  );
}

/** The first link for everybody; made where there is none. */
async function generalLink(study: string): Promise<{ url: string }> {
  const path = { params: { path: { study } } };
  const { links } = await unwrap(api.GET("/api/admin/studies/{study}/links", path));
  const known = links.find((one) => one.kind === "general" && one.recruiter === null);
  if (known !== undefined) return known;
  const body = { kind: "general" as const, label: "everybody", labels: [], count: 1 };
  const [made] = await unwrap(api.POST("/api/admin/studies/{study}/links", { ...path, body }));
  if (made === undefined) throw new Error("expected a new link, got none; make one under Links");
  return made;
}

function Address({ label, url }: { label: string; url: string }) {
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
