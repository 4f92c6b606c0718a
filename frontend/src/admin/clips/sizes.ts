import type { Schemas } from "../api";

type Sized = Pick<Schemas["UploadedFile"], "name" | "width_px" | "height_px">;

const sizeOf = ({ width_px, height_px }: Sized) => `${width_px} x ${height_px}`;
const isUpright = ({ width_px, height_px }: Sized) => (height_px ?? 0) > (width_px ?? 0);

/** A remark on clips whose size differs from that of most; null where all have one size. */
export function sizeRemark(files: readonly Sized[]): string | null {
  const groups = new Map<string, Sized[]>();
  for (const file of files.filter(({ width_px, height_px }) => width_px != null && height_px != null))
    groups.set(sizeOf(file), [...(groups.get(sizeOf(file)) ?? []), file]);
  const [most = [], ...others] = [...groups.values()].sort((a, b) => b.length - a.length);
  const odd = others.flat();
  const [usual] = most;
  const [first] = odd;
  if (usual === undefined || first === undefined) return null;
  const named = odd.length === 1 ? `${first.name} is` : `${first.name} and ${odd.length - 1} more are`;
  const sizes = others.slice(0, 3).flatMap(([one]) => (one === undefined ? [] : sizeOf(one)));
  const turned = odd.some((file) => isUpright(file) !== isUpright(usual)) ? " Is one turned the wrong way?" : "";
  const rest = most.length > odd.length ? "most" : "others";
  return `${named} ${sizes.join(" or ")} pixels, ${rest} are ${sizeOf(usual)}.${turned} Participants see the size, too: is it meant?`;
}
