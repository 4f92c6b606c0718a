/** The frame of every page: who is signed in, where one can go. */

import { Alert, AppShell, Burger, Group, NavLink, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { Link, Outlet, useLocation, useNavigate } from "@tanstack/react-router";
import { useEffect, useState } from "react";
import { type Schemas, SIGN_IN_AGAIN } from "../api";
import { sessionQuery } from "../queries";
import { Answer } from "../ui/Answer";
import { AccountMenu } from "./AccountMenu";
import { onDemand } from "../ui/onDemand";
import { usePageTitle } from "./usePageTitle";

const SignInAgain = onDemand(async () => (await import("./SignInAgain")).SignInAgain);

const PAGES = [
  { to: "/", label: "Studies", role: "viewer", group: "Rating" },
  { to: "/blinks", label: "Blinks", role: "viewer", group: "Stimuli" },
  { to: "/labelling", label: "Label video", role: "viewer", group: "Stimuli" },
  { to: "/blink-review", label: "Review blinks", role: "viewer", group: "Stimuli" },
  { to: "/workspaces", label: "Workspaces", role: "viewer", group: "This server" },
  { to: "/people", label: "People", role: "owner", group: "This server" },
  { to: "/backups", label: "Backups", role: "owner", group: "This server" },
  { to: "/audit", label: "Audit log", role: "owner", group: "This server" },
  { to: "/account", label: "My account", role: "viewer", group: "This server" },
] as const;
const GROUPS = [...new Set(PAGES.map(({ group }) => group))];

/** Leads to the page to sign in, once: the address changes while that page still loads. */
function ToSignIn({ from }: { from: string }) {
  const navigate = useNavigate();
  const [next] = useState(from);
  useEffect(() => void navigate({ to: "/sign-in", search: { next }, replace: true }), [navigate, next]);
  return null;
}

/** Who was signed in on this page last, and whether a sign-in is asked for over it. */
function useSignedIn(present: Schemas["AccountOut"] | null | undefined) {
  const [last, setLast] = useState(present ?? null);
  const [again, setAgain] = useState(false);
  if (present && present !== last) setLast(present);
  useEffect(() => {
    const ask = () => setAgain(true);
    window.addEventListener(SIGN_IN_AGAIN, ask);
    return () => window.removeEventListener(SIGN_IN_AGAIN, ask);
  }, []);
  return { last: present ?? last, again, onDone: () => setAgain(false) };
}

export function Shell() {
  const session = useQuery(sessionQuery);
  const { last, again, onDone } = useSignedIn(session.data?.account);
  const [opened, { toggle, close }] = useDisclosure(false);
  const { pathname } = useLocation();
  usePageTitle(pathname);
  return (
    <Answer of={session}>
      {({ account: present }) => {
        const account = present ?? last;
        return account === null ? (
          <ToSignIn from={pathname} />
        ) : (
          <AppShell header={{ height: 52 }} navbar={{ width: 200, breakpoint: "sm", collapsed: { mobile: !opened } }} padding="md">
            <AppShell.Header>
              <a className="skip-link" href="#content">
                Skip to the content
              </a>
              <Group h="100%" px="md" justify="space-between" wrap="nowrap">
                <Group gap="sm" wrap="nowrap">
                  <Burger opened={opened} onClick={toggle} hiddenFrom="sm" size="sm" aria-label="Menu" />
                  <Text fw={700} size="lg">
                    Palpebra
                  </Text>
                  <Text c="dimmed" size="sm" visibleFrom="sm">
                    clip-rating studies
                  </Text>
                </Group>
                <AccountMenu account={account} />
              </Group>
            </AppShell.Header>
            <AppShell.Navbar p="xs">
              {GROUPS.map((group) => (
                <div key={group}>
                  <Text size="xs" c="dimmed" px="sm" pt="sm" pb={4}>
                    {group}
                  </Text>
                  {PAGES.filter((page) => page.group === group && (page.role === "viewer" || account.role === "owner")).map(
                    ({ to, label }) => (
                      <NavLink
                        key={to}
                        component={Link}
                        to={to}
                        label={label}
                        onClick={close}
                        active={to === "/" ? pathname === "/" || pathname.startsWith("/studies") : pathname.startsWith(to)}
                      />
                    ),
                  )}
                </div>
              ))}
            </AppShell.Navbar>
            <AppShell.Main id="content">
              {account.role !== "owner" && PAGES.some(({ to, role }) => role === "owner" && pathname.startsWith(to)) ? (
                <Alert color="yellow" title="This page is for owners of the server">
                  Your role on this server is {account.role}. Ask an owner.
                </Alert>
              ) : (
                <Outlet />
              )}
              {(present === null || again) && <SignInAgain account={account} ended={present === null} onDone={onDone} />}
            </AppShell.Main>
          </AppShell>
        );
      }}
    </Answer>
  );
}
