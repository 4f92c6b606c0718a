// What the participant page's decoder makes of files, in a real browser: node decide.mjs chromium|firefox PROGRAM ADDRESS FILE...
// ADDRESS has index.html with the page of page.ts, and the files. Prints one JSON object per browser: file name to decision.
import puppeteer from "puppeteer-core";

const [name, program, address, ...files] = process.argv.slice(2);
const options = name === "firefox" ? { browser: "firefox" } : { args: ["--no-sandbox", "--disable-gpu", "--no-first-run"] };
const browser = await puppeteer.launch({ ...options, executablePath: program, headless: true, protocolTimeout: 300_000 });
try {
  const page = await browser.newPage();
  await page.goto(address);
  await page.waitForFunction(() => "decide" in globalThis);
  const decisions = {};
  for (const file of files) decisions[file] = await page.evaluate((one) => globalThis.decide(one), file);
  console.log(JSON.stringify(decisions));
} finally {
  await browser.close();
}
