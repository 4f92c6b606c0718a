import type { Schemas } from "../api";

/** What a conversion did, in words: its steps, and how far the clip is from what was encoded. */
export function changesOf(source: Schemas["SourceVideo"]): string {
  const { changes, encoded_again, lowest_psnr_db, colour_range } = source;
  if (!encoded_again) return `${changes.join("; ")}; pictures copied as they were`;
  const quality = lowest_psnr_db == null ? "no pixel differs" : `worst frame ${lowest_psnr_db.toFixed(1)} dB PSNR`;
  return [...changes, quality, colour_range === "not said" ? "colour range not said, taken as limited" : ""].filter(Boolean).join("; ");
}
