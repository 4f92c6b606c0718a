import { Button, Menu, useMantineColorScheme } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import { api, type Schemas, unwrap } from "../api";
import { useChange } from "../ui/useChange";

export function AccountMenu({ account }: { account: Schemas["AccountOut"] }) {
  const { colorScheme, setColorScheme } = useMantineColorScheme();
  const signOut = useChange(() => unwrap(api.DELETE("/api/admin/session")), {
    touches: [],
    // A fresh page: nothing of what was loaded stays in memory for whoever comes next.
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
        {(["auto", "light", "dark"] as const).map((scheme) => (
          <Menu.Item key={scheme} onClick={() => setColorScheme(scheme)} disabled={scheme === colorScheme}>
            {scheme === "auto" ? "As the system" : scheme === "light" ? "Light" : "Dark"}
          </Menu.Item>
        ))}
        <Menu.Divider />
        <Menu.Item onClick={() => signOut.mutate(undefined)}>Sign out</Menu.Item>
      </Menu.Dropdown>
    </Menu>
  );
}
