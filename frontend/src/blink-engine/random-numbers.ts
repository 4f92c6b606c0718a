/** The engine's random numbers: xoshiro128** 1.1 seeded by SplitMix32, to the bit as in blink_engine/random_numbers.py. */
import { normalQuantile } from "./normal";

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
