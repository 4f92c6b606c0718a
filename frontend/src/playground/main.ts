/** The playground as a separate page that contains its pictures (`make playground`). */
import "./page.css";
import "./playground.css";
import type { Strips } from "./faces";
import { mountPlayground } from "./playground";

interface Shipped extends Strips {
  pictures: Record<string, string>;
}

const root = document.querySelector<HTMLElement>("#playground");
const data = document.querySelector("#strips")?.textContent;
if (root !== null && data != null) {
  const strips = JSON.parse(data) as Shipped;
  mountPlayground(root, { strips, address: (character) => strips.pictures[character] ?? "" });
}
