/** Which way scales run on this page: as it is read, unless the study keeps them as in languages read from left to right. */
export function scaleDirection(): string {
  return document.documentElement.dataset["scales"] === "same" ? "ltr" : document.dir;
}
