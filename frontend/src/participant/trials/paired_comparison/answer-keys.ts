/** Which keys mean what below a pair. */
export type Winner = "left" | "right" | "tie";

/** Arrows point at a clip; 1 and 2 name it by its order; 3, 0 and T say that neither is chosen. */
const KEYS = new Map<string, Winner>(
  Object.entries({
    "1": "left",
    "2": "right",
    "3": "tie",
    ArrowLeft: "left",
    ArrowUp: "left",
    ArrowRight: "right",
    ArrowDown: "right",
    "0": "tie",
    t: "tie",
  }),
);

/** The answer a key stands for; null for other keys, and for a tie where none may be given. */
export function winnerOf(key: string, ties: boolean): Winner | null {
  const winner = KEYS.get(key.length === 1 ? key.toLowerCase() : key) ?? null;
  return winner === "tie" && !ties ? null : winner;
}
