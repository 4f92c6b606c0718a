/** One's own account: ways to sign in, mail, password, second factor, sessions and tokens. */

import { Button, Modal, Stack, Card, Group, Text, Title, TextInput, Alert, Code, PinInput, Badge, Checkbox } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { type SubmitEvent, useState } from "react";
import { api, type Schemas, unwrap, sessionQuery } from "../api";
import { useChange } from "../ui/useChange";
import { PasswordField, Refusal, waysQuery } from "./entry";
import { useQuery } from "@tanstack/react-query";
import { ConfirmButton } from "../ui/ConfirmButton";
import { DataTable } from "../ui/DataTable";
import { Answer } from "../ui/Answer";
import { when, browserName } from "../ui/format";

// Gives the own account a login with a service, once the password was asked for: an open browser alone does not do.

function AddLogin({ id, label }: Schemas["ProviderOut"]) {
  const [opened, { open, close }] = useDisclosure(false);
  const [proof, setProof] = useState("");
  const begin = useChange(() => unwrap(api.POST("/api/admin/logins/{provider}", { params: { path: { provider: id } }, body: { proof } })), {
    touches: [],
    then: ({ url }) => window.location.assign(url),
  });
  const leave = () => {
    setProof("");
    close();
  };
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    begin.mutate(undefined);
  };
  return (
    <>
      <Button variant="default" onClick={open}>
        Add {label}
      </Button>
      <Modal opened={opened} onClose={leave} title={`Add ${label}`} closeButtonProps={{ "aria-label": "Close" }}>
        <Stack component="form" onSubmit={submit}>
          <PasswordField
            label="Your password"
            description="If the account has no password: a code from your authenticator app, or a recovery code."
            value={proof}
            onChange={setProof}
            data-autofocus
          />
          <Button type="submit" loading={begin.isPending}>
            Go to {label}
          </Button>
        </Stack>
      </Modal>
    </>
  );
}

// By which other services the own account is signed in to. Shown only where this server knows any.

function LoginsCard() {
  const ways = useQuery(waysQuery);
  const logins = useQuery({ queryKey: ["logins"], queryFn: () => unwrap(api.GET("/api/admin/logins")) });
  const remove = useChange((login_id: number) => unwrap(api.DELETE("/api/admin/logins/{login_id}", { params: { path: { login_id } } })), {
    touches: [["logins"]],
    done: "Login removed.",
  });
  const providers = ways.data?.providers ?? [];
  if (providers.length === 0) return null;
  const labels = new Map(providers.map(({ id, label }) => [id, label]));
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          Other ways to sign in
        </Title>
        <Refusal />
        <Answer of={logins}>
          {(rows) => (
            <DataTable
              rows={rows}
              rowKey={(row) => row.id}
              empty="Only name and password."
              columns={[
                { title: "Service", cell: (row) => labels.get(row.provider) ?? row.issuer },
                { title: "As", cell: (row) => row.label },
                { title: "Last used", wide: true, cell: (row) => when(row.last_used_at) },
                {
                  title: "Action",
                  cell: (row) => (
                    <ConfirmButton
                      size="xs"
                      label="Remove"
                      question={`“${row.label}” will no longer sign in to this account.`}
                      confirm="Remove"
                      onConfirm={() => remove.mutate(row.id)}
                    />
                  ),
                },
              ]}
            />
          )}
        </Answer>
        <Group>
          {providers.map((provider) => (
            <AddLogin key={provider.id} {...provider} />
          ))}
        </Group>
        <Text size="sm" c="dimmed">
          You sign in at the service and return here.
        </Text>
      </Stack>
    </Card>
  );
}

// The address of mail of the own account. Shown only where this server sends mail.

