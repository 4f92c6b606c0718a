// The site's search lists pages about tasks before pages about reasons and generated tables.
// Sphinx reads this file into its own script; titles and terms have Sphinx's default scores.
// prettier-ignore
var Scorer = {
  score: ([docname, _title, _anchor, _descr, score]) => {
    const places = [
      [/\/decisions\//, -8],
      [/\/generated\//, -4],
      [/^reference\/(columns|settings|experiment)$/, -3],
      [/^(how-to|tutorials)\/.*index$/, -2],
      [/^how-to\//, 6],
      [/^tutorials\//, 4],
    ];
    const place = places.find(([folder]) => folder.test(docname));
    return score + (place === undefined ? 0 : place[1]);
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};

// Sphinx lists only pages that have every word. Where none has, pages with some of the words are better than
// nothing: those with most of them first. Sphinx loads its own script before this one, and searches after both.
if (typeof Search !== "undefined") {
  const withAllWords = Search._performSearch;
  Search._performSearch = (query, words, ...rest) => {
    const found = withAllWords(query, words, ...rest);
    if (found.length > 0 || words.size < 2) return found;
    const best = new Map();
    for (const word of words) {
      const seen = new Set();
      for (const result of withAllWords(word, new Set([word]), ...rest)) {
        const [docname, , , , score] = result;
        if (seen.has(docname)) continue;
        seen.add(docname);
        const kept = best.get(docname) ?? { result, hits: 0, score: 0 };
        best.set(docname, {
          result: kept.result,
          hits: kept.hits + 1,
          score: kept.score + score,
        });
      }
    }
    // Sphinx shows the last one first.
    return [...best.values()]
      .sort((one, other) => one.hits - other.hits || one.score - other.score)
      .map(({ result }) => result);
  };
}
