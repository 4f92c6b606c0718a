/** Writes a binary glTF 2.0 file: meshes with colors per vertex and one morph target, and whatever the caller describes. */

const FLOAT = 5126;
const UNSIGNED_INT = 5125;
const ARRAY_BUFFER = 34962;
const ELEMENT_ARRAY_BUFFER = 34963;
const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;

/** Triangles of one material; three numbers per vertex. `shut` has the places and normals where the morph target is 1. */
export interface Mesh {
  positions: Float32Array;
  normals: Float32Array;
  colors: Float32Array;
  indices: Uint32Array;
  shut?: { positions: Float32Array; normals: Float32Array };
}

export class GlbWriter {
  private readonly chunks: Uint8Array[] = [];
  private readonly views: object[] = [];
  private readonly accessors: object[] = [];
  private length = 0;

  /** What a mesh's `primitives` takes. */
  primitive({ positions, normals, colors, indices, shut }: Mesh, material: number): object {
    const attributes = { POSITION: this.vectors(positions), NORMAL: this.vectors(normals), COLOR_0: this.vectors(colors) };
    const index = this.add(indices, ELEMENT_ARRAY_BUFFER, { componentType: UNSIGNED_INT, count: indices.length, type: "SCALAR" });
    const primitive = { attributes, indices: index, material };
    if (shut === undefined) return primitive;
    const shifts = [
      [shut.positions, positions],
      [shut.normals, normals],
    ].map(([ends, starts]) => (ends ?? positions).map((value, k) => value - (starts?.[k] ?? 0)));
    const [moved = positions, turned = normals] = shifts;
    return { ...primitive, targets: [{ POSITION: this.vectors(moved), NORMAL: this.vectors(turned) }] };
  }

  /** The file's bytes; `content` is its JSON without accessors, views and buffer. */
  file(content: object): ArrayBuffer {
    const whole = { ...content, accessors: this.accessors, bufferViews: this.views, buffers: [{ byteLength: this.length }] };
    const json = padded(new TextEncoder().encode(JSON.stringify(whole)));
    const bytes = new Uint8Array(28 + json.length + this.length);
    const header = new DataView(bytes.buffer);
    [MAGIC, 2, bytes.length, json.length, JSON_CHUNK].forEach((value, word) => header.setUint32(word * 4, value, true));
    bytes.set(json, 20);
    header.setUint32(20 + json.length, this.length, true);
    header.setUint32(24 + json.length, BINARY_CHUNK, true);
    let offset = 28 + json.length;
    for (const chunk of this.chunks) {
      bytes.set(chunk, offset);
      offset += chunk.length;
    }
    return bytes.buffer;
  }

  private vectors(values: Float32Array): number {
    const extent = (pick: (one: number, other: number) => number) =>
      [0, 1, 2].map((axis) => {
        let extreme = values[axis] ?? 0;
        for (let k = axis; k < values.length; k += 3) extreme = pick(extreme, values[k] ?? extreme);
        return extreme;
      });
    const count = values.length / 3;
    const [min, max] = [extent(Math.min), extent(Math.max)];
    return this.add(values, ARRAY_BUFFER, { componentType: FLOAT, count, type: "VEC3", min, max });
  }

  private add(values: Float32Array | Uint32Array, target: number, accessor: object): number {
    const chunk = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
    this.views.push({ buffer: 0, byteOffset: this.length, byteLength: chunk.length, target });
    this.chunks.push(chunk);
    this.length += chunk.length;
    return this.accessors.push({ bufferView: this.views.length - 1, ...accessor }) - 1;
  }
}

/** JSON to a whole number of words, with spaces, as the format requires. */
function padded(bytes: Uint8Array): Uint8Array {
  const whole = new Uint8Array(Math.ceil(bytes.length / 4) * 4).fill(0x20);
  whole.set(bytes);
  return whole;
}
