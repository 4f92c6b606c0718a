/** The engine's random numbers: xoshiro128** 1.1 seeded by SplitMix32, to the bit as in blink_engine/laws.py. */

// The quantile of the normal distribution: algorithm AS 241 (PPND16), Wichura (1988), Applied Statistics 37(3), 477-484.

const A = [
  3.3871328727963665, 133.14166789178438, 1971.5909503065513, 13731.69376550946, 45921.95393154987, 67265.7709270087, 33430.57558358813,
  2509.0809287301227,
] as const;
const B = [
  1.0, 42.31333070160091, 687.1870074920579, 5394.196021424751, 21213.794301586597, 39307.89580009271, 28729.085735721943,
  5226.495278852854,
] as const;
const C = [
  1.4234371107496835, 4.630337846156546, 5.769497221460691, 3.6478483247632045, 1.2704582524523684, 0.2417807251774506,
  0.022723844989269184, 0.0007745450142783414,
] as const;
const D = [
  1.0, 2.053191626637759, 1.6763848301838038, 0.6897673349851, 0.14810397642748008, 0.015198666563616457, 0.0005475938084995345,
  1.0507500716444169e-9,
] as const;
const E = [
  6.657904643501103, 5.463784911164114, 1.7848265399172913, 0.29656057182850487, 0.026532189526576124, 0.0012426609473880784,
  2.7115555687434876e-5, 2.0103343992922881e-7,
] as const;
const F = [
  1.0, 0.599832206555888, 0.1369298809227358, 0.014875361290850615, 0.0007868691311456133, 1.8463183175100548e-5, 1.421511758316446e-7,
  2.0442631033899397e-15,
] as const;

type Coefficients = readonly number[];

function horner(coefficients: Coefficients, x: number): number {
  let value = 0;
  for (let k = coefficients.length - 1; k >= 0; k -= 1) value = value * x + (coefficients[k] ?? 0);
  return value;
}

function normalQuantile(probability: number): number {
  if (!(probability > 0 && probability < 1)) throw new RangeError(`expected a probability between 0 and 1, got ${probability}`);
  const centred = probability - 0.5;
  if (Math.abs(centred) <= 0.425) {
    const square = 0.180625 - centred * centred;
    return (centred * horner(A, square)) / horner(B, square);
  }
  const tail = Math.sqrt(-Math.log(Math.min(probability, 1 - probability)));
  const size = tail <= 5 ? horner(C, tail - 1.6) / horner(D, tail - 1.6) : horner(E, tail - 5) / horner(F, tail - 5);
  return centred < 0 ? -size : size;
}

const GOLDEN_GAMMA = 0x9e3779b9;
const STREAM_FACTOR = 0x85ebca6b;
const TWO_TO_26 = 67108864;
const TWO_TO_52 = 4503599627370496;
const TWO_TO_32 = 4294967296;

const rotateLeft = (value: number, bits: number): number => (value << bits) | (value >>> (32 - bits));

/** The lowest 32 bits of any integer, also of one beyond what `|` takes. */
const low32 = (value: number): number => (((Math.trunc(value) % TWO_TO_32) + TWO_TO_32) % TWO_TO_32) | 0;

export class RandomNumbers {
  private a: number;
  private b: number;
  private c: number;
  private d: number;

  constructor(seed: number, stream = 0) {
    let filler = low32(seed) ^ Math.imul(stream, STREAM_FACTOR);
    const next = (): number => {
      filler = (filler + GOLDEN_GAMMA) | 0;
      let mixed = Math.imul(filler ^ (filler >>> 16), 0x21f0aaad);
      mixed = Math.imul(mixed ^ (mixed >>> 15), 0x735a2d97);
      return mixed ^ (mixed >>> 15);
    };
    this.a = next();
    this.b = next();
    this.c = next();
    this.d = next();
  }

  /** An integer in [0, 2^32). */
  integer(): number {
    const result = Math.imul(rotateLeft(Math.imul(this.b, 5), 7), 9) >>> 0;
    const shifted = this.b << 9;
    this.c ^= this.a;
    this.d ^= this.b;
    this.b ^= this.c;
    this.a ^= this.d;
    this.c ^= shifted;
    this.d = rotateLeft(this.d, 11);
    return result;
  }

  /** A number in the open interval (0, 1), of 52 random bits, from two integers. */
  uniform(): number {
    const high = this.integer() >>> 6;
    const low = this.integer() >>> 6;
    return (high * TWO_TO_26 + low + 0.5) / TWO_TO_52;
  }

  /** A standard normal deviate: the quantile of one uniform number. */
  normal(): number {
    return normalQuantile(this.uniform());
  }
}
