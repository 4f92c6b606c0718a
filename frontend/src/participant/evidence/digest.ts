/** That the clips of a trial are here: HMAC-SHA-256, keyed by the ticket, over the SHA-512 of each of them, joined. */

export async function clipDigest(ticket: string, clips: ArrayBuffer[]): Promise<string> {
  const { subtle } = crypto;
  const hashes = await Promise.all(clips.map((clip) => subtle.digest("SHA-512", clip)));
  const key = await subtle.importKey("raw", new TextEncoder().encode(ticket), { name: "HMAC", hash: "SHA-256" }, false, ["sign"]);
  const digest = new Uint8Array(await subtle.sign("HMAC", key, await new Blob(hashes).arrayBuffer()));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
