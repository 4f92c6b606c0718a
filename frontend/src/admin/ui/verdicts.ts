/** Colours of the badges of verdicts: white can be read on each. */
export const VERDICT_COLOURS: Record<string, string> = { good: "teal.9", uncertain: "blue.9", flagged: "#8a5a00", failed: "red.9" };
