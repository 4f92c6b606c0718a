/** Names for elements that are added or copied, so that each has one of its own. */

import { freeName, isTable, textAt } from "../data";

/** `element` with a name (or stored value) that none of `others` has. */
export function named(element: unknown, others: readonly unknown[], what = "name"): unknown {
  if (!isTable(element)) return element;
  const key = "name" in element ? "name" : "value" in element && "label" in element ? "value" : null;
  if (key === null) return element;
  const taken = others.map((other) => textAt(other, [key]));
  const name = freeName(textAt(element, [key]) || what.replaceAll(" ", "_"), taken);
  const label = element["label"];
  return { ...element, [key]: name, ...(label === "" ? { label: name } : {}) };
}
