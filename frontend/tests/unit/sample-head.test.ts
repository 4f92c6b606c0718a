import { createRequire } from "node:module";
import { describe, expect, it } from "vitest";
import { sampleHead } from "../../src/demos/vrm/sample-head";

/** Khronos's own validator, which comes without types. */
const { validateBytes } = createRequire(import.meta.url)("gltf-validator") as {
  validateBytes: (data: Uint8Array) => Promise<{ issues: { messages: { severity: number }[] } }>;
};

interface Primitive {
  attributes: { POSITION: number };
  targets?: [{ POSITION: number }];
}
interface Document {
  accessors: { bufferView: number; count: number }[];
  bufferViews: { byteOffset: number; byteLength: number }[];
  meshes: { name: string; primitives: Primitive[]; extras?: { targetNames: string[] } }[];
  nodes: { name: string; translation: number[] }[];
  extensions: {
    VRMC_vrm: { humanoid: { humanBones: object }; expressions: { preset: Record<string, { morphTargetBinds: { node: number }[] }> } };
  };
}
type Point = [number, number, number];

const bytes = sampleHead();
const jsonLength = new DataView(bytes).getUint32(12, true);
const document = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, jsonLength))) as Document;

function vectors(accessor: number): Point[] {
  const view = document.bufferViews[document.accessors[accessor]?.bufferView ?? 0];
  const values = new Float32Array(bytes.slice(28 + jsonLength + (view?.byteOffset ?? 0)).slice(0, view?.byteLength));
  return Array.from({ length: values.length / 3 }, (_, k) => [...values.slice(3 * k, 3 * k + 3)] as Point);
}

/** Vertices of a part at a weight of its blink, in the space of the head's bone. */
function shape(name: string, primitive: number, weight: number): Point[] {
  const mesh = document.meshes.find((one) => one.name === name);
  const part = mesh?.primitives[primitive];
  const moved = vectors(part?.targets?.[0].POSITION ?? 0);
  const bone = name === "globeLeft" ? "leftEye" : name;
  const position = document.nodes.find((node) => node.name === bone)?.translation ?? [];
  return vectors(part?.attributes.POSITION ?? 0).map(
    (point, k) => point.map((value, axis) => value + weight * (moved[k]?.[axis] ?? 0) + (position[axis] ?? 0)) as Point,
  );
}

/** Rows of a lid or globe, each from the left to the right of the picture. */
const rows = (points: Point[], columns: number): Point[][] =>
  Array.from({ length: points.length / (columns + 1) }, (_, row) => points.slice(row * (columns + 1), (row + 1) * (columns + 1)));

describe("the sample head", () => {
  it("is a valid glTF file, and a VRM with both blinks", async () => {
    const { issues } = await validateBytes(new Uint8Array(bytes));
    expect(issues.messages.filter(({ severity }) => severity < 2)).toEqual([]);
    const { humanoid, expressions } = document.extensions.VRMC_vrm;
    expect(Object.keys(humanoid.humanBones)).toEqual(expect.arrayContaining(["hips", "spine", "head", "leftEye", "rightFoot"]));
    expect(Object.keys(expressions.preset)).toEqual(["blink", "blinkLeft", "blinkRight"]);
    const bound = expressions.preset["blinkLeft"]?.morphTargetBinds.map(({ node }) => document.nodes[node]?.name);
    expect(bound).toEqual(["lidsLeft", "globeLeft"]);
    expect(bytes.byteLength).toBeLessThan(8e6);
  });

  it.each([0, 0.25, 0.5, 0.75, 1])("keeps the lids outside the globe at closure %s", (closure) => {
    const globe = shape("globeLeft", 0, closure);
    const rings = rows(globe, 64);
    const front = rings[rings.length - 1]?.[0] ?? [0, 0, 0];
    const center: Point = [front[0], front[1], front[2] - 0.0245];
    for (const lid of [0, 1]) {
      const edge = rows(shape("lidsLeft", lid, closure), 72);
      // The rim lies on the globe; what follows is the outside of the lid.
      for (const row of lid === 0 ? edge.slice(4, 16) : edge.slice(-14, -5)) {
        for (const [x, y, z] of row.slice(12, 60)) expect(Math.hypot(x - center[0], y - center[1], z - center[2])).toBeGreaterThan(0.0241);
      }
    }
  });

  it("opens its eye in front of iris and pupil, and closes it without a gap", () => {
    const margin = (closure: number) => {
      const upper = rows(shape("lidsLeft", 0, closure), 72)[2] ?? [];
      const lower = rows(shape("lidsLeft", 1, closure), 72).at(-2) ?? [];
      return upper.slice(16, 57).map((point, k) => 1000 * (point[1] - (lower[16 + k]?.[1] ?? 0)));
    };
    expect(Math.max(...margin(0))).toBeGreaterThan(10);
    expect(Math.max(...margin(1))).toBeLessThan(0.6);
    expect(Math.max(...margin(0.5)) / Math.max(...margin(0))).toBeCloseTo(0.5, 1);
  });

  it("has a round iris", () => {
    const ring = rows(shape("globeLeft", 0, 0), 64).at(-30) ?? [];
    const [x0, y0] = [0, 1].map((axis) => ring.slice(1).reduce((sum, point) => sum + (point[axis] ?? 0), 0) / 64);
    const radii = ring.map(([x, y]) => Math.hypot(x - (x0 ?? 0), y - (y0 ?? 0)));
    expect(Math.max(...radii) - Math.min(...radii)).toBeLessThan(1e-5);
  });
});
