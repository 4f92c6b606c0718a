/** The page's nonce: style elements made by script must carry it, or the content security policy drops them. */

const nonce = document.querySelector('meta[name="csp-nonce"]')?.getAttribute("content") ?? "";

export function styleNonce(): string {
  return nonce;
}

/** Give every style element inside `element` the nonce, before it enters the document. */
export function allowStyles(element: Element): void {
  for (const style of element.querySelectorAll("style")) style.setAttribute("nonce", nonce);
}
