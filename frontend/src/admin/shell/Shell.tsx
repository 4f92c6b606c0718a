/** The frame of every page: who is signed in, where one can go. */

import { AppShell, Burger, Group, NavLink, Text, Title } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { Link, Navigate, Outlet, useLocation } from "@tanstack/react-router";
import { sessionQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { AccountMenu } from "./AccountMenu";

const PAGES = [
  { to: "/", label: "Studies", role: "viewer" },
  { to: "/blinks", label: "Blinks", role: "viewer" },
  { to: "/labelling", label: "Label video", role: "viewer" },
  { to: "/blink-review", label: "Review blinks", role: "viewer" },
  { to: "/people", label: "People", role: "owner" },
  { to: "/audit", label: "Audit log", role: "owner" },
  { to: "/account", label: "My account", role: "viewer" },
] as const;

export function Shell() {
  const session = useQuery(sessionQuery);
  const [opened, { toggle, close }] = useDisclosure(false);
  const { pathname } = useLocation();
  return (
    <Answer of={session}>
      {({ account }) =>
        account === null ? (
          <Navigate to="/sign-in" search={{ next: pathname }} replace />
        ) : (
          <AppShell
            header={{ height: 52 }}
            navbar={{ width: 200, breakpoint: "sm", collapsed: { mobile: !opened } }}
            padding="md"
          >
            <AppShell.Header>
              <a className="skip-link" href="#content">
                Skip to the content
              </a>
              <Group h="100%" px="md" justify="space-between" wrap="nowrap">
                <Group gap="sm" wrap="nowrap">
                  <Burger opened={opened} onClick={toggle} hiddenFrom="sm" size="sm" aria-label="Menu" />
                  <Title order={2} size="h3">
                    Palpebra
                  </Title>
                  <Text c="dimmed" size="sm" visibleFrom="sm">
                    clip-rating studies
                  </Text>
                </Group>
                <AccountMenu account={account} />
              </Group>
            </AppShell.Header>
            <AppShell.Navbar p="xs">
              {PAGES.filter(({ role }) => role === "viewer" || account.role === "owner").map(({ to, label }) => (
                <NavLink
                  key={to}
                  component={Link}
                  to={to}
                  label={label}
                  onClick={close}
                  active={to === "/" ? pathname === "/" || pathname.startsWith("/studies") : pathname.startsWith(to)}
                />
              ))}
            </AppShell.Navbar>
            <AppShell.Main id="content">
              <Outlet />
            </AppShell.Main>
          </AppShell>
        )
      }
    </Answer>
  );
}
