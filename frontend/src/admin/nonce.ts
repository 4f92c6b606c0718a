/** The page's nonce: style elements made by script must carry it, or the content security policy drops them. */

const nonce = document.querySelector('meta[name="csp-nonce"]')?.getAttribute("content") ?? "";

// Where the library that holds the page still behind a dialog looks for it (get-nonce).
Object.assign(globalThis, { __webpack_nonce__: nonce });

export function styleNonce(): string {
  return nonce;
}

/** Give every style element inside `element` the nonce, before it enters the document. */
export function allowStyles(element: Element): void {
  for (const style of element.querySelectorAll("style")) style.setAttribute("nonce", nonce);
}
