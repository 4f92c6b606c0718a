/** Modules that are fetched when they are needed: a request that was lost on the way is made again. */

const TRIES = 5;
const AGAIN_MS = 1_000;

/** What `load` gives, with a new `import()` at each call. Throws what the last try threw. */
export async function loadModule<Module>(load: () => Promise<Module>, tries = TRIES): Promise<Module> {
  try {
    return await load();
  } catch (error) {
    if (tries <= 1) throw error;
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    renewStyles();
    return loadModule(load, tries - 1);
  }
}

/** A style sheet of a module is asked for once, however often the module is: those that did not come are put in again. */
function renewStyles(): void {
  for (const link of document.querySelectorAll<HTMLLinkElement>("link[rel=stylesheet]"))
    if (!link.sheet) link.replaceWith(link.cloneNode());
}
