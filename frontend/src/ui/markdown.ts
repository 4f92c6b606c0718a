/**
 * The part of Markdown that study texts need: headings, paragraphs, lists, bold, italic, code, links, rules.
 * It builds DOM nodes and never HTML, so a text cannot contain markup or scripts.
 */
import { h, type Child } from "./element";

type Block =
  | { kind: "heading"; level: number; text: string }
  | { kind: "paragraph"; text: string }
  | { kind: "list"; ordered: boolean; start: number; items: string[] }
  | { kind: "rule" };

const HEADING = /^(#{1,4})\s+(.*)$/;
const BULLET = /^\s{0,3}[-*+]\s+(.*)$/;
const NUMBERED = /^\s{0,3}(\d{1,3})[.)]\s+(.*)$/;
const RULE = /^\s{0,3}([-*_])(\s*\1){2,}\s*$/;

export function parseBlocks(source: string): Block[] {
  const blocks: Block[] = [];
  let open: Block | null = null;
  for (const line of source.replace(/\r\n?/g, "\n").split("\n")) {
    const next: Block | null = line.trim() ? startOf(line, open) : null;
    if (!line.trim()) open = null;
    else if (next === null) open = continued(open, line.trim(), blocks);
    else if (next !== open) blocks.push((open = next));
  }
  return blocks;
}

/** The block that `line` opens, `open` where it adds an item to a list, or null where it continues text. */
function startOf(line: string, open: Block | null): Block | null {
  const heading = HEADING.exec(line);
  if (heading) return { kind: "heading", level: heading[1]?.length ?? 1, text: heading[2] ?? "" };
  if (RULE.test(line)) return { kind: "rule" };
  const numbered = NUMBERED.exec(line);
  const item = numbered?.[2] ?? BULLET.exec(line)?.[1];
  if (item === undefined) return null;
  if (open?.kind === "list" && open.ordered === Boolean(numbered)) {
    open.items.push(item);
    return open;
  }
  return { kind: "list", ordered: Boolean(numbered), start: Number(numbered?.[1] ?? 1), items: [item] };
}

function continued(open: Block | null, text: string, blocks: Block[]): Block {
  if (open?.kind === "paragraph") open.text += ` ${text}`;
  else if (open?.kind === "list") open.items.push(`${open.items.pop() ?? ""} ${text}`);
  else {
    const paragraph: Block = { kind: "paragraph", text };
    blocks.push(paragraph);
    return paragraph;
  }
  return open;
}

const INLINE = /\*\*(.+?)\*\*|__(.+?)__|\*(.+?)\*|`(.+?)`|\[([^\]]+)\]\(([^)\s]+)\)/;
const SAFE_ADDRESS = /^(https?:\/\/|mailto:)/i;

function inline(text: string): Child[] {
  const match = INLINE.exec(text);
  if (!match) return [text];
  const [whole, bold, bold2, italic, code, label, address] = match;
  return [
    text.slice(0, match.index),
    inlineNode(whole, bold ?? bold2, italic, code, label, address),
    ...inline(text.slice(match.index + whole.length)),
  ];
}

function inlineNode(whole: string, bold?: string, italic?: string, code?: string, label?: string, address?: string): Child {
  if (bold !== undefined) return h("strong", {}, ...inline(bold));
  if (italic !== undefined) return h("em", {}, ...inline(italic));
  if (code !== undefined) return h("code", {}, code);
  if (label === undefined || address === undefined || !SAFE_ADDRESS.test(address)) return label ?? whole;
  return h("a", { href: address, target: "_blank", rel: "noopener noreferrer" }, ...inline(label));
}

/** Elements for a Markdown text; its first heading becomes the page's h1. */
export function markdown(source: string): HTMLElement[] {
  return parseBlocks(source).map((block) => {
    if (block.kind === "heading") return h(`h${block.level}` as "h1", {}, ...inline(block.text));
    if (block.kind === "rule") return h("hr");
    if (block.kind === "paragraph") return h("p", {}, ...inline(block.text));
    const items = block.items.map((item) => h("li", {}, ...inline(item)));
    return block.ordered ? h("ol", { start: block.start }, ...items) : h("ul", {}, ...items);
  });
}
