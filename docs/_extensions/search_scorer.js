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
