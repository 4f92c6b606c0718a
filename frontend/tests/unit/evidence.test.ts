import { createHash, createHmac } from "node:crypto";
import { describe, expect, it } from "vitest";
import { clipDigest } from "../../src/participant/evidence/evidence";

describe("the digest of a clip", () => {
  it("is HMAC-SHA-256 of the SHA-512 of each, with the ticket as the key", async () => {
    const clips = [new Uint8Array([0, 1, 2, 250, 255]), new Uint8Array([7])];
    const expected = createHmac("sha256", "a ticket");
    for (const clip of clips) expected.update(createHash("sha512").update(clip).digest());
    const digest = await clipDigest(
      "a ticket",
      clips.map((clip) => clip.buffer),
    );
    expect(digest).toBe(expected.digest("hex"));
  });
});
