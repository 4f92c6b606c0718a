// A headed browser for packages/screen_bench: node driver.mjs chromium|firefox PROGRAM, then one JSON command a line.
// The page goes through consent and texts by itself whenever its state is asked for.
import { createInterface } from "node:readline";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import puppeteer from "puppeteer-core";

const [name, program] = process.argv.slice(2);
const SIZE = [1280, 800];

const options = {
  chromium: {
    executablePath: program,
    ignoreDefaultArgs: ["--enable-automation"],
    args: [
      "--no-sandbox",
      "--test-type",
      "--disable-gpu",
      "--no-first-run",
      "--disable-background-networking",
      `--window-size=${SIZE}`,
      "--window-position=0,0",
    ],
  },
  firefox: { browser: "firefox", executablePath: program, args: [`--width=${SIZE[0]}`, `--height=${SIZE[1]}`] },
};

const profiles = [];
let browser, page;

async function launch(userDataDir) {
  browser = await puppeteer.launch({ ...options[name], userDataDir, headless: false, defaultViewport: null });
  page = (await browser.pages())[0] ?? (await browser.newPage());
}

/** A browser that has never been here, as another device is. */
async function launchAnew() {
  profiles.push(await mkdtemp(join(tmpdir(), "palpebra-scope-")));
  await launch(profiles.at(-1));
}

/** End the browser as a crash does, and come back with the same profile. */
async function kill() {
  const process = browser.process();
  const gone = new Promise((resolve) => process.once("exit", resolve));
  process.kill("SIGKILL");
  await gone;
  await launch(profiles.at(-1));
}

/** Another browser takes over while the first one still shows its page. */
async function move(address) {
  const first = browser;
  await launchAnew();
  await page.goto(address);
  await first.close();
}

await launchAnew();

function step() {
  const see = (selector) => document.querySelector(selector);
  if (see(".code")) return "done";
  if (see(".scale")) return "scale";
  if (see(".trial.playing")) return "playing";
  if (see(".ready")) return "ready";
  const tick = see(".page > .tick input");
  if (tick && !tick.checked) tick.click();
  const next = [...document.querySelectorAll(".primary")].find((button) => !button.disabled);
  if (next && !see(".trial")) next.click();
  return `on the way: ${document.body?.innerText.slice(0, 60).replaceAll("\n", " ")}`;
}

function clipArea() {
  const { left, top, width, height } = document.querySelector(".clip").getBoundingClientRect();
  // Firefox says where its page begins; elsewhere the frame is above the page and the same at both sides.
  const x = window.mozInnerScreenX ?? screenX + (outerWidth - innerWidth) / 2;
  const y = window.mozInnerScreenY ?? screenY + outerHeight - innerHeight;
  return [left + x, top + y, width, height];
}

function block(busy_ms, every_ms) {
  setInterval(() => {
    const end = performance.now() + busy_ms;
    while (performance.now() < end);
  }, every_ms);
}

const commands = {
  open: ({ address }) => page.goto(address).then(() => true),
  reload: () => page.reload().then(() => true),
  kill: ({ address }) =>
    kill()
      .then(() => page.goto(address))
      .then(() => true),
  move: ({ address }) => move(address).then(() => true),
  state: () => page.evaluate(step).catch((error) => `between pages (${error.message.slice(0, 60)})`),
  area: () => page.evaluate(clipArea),
  throttle: ({ rate }) => page.emulateCPUThrottling(rate).then(() => true),
  block: ({ busy_ms, every_ms }) => page.evaluate(block, busy_ms, every_ms).then(() => true),
};

const say = (message) => console.log(JSON.stringify(message));
say({ answer: await browser.version() });
for await (const line of createInterface({ input: process.stdin })) {
  const { command, ...values } = JSON.parse(line);
  await commands[command](values).then(
    (answer) => say({ answer }),
    (error) => say({ error: String(error) }),
  );
}
await browser.close();
for (const profile of profiles) await rm(profile, { recursive: true, force: true, maxRetries: 5 });
