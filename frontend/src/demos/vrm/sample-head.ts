/** A head of few shapes as a VRM 1.0 file, so that the page has somebody before a model is dropped onto it. */
import { type BufferGeometry, MathUtils, SphereGeometry } from "three";

const FLOAT = 5126;
const UNSIGNED_INT = 5125;
const ARRAY_BUFFER = 34962;
const ELEMENT_ARRAY_BUFFER = 34963;
/** VRM 1.0 asks for these bones. */
const BONES = [
  "hips",
  "spine",
  "head",
  ...["left", "right"].flatMap((side) => [
    `${side}UpperLeg`,
    `${side}LowerLeg`,
    `${side}Foot`,
    `${side}UpperArm`,
    `${side}LowerArm`,
    `${side}Hand`,
  ]),
];

interface Part {
  geometry: BufferGeometry;
  colour: readonly [number, number, number];
  /** The same vertices with the eye shut: the part's one morph target. */
  shut?: BufferGeometry;
  name: string;
}

const at = (geometry: BufferGeometry, x: number, y: number, z: number): BufferGeometry => geometry.translate(x, y, z);

/** An upper lid: a cap over the eye, from its top down to so many degrees. */
const lid = (x: number, down_deg: number): BufferGeometry =>
  at(new SphereGeometry(0.029, 32, 16, 0, 2 * Math.PI, 0, MathUtils.degToRad(down_deg)), x, 0.02, 0.09);

const PARTS: readonly Part[] = [
  { name: "skull", geometry: new SphereGeometry(0.11, 32, 24), colour: [0.87, 0.68, 0.56] },
  ...[0.04, -0.04].flatMap((x): Part[] => {
    const side = x > 0 ? "Left" : "Right";
    return [
      { name: `eye${side}`, geometry: at(new SphereGeometry(0.022, 24, 16), x, 0.02, 0.09), colour: [0.95, 0.95, 0.95] },
      { name: `iris${side}`, geometry: at(new SphereGeometry(0.011, 16, 12), x, 0.02, 0.103), colour: [0.2, 0.35, 0.3] },
      { name: `blink${side}`, geometry: lid(x, 66), shut: lid(x, 134), colour: [0.8, 0.58, 0.47] },
    ];
  }),
];

/** The file's bytes. */
export function sampleHead(): ArrayBuffer {
  const writer = new Writer();
  const meshes = PARTS.map((part, material) => writer.mesh(part, material));
  const head = BONES.indexOf("head");
  const nodes = [
    ...BONES.map((name, index) => ({ name, ...(index === 0 ? { children: BONES.slice(1).map((_, n) => n + 1) } : {}) })),
    ...PARTS.map(({ name }, mesh) => ({ name, mesh })),
  ];
  Object.assign(nodes[head] ?? {}, { children: PARTS.map((_, n) => BONES.length + n) });
  const closing = (side: "Left" | "Right") => ({
    morphTargetBinds: [{ node: BONES.length + PARTS.findIndex(({ name }) => name === `blink${side}`), index: 0, weight: 1 }],
  });
  return writer.file({
    asset: { version: "2.0" },
    extensionsUsed: ["VRMC_vrm"],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes,
    meshes,
    materials: PARTS.map(({ colour }) => ({
      doubleSided: true,
      pbrMetallicRoughness: { baseColorFactor: [...colour, 1], metallicFactor: 0 },
    })),
    extensions: {
      VRMC_vrm: {
        specVersion: "1.0",
        meta: { name: "Sample head", authors: ["Palpebra"], licenseUrl: "https://vrm.dev/licenses/1.0/" },
        humanoid: { humanBones: Object.fromEntries(BONES.map((name, node) => [name, { node }])) },
        expressions: { preset: { blinkLeft: closing("Left"), blinkRight: closing("Right") } },
      },
    },
  });
}

/** Collects the arrays of a glTF file. */
class Writer {
  private readonly chunks: Uint8Array[] = [];
  private readonly views: object[] = [];
  private readonly accessors: object[] = [];
  private length = 0;

  mesh({ geometry, shut, name }: Part, material: number): object {
    const positions = geometry.getAttribute("position").array as Float32Array;
    const normals = geometry.getAttribute("normal").array as Float32Array;
    const index = Uint32Array.from(geometry.getIndex()?.array ?? []);
    const attributes = { POSITION: this.vectors(positions), NORMAL: this.vectors(normals) };
    const indices = this.add(index, ELEMENT_ARRAY_BUFFER, { componentType: UNSIGNED_INT, count: index.length, type: "SCALAR" });
    const primitive = { attributes, indices, material };
    if (shut === undefined) return { name, primitives: [primitive] };
    const ends = shut.getAttribute("position").array;
    const shift = positions.map((value, index) => (ends[index] ?? value) - value);
    return { name, primitives: [{ ...primitive, targets: [{ POSITION: this.vectors(shift) }] }], extras: { targetNames: [name] } };
  }

  file(content: object): ArrayBuffer {
    const json = padded(
      new TextEncoder().encode(
        JSON.stringify({ ...content, accessors: this.accessors, bufferViews: this.views, buffers: [{ byteLength: this.length }] }),
      ),
      0x20,
    );
    const bytes = new Uint8Array(12 + 8 + json.length + 8 + this.length);
    const header = new DataView(bytes.buffer);
    [0x46546c67, 2, bytes.length, json.length, 0x4e4f534a].forEach((value, word) => header.setUint32(word * 4, value, true));
    bytes.set(json, 20);
    header.setUint32(20 + json.length, this.length, true);
    header.setUint32(24 + json.length, 0x004e4942, true);
    let offset = 28 + json.length;
    for (const chunk of this.chunks) {
      bytes.set(chunk, offset);
      offset += chunk.length;
    }
    return bytes.buffer;
  }

  private vectors(values: Float32Array): number {
    const extent = (pick: (...numbers: number[]) => number) =>
      [0, 1, 2].map((axis) => pick(...values.filter((_, coordinate) => coordinate % 3 === axis)));
    return this.add(values, ARRAY_BUFFER, {
      componentType: FLOAT,
      count: values.length / 3,
      type: "VEC3",
      min: extent(Math.min),
      max: extent(Math.max),
    });
  }

  private add(values: Float32Array | Uint32Array, target: number, accessor: object): number {
    const chunk = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    this.views.push({ buffer: 0, byteOffset: this.length, byteLength: chunk.length, target });
    this.chunks.push(chunk);
    this.length += chunk.length;
    return this.accessors.push({ bufferView: this.views.length - 1, ...accessor }) - 1;
  }
}

function padded(bytes: Uint8Array, fill: number): Uint8Array {
  const whole = new Uint8Array(Math.ceil(bytes.length / 4) * 4).fill(fill);
  whole.set(bytes);
  return whole;
}
