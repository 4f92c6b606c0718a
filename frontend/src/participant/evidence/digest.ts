/** That the clips of a trial are here: HMAC-SHA-256 over their encoded bytes, with the ticket as the key. */

export async function clipDigest(ticket: string, clips: Blob): Promise<string> {
  const hash = { name: "HMAC", hash: "SHA-256" };
  const key = await crypto.subtle.importKey("raw", new TextEncoder().encode(ticket), hash, false, ["sign"]);
  const digest = new Uint8Array(await crypto.subtle.sign("HMAC", key, await clips.arrayBuffer()));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
