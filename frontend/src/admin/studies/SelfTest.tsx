/** The way of a recruiter's participant, walked by a simulated one: into the study by a test id, through a preview, and back. */

import { Button, List, Stack, Text } from "@mantine/core";
import { useMutation } from "@tanstack/react-query";
import { useState } from "react";
import { api, type Schemas, unwrap } from "../api";
import { addressFor, RECRUITER_NAMES } from "./recruiting";

/** Ids in the form of each recruiter, of nobody. */
const TEST_IDS: Record<string, string> = {
  prolific: "5e1f7e5700000000000000ab",
  sona: "selftest",
  mturk: "A1SELFTEST",
  generic: "selftest",
};
const PROLIFIC_URL = "https://app.prolific.com/submissions/complete?cc={code}";
const LABEL = "Self-test";
const SECONDS = 180;
const LOOK_EVERY_MS = 200;

interface Step {
  label: string;
  /** Null while it is not known yet. */
  passed: boolean | null;
  detail: string;
}

type Texts = Record<string, unknown>;
const textOf = (recruiter: Texts, name: string) => (typeof recruiter[name] === "string" ? recruiter[name] : "");

/** The address that participants are sent to at the end; `{run}` stays, which only the server knows. */
export function expectedReturn(recruiter: Texts, code: string, parameters: URLSearchParams): string {
  const address = textOf(recruiter, "redirect_url") || (recruiter["kind"] === "prolific" ? PROLIFIC_URL : "");
  const values = [...parameters, ["code", code] as const];
  return values.reduce((filled, [name, value]) => filled.replaceAll(`{${name}}`, encodeURIComponent(value)), address);
}

/** Whether an address is the one that is configured, whatever the run's id. */
export function isReturn(address: string, expected: string): boolean {
  const parts = expected.split("{run}").map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
  return new RegExp(`^${parts.join("[^/?#&]+")}$`).test(address);
}

/** The study's link with a test id in the place of what the recruiter fills in. */
export function testAddress(url: string, recruiter: Texts): string {
  const [first = ""] = addressFor("", recruiter).slice(1).split("=");
  const id = TEST_IDS[String(recruiter["kind"])] ?? "selftest";
  return `${url}?${first}=${id}&STUDY_ID=selftest&SESSION_ID=selftest`;
}

async function previewLink(study: string): Promise<string> {
  const path = { params: { path: { study } } };
  const { links } = await unwrap(api.GET("/api/admin/studies/{study}/links", path));
  const known = links.find(({ kind, label }) => kind === "preview" && label === LABEL);
  if (known !== undefined) return known.url;
  const body: Schemas["NewLinks"] = { kind: "preview", label: LABEL, labels: [], count: 1, group: "" };
  const [made] = await unwrap(api.POST("/api/admin/studies/{study}/links", { ...path, body }));
  if (made === undefined) throw new Error("The server made no preview link.");
  return made.url;
}

/** A link signed for a test id, where the recruiter signs its addresses; only owners can make one. */
async function addressOf(study: string, url: string, recruiter: Texts): Promise<string> {
  if (textOf(recruiter, "signature_parameter") === "") return testAddress(url, recruiter);
  const signing = await unwrap(api.GET("/api/admin/studies/{study}/links/signing", { params: { path: { study }, query: {} } }));
  return `${url}?${signing.query}`;
}

const pause = () => new Promise((resolve) => setTimeout(resolve, LOOK_EVERY_MS));

/** What `look` finds in the window within the time; an error with the window's own words where it finds nothing. */
async function awaited(opened: Window, look: (page: Document) => Element | null): Promise<Element> {
  for (const end = Date.now() + SECONDS * 1000; Date.now() < end; await pause()) {
    if (opened.closed) throw new Error("The window was closed before the end.");
    const seen = look(opened.document);
    if (seen !== null) return seen;
    const refusal = opened.document.querySelector('[role="alert"]')?.textContent ?? "";
    if (refusal !== "") throw new Error(refusal);
  }
  const words = opened.document.body.textContent.trim().slice(0, 200);
  throw new Error(`The end was not reached in ${String(SECONDS)} s. The page says: ${words}`);
}