function MailCard() {
  const ways = useQuery(waysQuery);
  const mail = useQuery({ queryKey: ["mail"], queryFn: () => unwrap(api.GET("/api/admin/mail")) });
  const [address, setAddress] = useState("");
  const [password, setPassword] = useState("");
  const change = useChange(() => unwrap(api.PUT("/api/admin/mail", { body: { address, password } })), {
    touches: [],
    done: "Check your email and open the link within half an hour.",
    then: () => setPassword(""),
  });
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/mail", { body: { password } })), {
    touches: [["mail"]],
    done: "Address removed.",
    then: () => setPassword(""),
  });
  if (ways.data?.resets_by_mail !== true) return null;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    change.mutate(undefined);
  };
  const known = mail.data?.address ?? null;
  return (
    <Card withBorder component="form" onSubmit={submit}>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Email address
        </Title>
        <Text size="sm">
          {known === null ? "None: without an address you cannot reset a forgotten password." : `Password reset links go to ${known}.`}
        </Text>
        <TextInput
          w="100%"
          maw={360}
          type="email"
          label="Address"
          autoComplete="email"
          required
          value={address}
          onChange={(event) => setAddress(event.currentTarget.value)}
        />
        <PasswordField w="100%" maw={360} label="Your password" value={password} onChange={setPassword} />
        <Group>
          <Button type="submit" loading={change.isPending}>
            Send a confirmation email
          </Button>
          {known !== null && (
            <Button variant="default" disabled={password === ""} onClick={() => remove.mutate(undefined)}>
              Remove
            </Button>
          )}
        </Group>
      </Stack>
    </Card>
  );
}

function PasswordCard() {
  const [password, setPassword] = useState("");
  const [fresh, setFresh] = useState("");
  const change = useChange(() => unwrap(api.PUT("/api/admin/password", { body: { password, new_password: fresh } })), {
    touches: [["sessions"]],
    done: "Password changed; your other sessions have ended.",
    then: () => {
      setPassword("");
      setFresh("");
    },
  });
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    change.mutate(undefined);
  };
  return (
    <Card withBorder component="form" onSubmit={submit}>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Password
        </Title>
        <PasswordField w="100%" maw={360} label="Current password" value={password} onChange={setPassword} />
        <PasswordField w="100%" maw={360} label="New password" fresh value={fresh} onChange={setFresh} />
        <Button type="submit" loading={change.isPending}>
          Change password
        </Button>
      </Stack>
    </Card>
  );
}

function SecondFactorCard() {
  const { data } = useQuery(sessionQuery);
  const [setup, setSetup] = useState<Schemas["SecondFactorSetup"] | null>(null);
  const [codes, setCodes] = useState<string[] | null>(null);
  const start = useChange(() => unwrap(api.POST("/api/admin/second-factor")), { touches: [], then: setSetup });
  const on = data?.account?.second_factor === true;
  return (
    <Card withBorder>
      <Stack align="flex-start">
        <Title order={2} size="h4">
          Second factor
        </Title>
        {codes !== null && <RecoveryCodes codes={codes} />}
        {on ? (
          <Remove />
        ) : setup === null ? (
          <>
            <Text size="sm">Off. With an authenticator app on your phone, a stolen password alone is useless.</Text>
            <Button onClick={() => start.mutate(undefined)} loading={start.isPending}>
              Set up
            </Button>
          </>
        ) : (
          <Confirm
            setup={setup}
            done={(fresh) => {
              setSetup(null);
              setCodes(fresh);
            }}
          />
        )}
      </Stack>
    </Card>
  );
}

function Confirm({ setup, done }: { setup: Schemas["SecondFactorSetup"]; done: (codes: string[]) => void }) {
  const confirm = useChange((code: string) => unwrap(api.PUT("/api/admin/second-factor", { body: { code } })), {
    touches: [sessionQuery.queryKey],
    then: ({ codes }) => done(codes),
  });
  const picture = `data:image/svg+xml;utf8,${encodeURIComponent(setup.qr_svg)}`;
  return (
    <>
      <Text size="sm">Scan this with your authenticator app, or type in the secret. Then enter the code that the app shows.</Text>
      <img src={picture} alt="QR code of the secret" width={200} height={200} className="qr" />
      <Code block className="wrap-anywhere">
        {setup.secret}
      </Code>
      <PinInput length={6} type="number" oneTimeCode aria-label="Code from the app" onComplete={(code) => confirm.mutate(code)} />
    </>
  );
}

function RecoveryCodes({ codes }: { codes: string[] }) {
  return (
    <Alert title="Keep these recovery codes" color="yellow">
      <Text mb="xs">Each code signs you in once without your phone. They are shown only now.</Text>
      <Code block>{codes.join("\n")}</Code>
    </Alert>
  );
}

function Remove() {
  const [password, setPassword] = useState("");
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/second-factor", { body: { password } })), {
    touches: [sessionQuery.queryKey],
    done: "Second factor turned off.",
  });
  return (
    <Group align="end">
      <Text w="100%" size="sm">
        On: signing in requires the code from your authenticator app.
      </Text>
      <PasswordField
        label="Password to turn it off (or a code, if you have no password)"
        required={false}
        value={password}
        onChange={setPassword}
        w={260}
      />
      <Button variant="default" disabled={password === ""} onClick={() => remove.mutate(undefined)}>
        Turn off
      </Button>
    </Group>
  );
}

