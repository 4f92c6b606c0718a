import { Alert, Button, Card, Code, Group, PinInput, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { sessionQuery } from "../queries";
import { useChange } from "../ui/useChange";
import { PasswordField } from "./fields";

export function SecondFactorCard() {
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
      <Text size="sm">Scan this with your authenticator app, or type the secret in; then enter the code that the app shows.</Text>
      <img src={picture} alt="QR code of the secret" width={200} height={200} className="qr" />
      <Code block className="wrap-anywhere">
        {setup.secret}
      </Code>
      <PinInput length={6} type="number" oneTimeCode aria-label="Code of the app" onComplete={(code) => confirm.mutate(code)} />
    </>
  );
}

function RecoveryCodes({ codes }: { codes: string[] }) {
  return (
    <Alert title="Keep these recovery codes" color="yellow">
      <Text mb="xs">Each signs you in once without the phone. They are shown only now.</Text>
      <Code block>{codes.join("\n")}</Code>
    </Alert>
  );
}

function Remove() {
  const [password, setPassword] = useState("");
  const remove = useChange(() => unwrap(api.DELETE("/api/admin/second-factor", { body: { password } })), {
    touches: [sessionQuery.queryKey],
    done: "The second factor is off.",
  });
  return (
    <Group align="end">
      <Text w="100%" size="sm">
        On: signing in asks for the code of your authenticator app.
      </Text>
      <PasswordField
        label="Password, to turn it off (without one: a code)"
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
