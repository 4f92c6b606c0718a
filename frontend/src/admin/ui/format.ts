/** Numbers and times as the pages write them. */

export function when(moment: string | null): string {
  return moment === null ? "–" : new Date(moment).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

/** A moment to come: the time alone where it is today. */
export function soon(moment: string | null, now: string): string {
  if (moment === null) return "–";
  const then = new Date(moment);
  const today = then.toDateString() === new Date(now).toDateString();
  return then.toLocaleString(
    undefined,
    today ? { timeStyle: "short" } : { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" },
  );
}

export function ago(moment: string, now: string): string {
  const seconds = Math.max(0, (Date.parse(now) - Date.parse(moment)) / 1000);
  if (seconds < 60) return `${Math.round(seconds)} s ago`;
  if (seconds < 3600) return `${Math.round(seconds / 60)} min ago`;
  return seconds < 172_800 ? `${Math.round(seconds / 3600)} h ago` : `${Math.round(seconds / 86_400)} days ago`;
}

export function fixed(value: number | null | undefined, digits = 2): string {
  return value === null || value === undefined ? "–" : value.toFixed(digits);
}

/** "1 run", "2 runs". */
export function counted(number: number, thing: string, several = `${thing}s`): string {
  return `${number.toLocaleString()} ${number === 1 ? thing : several}`;
}

/** A key of the data as words: "forms_before" is "forms before". */
export function words(key: string): string {
  return key.replaceAll("_", " ");
}

/** "Chrome on Linux" from what a browser says of itself. */
export function browserName(agent: string): string {
  const names = ["Edg", "OPR", "Firefox", "Chrome", "Safari"];
  const browser = names.find((name) => agent.includes(`${name}/`));
  const shown = { Edg: "Edge", OPR: "Opera" }[browser ?? ""] ?? browser;
  const system = ["Android", "iPhone", "iPad", "Windows", "Mac OS", "Linux"].find((name) => agent.includes(name));
  return shown === undefined ? agent.slice(0, 60) || "unknown" : `${shown}${system === undefined ? "" : ` on ${system}`}`;
}

/** "English (en)" from a language's code. */
export function languageName(code: string): string {
  const name = new Intl.DisplayNames(undefined, { type: "language", fallback: "none" }).of(code);
  return name === undefined ? code : `${name} (${code})`;
}

/** A value of any type as text: a list or an object as JSON. */
export function plain(value: unknown): string {
  return typeof value === "string" ? value : JSON.stringify(value);
}
