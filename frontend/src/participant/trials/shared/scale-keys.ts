/** Which keys mean what on the scale. */
import { digitValue } from "../../../ui/digits";
import type { Points } from "../../../api/schema";

type Range = Pick<Points, "minimum" | "maximum">;

/** The value a key stands for, or null. 0 means ten on a scale that ends there and does not begin at zero. */
export function valueOf(key: string, { minimum, maximum }: Range): number | null {
  const digit = digitValue(key);
  if (digit === null) return null;
  if (digit >= minimum && digit <= maximum) return digit;
  return digit === 0 && minimum > 0 && maximum === 10 ? 10 : null;
}

/** Step along the scale for an arrow key, in the direction of reading. */
export function keyFor(key: string, right_to_left: boolean): -1 | 0 | 1 {
  const forward = right_to_left ? "ArrowLeft" : "ArrowRight";
  const backward = right_to_left ? "ArrowRight" : "ArrowLeft";
  if (key === forward || key === "ArrowUp") return 1;
  return key === backward || key === "ArrowDown" ? -1 : 0;
}
