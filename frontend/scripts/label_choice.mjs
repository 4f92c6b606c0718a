// What the labelling page finds in a recording: `node label_choice.mjs FRAMES.grey '{"frames": 1800, "fps": 30, ...}'`.
// The file holds every frame's luminance, as small as the page makes it; bench/label_choice.py writes it.
import { closeSync, openSync, readSync } from "node:fs";
import { runnerImport } from "vite";

const [path, text] = process.argv.slice(2);
const facts = JSON.parse(text);
const load = async (name) => (await runnerImport(new URL(`../src/labelling/${name}.ts`, import.meta.url).pathname)).module;
const { candidateFrames } = await load("labelled-frames");
const [width, height] = facts.looked;
const file = openSync(path);
const pictures = candidateFrames(facts.frames).map((number) => {
  const values = new Uint8ClampedArray(width * height);
  readSync(file, values, 0, values.length, number * values.length);
  return { width, height, values };
});
closeSync(file);

const { seeEyes } = await load("follow-eyes");
const { eyesFor, NO_EYES, placesOn } = await load("eyes");
const { thumbnailOf } = await load("grey");
const { chooseFrames } = await load("labelled-frames");
const candidates = candidateFrames(facts.frames);
const begun = process.cpuUsage();
const eyes = seeEyes(pictures, (facts.frames - 1) / facts.fps / (candidates.length - 1), () => undefined);
const seconds = process.cpuUsage(begun).user / 1e6;
const blinking = eyesFor(eyes, facts.eyes);
const places = blinking === null ? [] : candidates.map((_, index) => placesOn(blinking, index, eyes.size, facts.size));
const small = pictures.map(thumbnailOf);
const chosen = chooseFrames({ candidates, pictures: small, eyes }, [], facts.eyes);
const before = chooseFrames({ candidates, pictures: small, eyes: NO_EYES }, [], facts.eyes);
console.log(JSON.stringify({ chosen, before, candidates, places, seconds }));
