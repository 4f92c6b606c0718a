import { createHmac } from "node:crypto";
import { describe, expect, it } from "vitest";
import { clipDigest } from "../../src/participant/evidence/digest";

describe("the digest of a clip", () => {
  it("is HMAC-SHA-256 of its bytes with the ticket as the key", async () => {
    const clip = new Uint8Array([0, 1, 2, 250, 255]);
    const expected = createHmac("sha256", "a ticket").update(clip).digest("hex");
    expect(await clipDigest("a ticket", new Blob([clip.buffer]))).toBe(expected);
  });
});
