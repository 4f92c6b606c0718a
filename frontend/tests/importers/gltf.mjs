// What others make of an exported animation: Khronos' validator, and three.js playing it. Prints one JSON object.
//   node gltf.mjs FILE.gltf TIME_S ...
import { readFileSync } from "node:fs";
import { validateBytes } from "gltf-validator";
import { AnimationMixer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

globalThis.ProgressEvent ??= class extends Event {}; // the loader reports progress, which Node has no word for

const [file, ...times] = process.argv.slice(2);
const content = readFileSync(file);
const report = await validateBytes(new Uint8Array(content));
const { scene, animations } = await new GLTFLoader().parseAsync(content.toString("utf8"), "");
const mixer = new AnimationMixer(scene);
for (const clip of animations) mixer.clipAction(clip).play();
let face = null;
scene.traverse((node) => (face = node.morphTargetInfluences === undefined ? face : node));
const values = times.map((time) => {
  mixer.setTime(Number(time));
  return [...face.morphTargetInfluences];
});
console.log(JSON.stringify({ issues: report.issues, targets: face.morphTargetDictionary, duration_s: animations[0].duration, values }));
