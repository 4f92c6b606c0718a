/** Asking for a letter with a link, and where the links of letters lead. */

import { useParams } from "@tanstack/react-router";
import { ForgottenPage } from "./ForgottenPage";
import { MailPage } from "./MailPage";
import { NewPasswordPage } from "./NewPasswordPage";

/** `/letter/forgotten` asks for one; `/letter/password#TOKEN` and `/letter/address#TOKEN` are in them. */
export function LetterPage() {
  const { about }: { about?: string } = useParams({ strict: false });
  if (about === "password") return <NewPasswordPage />;
  return about === "address" ? <MailPage /> : <ForgottenPage />;
}
