// A headed browser for tools/scope: node driver.mjs chromium|firefox PROGRAM, then one JSON command a line.
// The page goes through consent and texts by itself whenever its state is asked for.
import { createInterface } from "node:readline";
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

const browser = await puppeteer.launch({ ...options[name], headless: false, defaultViewport: null });
const page = (await browser.pages())[0] ?? (await browser.newPage());

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
