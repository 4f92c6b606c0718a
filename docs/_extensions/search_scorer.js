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
  const withSomeWords = (query, words, ...rest) => {
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

  // The questions of "How do I ...?" come first: each leads to the heading that answers it.
  const INDEX = "how-to/index";
  const SHOWN = 4;
  let questions = [];

  const stemsOf = (text) => {
    const stemmer = new Stemmer();
    return new Set(
      splitQuery(text.toLowerCase()).map((word) => stemmer.stemWord(word)),
    );
  };

  const readQuestions = async () => {
    const root = document.documentElement.dataset.content_root;
    const page = new URL(`${root}${INDEX}.html`, document.baseURI);
    const text = await (await fetch(page)).text();
    const items = new DOMParser()
      .parseFromString(text, "text/html")
      .querySelectorAll("article section li");
    const base = new URL(root, document.baseURI).pathname;
    return [...items].flatMap((item) => {
      const link = item.querySelector("a");
      if (link === null) return [];
      const to = new URL(link.getAttribute("href"), page);
      const docname = to.pathname.slice(base.length).replace(/\.html$/, "");
      const title = link.textContent;
      return [
        {
          docname,
          anchor: to.hash,
          title,
          words: stemsOf(item.textContent),
          own: stemsOf(title),
        },
      ];
    });
  };

  // Whether a question has a word: 1, or less where it has only a longer one.
  const PART = 0.7;
  const fit = (words, word) => {
    if (words.has(word)) return 1;
    const longer = [...words].some((one) => one.startsWith(word));
    return word.length > 3 && longer ? PART : 0;
  };

  // A word that few questions have says more than one that many have.
  const UNKNOWN = 2.2;
  const ENOUGH = 0.55;
  const fittingQuestions = (words) => {
    const weights = [...words].map((word) => {
      const hits = questions.filter((question) => fit(question.words, word));
      const rare = Math.log((questions.length + 1) / (hits.length + 0.5));
      return [word, hits.length > 0 ? rare : UNKNOWN];
    });
    const total = weights.reduce((sum, [, weight]) => sum + weight, 0);
    const shareOf = (known) =>
      weights.reduce(
        (sum, [word, weight]) => sum + weight * fit(known, word),
        0,
      ) / total;
    return questions
      .map((question) => {
        const share = shareOf(question.words);
        const score =
          share + 0.1 * shareOf(question.own) - 0.002 * question.words.size;
        return { question, score, share };
      })
      .filter(({ share }) => share > ENOUGH)
      .sort((one, other) => other.score - one.score)
      .slice(0, SHOWN)
      .map(({ question, score }) => [
        question.docname,
        question.title,
        question.anchor,
        null,
        score,
        "",
        "title",
      ])
      .reverse();
  };

  const FILLERS = new Set(
    "how do does can could i my me we our you what which where when why who am want need".split(
      " ",
    ),
  );

  Search._performSearch = (query, asked, ...rest) => {
    const telling = new Set([...asked].filter((word) => !FILLERS.has(word)));
    const words = telling.size > 0 ? telling : asked;
    const found = withAllWords(query, words, ...rest);
    const pages =
      found.length > 0 || words.size < 2
        ? found
        : withSomeWords(query, words, ...rest);
    return words.size === 0 ? pages : [...pages, ...fittingQuestions(words)];
  };

  const search = Search.query;
  Search.query = async (query) => {
    // A site that is opened as files may not read its own pages.
    questions = await readQuestions().catch(() => []);
    search(query);
    const note = document.createElement("p");
    const link = document.createElement("a");
    link.href = `${document.documentElement.dataset.content_root}${INDEX}.html`;
    link.textContent = "How do I ...? lists all questions.";
    note.append("Not found? ", link);
    document.getElementById("search-results").append(note);
  };
}
