/** The first page that `palpebra` opens: three ways to begin. Its secrets follow '#', so no log ever contains them. */
import { Anchor, Button, Card, Container, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useDocumentTitle } from "@mantine/hooks";
import { useState } from "react";

interface Known {
  demo: string | null;
  /** How long the demo takes; null from a server that does not say. */
  minutes: string | null;
  invitation: string | null;
  folder: string | null;
}

const FROM_CLIPS = "/studies/new";
const FROM_TABLE = "/analyze";

function whatIsKnown(): Known {
  const parts = new URLSearchParams(window.location.hash.slice(1));
  const demo = parts.get("demo");
  // Only a path of this server: the page must not send anyone elsewhere.
  const minutes = parts.get("minutes");
  return {
    demo: demo?.startsWith("/run/") === true ? demo : null,
    minutes,
    invitation: parts.get("invitation"),
    folder: parts.get("folder"),
  };
}

export function StartPage() {
  useDocumentTitle("Welcome – Palpebra");
  const [{ demo, minutes, invitation, folder }] = useState(whatIsKnown);
  const first = invitation === null ? "" : "Create your account first. ";
  const entrance = (to: string) => (invitation === null ? "/admin" + to : `/admin/invitation?next=${encodeURIComponent(to)}#${invitation}`);
  return (
    <Container size="lg" py={48} component="main">
      <Title order={1} ta="center">
        Welcome to Palpebra
      </Title>
      <Text ta="center" c="dimmed" mb="xl">
        Rating studies with short clips. Where do you want to start?
      </Text>
      <SimpleGrid cols={{ base: 1, sm: 3 }}>
        {demo !== null && (
          <Choice
            title="Try the demo study"
            text={`Take part yourself: watch blinks and rate how natural they look. ${minutes === null ? "" : `All of it takes about ${minutes} ${minutes === "1" ? "minute" : "minutes"}. `}Stop whenever you like.`}
            button="Take part"
            href={demo}
            newTab
          />
        )}
        <Choice
          title="Make a study from my clips"
          text={`${first}Upload clips, say what varies, and get a link for participants.`}
          button={invitation === null ? "New study" : "Create account"}
          href={entrance(FROM_CLIPS)}
        />
        <Choice
          title="Analyze data"
          text={`${first}Drop a table of ratings that you already have: ANOVA, mixed models, pairs or opinion scores.`}
          button={invitation === null ? "Choose a table" : "Create account"}
          label={invitation === null ? "Choose a table" : "Create account and choose a table"}
          href={entrance(FROM_TABLE)}
        />
      </SimpleGrid>
      <Group justify="center" mt="xl" gap="lg">
        <Anchor href="/docs/" size="sm">
          Documentation
        </Anchor>
        {folder !== null && (
          <Text size="sm" c="dimmed">
            Your data are in {folder}
          </Text>
        )}
      </Group>
    </Container>
  );
}

interface ChoiceProps {
  title: string;
  text: string;
  button: string;
  /** The button's name where another one has the same words. */
  label?: string;
  href: string;
  newTab?: boolean;
}

function Choice({ title, text, button, label = button, href, newTab = false }: ChoiceProps) {
  return (
    <Card withBorder padding="lg">
      <Stack h="100%" justify="space-between">
        <div>
          <Title order={2} size="h4" mb="xs">
            {title}
          </Title>
          <Text size="sm">{text}</Text>
        </div>
        <Button component="a" href={href} aria-label={label} {...(newTab ? { target: "_blank", rel: "noreferrer" } : {})}>
          {button}
        </Button>
      </Stack>
    </Card>
  );
}
