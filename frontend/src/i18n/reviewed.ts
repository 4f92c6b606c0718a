// Decision 0617: A language is unreviewed until a person has read it.
/**
 * Who has read the page's own words in a language, and when. A language that is not here is shown as unreviewed in the
 * admin site: after reading `languages/TAG.json` and `experiments/check_words/TAG.toml` add its line, with a name or initials and the date.
 */
export const reviewed: Record<string, { by: string; on: string }> = { en: { by: "the source of the others", on: "2026-11-21" } };
