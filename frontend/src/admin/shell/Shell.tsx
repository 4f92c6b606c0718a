/** The frame of every page: who is signed in, where one can go. */

import { Button, Menu, useMantineColorScheme, Alert, AppShell, Burger, Group, NavLink, Text } from "@mantine/core";
import { Link, Outlet, useLocation, useNavigate } from "@tanstack/react-router";
import { api, type Schemas, unwrap, studyQuery, SIGN_IN_AGAIN, sessionQuery } from "../api";
import { useChange } from "../ui/useChange";
import { useDocumentTitle, useDisclosure } from "@mantine/hooks";
import { useQuery } from "@tanstack/react-query";
import { useEffect, useState } from "react";
import { Answer, onDemand } from "../ui/Answer";

function AccountMenu({ account }: { account: Schemas["AccountOut"] }) {
  const { colorScheme, setColorScheme } = useMantineColorScheme();
  const signOut = useChange(() => unwrap(api.DELETE("/api/admin/session")), {
    touches: [],
    // A fresh page: no loaded data stay in memory for the next person.
    then: () => window.location.assign("/admin/sign-in"),
  });
  return (
    <Menu position="bottom-end">
      <Menu.Target>
        <Button variant="subtle" size="compact-md">
          {account.name} ▾
        </Button>
      </Menu.Target>
      <Menu.Dropdown>
        <Menu.Label>{account.role}</Menu.Label>
        <Menu.Item component={Link} to="/account">
          My account
        </Menu.Item>
        <Menu.Item component="a" href="/docs/" target="_blank" rel="noreferrer">
          Documentation
        </Menu.Item>
        {(["auto", "light", "dark"] as const).map((scheme) => (
          <Menu.Item key={scheme} onClick={() => setColorScheme(scheme)} disabled={scheme === colorScheme}>
            {scheme === "auto" ? "System" : scheme === "light" ? "Light" : "Dark"}
          </Menu.Item>
        ))}
        <Menu.Divider />
        <Menu.Item onClick={() => signOut.mutate(undefined)}>Sign out</Menu.Item>
      </Menu.Dropdown>
    </Menu>
  );
}

// What the browser's tab says: the page, and the study that it is of.

const PAGE_TITLES: Record<string, string> = {
  "": "Studies",
  new: "New study",
  analyze: "Analyze a table",
  blinks: "Blinks",
  labelling: "Label video",
  "blink-review": "Review blinks",
  people: "People",
  workspaces: "Workspaces",
  backups: "Backups",
  audit: "Audit log",
  account: "My account",
};

function usePageTitle(pathname: string): void {
  const [first = "", study = "", tab = "design", run, part] = pathname.split("/").slice(1);
  const isStudy = first === "studies" && study !== "" && study !== "new";
  const title = useQuery({ ...studyQuery(study), enabled: isStudy }).data?.summary.title ?? study;
  const page = `${(tab || "design").charAt(0).toUpperCase()}${(tab || "design").slice(1)}`;
  const words = isStudy
    ? [run === undefined ? page : `${part === "replay" ? "Replay of run" : "Run"} ${run.slice(0, 8)}`, title]
    : [PAGE_TITLES[study === "new" ? "new" : first] ?? "Not found"];
  useDocumentTitle([...words, "Palpebra"].join(" – "));
}

const SignInAgain = onDemand(async () => (await import("./SignInAgain")).SignInAgain);

const PAGES = [
  { to: "/", label: "Studies", role: "viewer", group: "Rating" },
  { to: "/analyze", label: "Analyze a table", role: "viewer", group: "Rating" },
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
