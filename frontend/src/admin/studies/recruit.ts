/** The address that a recruiter is given: with the parameter by which it names the participant. */

/** What each recruiter fills in by itself, in the form that its pages ask for. */
const PARAMETERS: Record<string, readonly (readonly [name: string, value: string])[]> = {
  prolific: [
    ["PROLIFIC_PID", "{{%PROLIFIC_PID%}}"],
    ["STUDY_ID", "{{%STUDY_ID%}}"],
    ["SESSION_ID", "{{%SESSION_ID%}}"],
  ],
  sona: [["survey_code", "%SURVEY_CODE%"]],
  mturk: [["workerId", "${workerId}"]],
  generic: [["participant", "ID"]],
};

export const RECRUITER_NAMES: Record<string, string> = { prolific: "Prolific", sona: "SONA", mturk: "MTurk", generic: "another recruiter" };

/** `url` as `recruiter` needs it; the parameter of the id may have a name of its own. */
export function addressFor(url: string, recruiter: Record<string, unknown> | null | undefined): string {
  const kind = recruiter?.["kind"];
  const [first, ...others] = typeof kind === "string" ? (PARAMETERS[kind] ?? []) : [];
  if (first === undefined) return url;
  const own = recruiter?.["id_parameter"];
  const name = typeof own === "string" && own !== "" ? own : first[0];
  // Written as it stands: the recruiter looks for its signs, and replaces them before anybody opens the address.
  const signed = recruiter?.["signature_parameter"];
  const signature = typeof signed === "string" && signed !== "" ? [[signed, "SIGNATURE"]] : [];
  const query = [[name, first[1]], ...others, ...signature].map(([key, value]) => `${key}=${value}`).join("&");
  return `${url}?${query}`;
}
