import { Stack, Title } from "@mantine/core";
import { LoginsCard } from "./LoginsCard";
import { MailCard } from "./MailCard";
import { PasswordCard } from "./PasswordCard";
import { SecondFactorCard } from "./SecondFactorCard";
import { SessionsCard } from "./SessionsCard";
import { TokensCard } from "./TokensCard";

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