async function walk(study: string, recruiter: Texts, opened: Window, say: (steps: Step[]) => void, previews: () => Promise<number>) {
  const service = RECRUITER_NAMES[String(recruiter["kind"])] ?? "the recruiter";
  const steps: Step[] = [
    { label: `The study opens with the parameters of ${service}`, passed: null, detail: "" },
    { label: "A simulated participant finishes", passed: null, detail: "" },
    { label: "The completion code is as configured", passed: null, detail: "" },
    { label: "The redirect is as configured", passed: null, detail: "" },
    { label: "The test is left out of the results", passed: null, detail: "" },
  ];
  const note = (index: number, passed: boolean, detail: string) => {
    steps[index] = { label: steps[index]?.label ?? "", passed, detail };
    say([...steps]);
  };
  say(steps);
  let now = 0;
  try {
    const before = await previews();
    const address = new URL(await addressOf(study, await previewLink(study), recruiter), location.href);
    opened.location.replace(`${location.origin}${address.pathname}${address.search}&simulate=data-only`);
    const start = await awaited(opened, (page) => page.querySelector("button.primary"));
    note(0, true, address.search.slice(1));
    now = 1;
    (start as HTMLButtonElement).click();
    const shown = await awaited(opened, (page) => page.querySelector(".code output"));
    const code = shown.textContent.trim();
    const way = opened.document.querySelector<HTMLAnchorElement>("a.button.primary")?.getAttribute("href") ?? "";
    note(1, true, "It is a preview, answered without showing the clips.");
    now = 2;
    const declared = textOf(recruiter, "code_complete");
    if (declared === "") note(2, recruiter["kind"] !== "prolific", `No code is configured; this run got a random one, ${code}.`);
    else note(2, code === declared, code === declared ? code : `expected ${declared}, got ${code}`);
    now = 3;
    const expected = expectedReturn(recruiter, code, address.searchParams);
    const isRight = expected === "" ? way === "" : isReturn(way, expected);
    const words = expected === "" ? "No redirect URL is configured: participants are shown the code." : way;
    note(3, isRight, isRight ? words : `expected ${expected || "none"}, got ${way || "none"}`);
    now = 4;
    const isPreview = (await previews()) > before;
    note(4, isPreview, isPreview ? "Its run is stored as a preview and is not part of the results." : "Its run is not among the previews.");
  } catch (error) {
    note(now, false, error instanceof Error ? error.message : String(error));
  } finally {
    opened.close();
  }
}

const MARKS = new Map([
  [true, "Passed"],
  [false, "Failed"],
]);

export function SelfTest({ detail }: { detail: Schemas["StudyDetail"] }) {
  const { name } = detail.summary;
  const [steps, setSteps] = useState<Step[]>([]);
  // Not the complete runs: a participant may finish meanwhile.
  const previews = async () => {
    const params = { path: { study: name }, query: { origin: "preview" as const } };
    return (await unwrap(api.GET("/api/admin/studies/{study}/monitor", { params }))).complete;
  };
  const test = useMutation({ mutationFn: async (opened: Window) => walk(name, detail.recruiter ?? {}, opened, setSteps, previews) });
  const begin = () => {
    // Opened at the press, as later no browser would let it be; as wide as a participant's window.
    const opened = window.open("about:blank", "palpebra-self-test", "popup,width=1280,height=860");
    if (opened === null)
      setSteps([{ label: "A window opens", passed: false, detail: "The browser blocked it; allow pop-ups for this page and try again." }]);
    else test.mutate(opened);
  };
  return (
    <Stack gap="xs" align="flex-start">
      <Text size="sm">
        4. Test the redirect: a simulated participant with a test ID takes a preview of the study in a separate window. This tests the saved
        settings, but not links with their own recruiter.
      </Text>
      <Button variant="default" onClick={begin} loading={test.isPending}>
        Test the redirect
      </Button>
      {steps.length > 0 && (
        <List size="sm" aria-label="Self-test" role="list" aria-live="polite">
          {steps.map(({ label, passed, detail: words }) => (
            <List.Item key={label} className="wrap-anywhere">
              <Text span size="sm" fw={600} c={passed === false ? "var(--mantine-color-error)" : "inherit"}>
                {passed === null ? (test.isPending ? "Waiting" : "Not tested") : MARKS.get(passed)}
              </Text>
              {`: ${label}${words === "" ? "" : ` (${words})`}`}
            </List.Item>
          ))}
        </List>
      )}
    </Stack>
  );
}
