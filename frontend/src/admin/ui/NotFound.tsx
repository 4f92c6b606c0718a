import { Anchor, Container, Text, Title } from "@mantine/core";
import { Link } from "@tanstack/react-router";

export function NotFound() {
  return (
    <Container size="sm" py="xl">
      <Title order={1}>Nothing is here</Title>
      <Text my="md">The address may be mistyped, or the study was deleted.</Text>
      <Anchor component={Link} to="/">
        All studies
      </Anchor>
    </Container>
  );
}
