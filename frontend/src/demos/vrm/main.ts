/** A VRM avatar that blinks by the engine: choose a .vrm file, or drop it onto the page. */
import "./page.css";
import { type VRM, VRMLoaderPlugin } from "@pixiv/three-vrm";
import { Box3, DirectionalLight, HemisphereLight, MathUtils, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { BlinkEngine } from "../../blink-engine";
import { sampleHead } from "./sample-head";

const loader = new GLTFLoader();
loader.register((parser) => new VRMLoaderPlugin(parser));

const scene = new Scene();
/** A warm light in front, a cool one from behind, and light from all around. */
const key = new DirectionalLight(0xfff2e6, 2.4);
key.position.set(-0.6, 0.8, 1.6);
const edge = new DirectionalLight(0xdfe8ff, 1.2);
edge.position.set(1.2, 0.6, -0.6);
scene.add(key, edge, new HemisphereLight(0xffffff, 0x9a8478, 1.5));
const camera = new PerspectiveCamera(30, 4 / 3, 0.01, 100);
const engine = new BlinkEngine({ seed: 1, state: "listening" });
let avatar: VRM | null = null;

async function take(model: ArrayBuffer): Promise<void> {
  const { vrm } = (await loader.parseAsync(model, "")).userData as { vrm?: VRM };
  if (vrm === undefined) throw new Error("expected a VRM model; this file is another kind of glTF");
  if (avatar !== null) scene.remove(avatar.scene);
  avatar = vrm;
  scene.add(vrm.scene);
  const head = vrm.humanoid.getRawBoneNode("head") ?? vrm.scene;
  const box = new Box3().setFromObject(head);
  const centre = box.isEmpty() ? head.getWorldPosition(new Vector3()) : box.getCenter(new Vector3());
  camera.position.set(centre.x, centre.y, centre.z + 0.65);
  camera.lookAt(centre);
}

const SWAY_HZ = [0.13, 0.31, 0.47, 0.83] as const;
/** Turns of the head around x, y and z, in degrees: at the eyes about 1 mm. */
const SWAY_DEG = [0.5, 0.8, 0.4] as const;
const REST_S = 1.7;
const [GAZE_ASIDE_DEG, GAZE_UP_DEG] = [3, 1.5];

/** Motion between blinks: a head that sways, and eyes that look at another place every other second. */
function sway(vrm: VRM, time_s: number): void {
  const waves = SWAY_DEG.map((degrees, axis) =>
    MathUtils.degToRad(degrees * SWAY_HZ.reduce((sum, rate) => sum + Math.sin(2 * Math.PI * rate * time_s + 9 * rate + 2 * axis), 0) * 0.7),
  );
  vrm.humanoid.getNormalizedBoneNode("head")?.rotation.set(waves[0] ?? 0, waves[1] ?? 0, waves[2] ?? 0);
  if (!vrm.lookAt) return;
  const rest = Math.floor(time_s / REST_S);
  // The same places in each visit.
  vrm.lookAt.yaw = GAZE_ASIDE_DEG * Math.sin(12.9 * rest * rest);
  vrm.lookAt.pitch = GAZE_UP_DEG * Math.sin(78.2 * rest * rest + 1);
}

/** The lids of this moment, by the names that VRM gives them. */
function blink(vrm: VRM, time_s: number): void {
  const { left, right } = engine.frame(time_s);
  vrm.expressionManager?.setValue("blinkLeft", left);
  vrm.expressionManager?.setValue("blinkRight", right);
  vrm.update(1 / 60);
}

function start(canvas: HTMLCanvasElement, said: HTMLElement, chooser: HTMLInputElement | null): void {
  const renderer = new WebGLRenderer({ canvas, antialias: true });
  renderer.setSize(640, 480, false);
  renderer.setClearColor(0xb9c2c8);
  const begun = performance.now();
  const tick = (now: number): void => {
    const time_s = Math.max(0, now - begun) / 1000;
    if (avatar !== null) {
      sway(avatar, time_s);
      blink(avatar, time_s);
      canvas.dataset["time"] = String(time_s);
      for (const side of ["Left", "Right"]) canvas.dataset[`lid${side}`] = String(influence(avatar, `blink${side}`));
    }
    renderer.render(scene, camera);
    requestAnimationFrame(tick);
  };
  const open = (model: ArrayBuffer): void => {
    take(model).then(
      () => (said.textContent = "Blinking as a listener. Choose a .vrm file, or drop it here, to see yours."),
      (error: unknown) => (said.textContent = `This model cannot be used: ${error instanceof Error ? error.message : String(error)}`),
    );
  };
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    void event.dataTransfer?.files[0]?.arrayBuffer().then(open);
  });
  chooser?.addEventListener("change", () => void chooser.files?.[0]?.arrayBuffer().then(open));
  open(sampleHead());
  requestAnimationFrame(tick);
}

/** What the model's own mesh was given, read back from it. */
function influence(vrm: VRM, name: string): number {
  let value = Number.NaN;
  vrm.scene.traverse((node) => {
    const { morphTargetDictionary: places, morphTargetInfluences: values } = node as {
      morphTargetDictionary?: Record<string, number>;
      morphTargetInfluences?: number[];
    };
    const index = places?.[name];
    if (index !== undefined) value = values?.[index] ?? value;
  });
  return value;
}

const canvas = document.querySelector("canvas");
const said = document.querySelector<HTMLElement>("#said");
if (canvas !== null && said !== null) start(canvas, said, document.querySelector("input"));