function SessionsCard() {
  const sessions = useQuery({ queryKey: ["sessions"], queryFn: () => unwrap(api.GET("/api/admin/sessions")) });
  const end = useChange(
    (session_id: number) => unwrap(api.DELETE("/api/admin/sessions/{session_id}", { params: { path: { session_id } } })),
    { touches: [["sessions"]], done: "Browser signed out." },
  );
  return (
    <Card withBorder>
      <Title order={2} size="h4" mb="sm">
        Where you are signed in
      </Title>
      <Answer of={sessions}>
        {(rows) => (
          <DataTable
            rows={rows}
            rowKey={(row) => row.id}
            empty="You are signed in nowhere else."
            columns={[
              { title: "Browser", cell: (row) => <span title={row.user_agent}>{browserName(row.user_agent)}</span> },
              { title: "Last seen", wide: true, cell: (row) => when(row.last_seen_at) },
              {
                title: "Action",
                cell: (row) =>
                  row.current ? (
                    <Badge variant="default">this one</Badge>
                  ) : (
                    <Button size="xs" variant="default" onClick={() => end.mutate(row.id)}>
                      Sign out
                    </Button>
                  ),
              },
            ]}
          />
        )}
      </Answer>
    </Card>
  );
}

type Scope = Schemas["NewToken"]["scopes"][number];
const SCOPES: Scope[] = ["read", "personal", "write", "export"];

function TokensCard() {
  const tokens = useQuery({ queryKey: ["tokens"], queryFn: () => unwrap(api.GET("/api/admin/tokens")) });
  const [name, setName] = useState("");
  const [scopes, setScopes] = useState<string[]>(["read"]);
  const [fresh, setFresh] = useState<string | null>(null);
  const create = useChange(
    () => unwrap(api.POST("/api/admin/tokens", { body: { name, scopes: SCOPES.filter((scope) => scopes.includes(scope)), days: 365 } })),
    { touches: [["tokens"]], then: ({ token }) => setFresh(token) },
  );
  const revoke = useChange((token_id: number) => unwrap(api.DELETE("/api/admin/tokens/{token_id}", { params: { path: { token_id } } })), {
    touches: [["tokens"]],
    done: "Token revoked.",
  });
  return (
    <Card withBorder>
      <Stack>
        <Title order={2} size="h4">
          API tokens
        </Title>
        <Text size="sm">For scripts: send it as “Authorization: Bearer …”. A token never has more rights than you.</Text>
        {fresh !== null && (
          <Alert title="Your new token (shown only now)" color="yellow">
            <Code block className="wrap-anywhere">
              {fresh}
            </Code>
          </Alert>
        )}
        <Group align="end">
          <TextInput label="Name" value={name} onChange={(event) => setName(event.currentTarget.value)} />
          <Checkbox.Group value={scopes} onChange={setScopes} label="May">
            <Group mt={6}>
              {SCOPES.map((scope) => (
                <Checkbox key={scope} value={scope} label={scope} />
              ))}
            </Group>
          </Checkbox.Group>
          <Button disabled={name === "" || scopes.length === 0} onClick={() => create.mutate(undefined)}>
            Create token
          </Button>
        </Group>
        <Answer of={tokens}>
          {(rows) => (
            <DataTable
              rows={rows}
              rowKey={(row) => row.id}
              empty="No tokens yet."
              columns={[
                { title: "Name", cell: (row) => row.name },
                { title: "May", cell: (row) => row.scopes.join(", ") },
                { title: "Last used", wide: true, cell: (row) => when(row.last_used_at) },
                { title: "Ends", wide: true, cell: (row) => when(row.expires_at) },
                {
                  title: "Action",
                  cell: (row) => (
                    <ConfirmButton
                      size="xs"
                      label="Revoke"
                      question={`Scripts that use “${row.name}” will stop working.`}
                      confirm="Revoke"
                      onConfirm={() => revoke.mutate(row.id)}
                    />
                  ),
                },
              ]}
            />
          )}
        </Answer>
      </Stack>
    </Card>
  );
}

export function AccountPage() {
  return (
    <Stack maw={760}>
      <Title order={1}>My account</Title>
      <SecondFactorCard />
      <PasswordCard />
      <MailCard />
      <LoginsCard />
      <SessionsCard />
      <TokensCard />
    </Stack>
  );
}
