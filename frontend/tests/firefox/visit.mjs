// A whole visit in a real Firefox, by WebDriver BiDi: node visit.mjs FIREFOX ADDRESS_OF_THE_LINK [SCRIPT [PAUSE_MS [PREFERENCES]]]
// PREFERENCES are Firefox's own settings, as JSON. SCRIPT runs before the page's own; PAUSE_MS is how long the person looks at each ready screen.
// Playwright cannot drive Firefox as distributions build it; puppeteer-core can.
import puppeteer from "puppeteer-core";

const [firefox, address, script = "", pause_ms = "0", preferences = "{}"] = process.argv.slice(2);
const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath: firefox,
  headless: true,
  extraPrefsFirefox: JSON.parse(preferences),
});
const page = await browser.newPage();
const problems = [];
if (script) await page.evaluateOnNewDocument(script);
page.on("pageerror", (error) => problems.push(String(error)));
page.setDefaultTimeout(60_000);

const see = (selector) => page.waitForSelector(selector, { visible: true });
const press = async (selector) => {
  await see(selector);
  await page.click(selector);
};
const gone = (handle) => page.waitForFunction((element) => !element.isConnected, {}, handle);

async function rate(key) {
  await see(".ready");
  await new Promise((resolve) => setTimeout(resolve, Number(pause_ms)));
  await page.keyboard.press(" ");
  const scale = await see(".scale");
  await page.keyboard.press(key);
  await gone(scale);
}

try {
  await page.goto(address);
  // A browser that can only nearly show the study asks whether to go on.
  await see("h1");
  while (await page.evaluate(() => document.body.textContent.includes("Before you begin"))) await press(".primary");
  await press(".primary");
  await press(".page > .tick");
  await press(".primary");
  await see("input.short");
  await page.type("input.short", "34");
  await page.click("input[value=normal]");
  await press(".primary");
  await see(".prose ol");
  await press(".actions .primary");
  await page.waitForFunction(() => document.body.textContent.includes("not part of the study"));
  await press(".actions .primary");
  await rate("5");
  await see(".feedback");
  await press(".below .primary");
  await page.waitForFunction(() => document.body.textContent.includes("Practice is complete"));
  await press(".actions .primary");
  for (;;) {
    const screen = await see(".ready, .break, form, .code");
    const name = await screen.evaluate((element) => element.className || element.tagName);
    if (name.includes("code")) break;
    if (name.includes("ready")) await rate("6");
    else {
      await press(".primary:enabled");
      await gone(screen);
    }
  }
  const code = await page.$eval(".code output", (element) => element.textContent);
  console.log(JSON.stringify({ code, problems, version: await browser.version() }));
} finally {
  await browser.close();
}
