/** Eyes found in a video, and the shape that is laid on them. */

import { type Point, type Shape, type Size, templateEye } from "./points";

/** Eyes on one of the small pictures that are looked at, in its pixels. */
export interface EyePlaces {
  /** The middle of each eye, the image-left one first. */
  readonly centres: readonly Point[];
  /** From corner to corner, in pixels. */
  readonly width: number;
}

/** Eyes followed through a video. */
export interface FoundEyes {
  readonly width: number;
  /** Middle of each eye on every picture looked at. */
  readonly centres: readonly (readonly Point[])[];
  /** How closed they are on every picture: 0 as around it, 1 as in their blinks. */
  readonly closed: readonly number[];
  /** Pictures of their blinks, the most closed first. */
  readonly blinks: readonly number[];
}

/** What was found for either choice of the page; `size` is that of the pictures looked at. */
export interface EyesOfVideo {
  readonly size: Size;
  readonly two: FoundEyes | null;
  readonly one: FoundEyes | null;
  /** Why nothing could be looked for, null where it was. */
  readonly problem: string | null;
}

export const NO_EYES: EyesOfVideo = { size: [1, 1], two: null, one: null, problem: null };

/** Width of an eye by the distance of both: 30 mm of 63 mm in adults, of which a shape's corners leave some to either side. */
export const WIDTH_OF_DISTANCE = 0.42;
/** Lids of a shape are never laid quite closed: their points would lie on one another. */
const MAX_CLOSED = 0.85;

/** The eyes for one or two of them; of two eyes the image-left one where one is asked for. */
export function eyesFor({ one, two }: EyesOfVideo, eyes: 1 | 2): FoundEyes | null {
  if (eyes === 2) return two;
  if (one !== null || two === null) return one;
  return { ...two, centres: two.centres.map((places) => places.slice(0, 1)) };
}

/** Where the eyes are on a picture, in pixels of the video. */
export function placesOn(eyesFound: FoundEyes, index: number, [looked]: Size, [wide]: Size): EyePlaces {
  const scale = wide / looked;
  const centres = (eyesFound.centres[index] ?? []).map(([x, y]): Point => [(x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5]);
  return { centres, width: eyesFound.width * scale };
}

/** An open shape on the eyes, turned as they are, its lids closed by a share. */
export function shapeOn({ centres, width }: EyePlaces, closed: number): Shape {
  const [first, last] = [centres[0] ?? [0, 0], centres[centres.length - 1] ?? [0, 0]];
  const distance = Math.hypot(last[0] - first[0], last[1] - first[1]);
  const [cosine, sine] = distance > 0 ? [(last[0] - first[0]) / distance, (last[1] - first[1]) / distance] : [1, 0];
  const eye = templateEye(MAX_CLOSED * Math.min(1, Math.max(0, closed)));
  return centres.flatMap(([x, y], number) =>
    eye.map(([along, down]): Point => {
      const [u, v] = [(number === 0 ? along - 0.5 : 0.5 - along) * width, down * width];
      return [x + cosine * u - sine * v, y + sine * u + cosine * v];
    }),
  );
}

/** What was found for a choice of the page, in a sentence, and where the first shape lies then. */
export function noticeOf(known: EyesOfVideo, eyes: 1 | 2): string {
  const eyesFound = eyesFor(known, eyes);
  const middle = "The first shape is in the middle of the picture: drag it into place.";
  if (eyesFound !== null) {
    const many = eyesFound.blinks.length === 1 ? "a blink" : `${eyesFound.blinks.length} blinks`;
    return `${eyes === 2 ? "Two eyes" : "An eye"} found by ${many}; the first shape lies there, and the frames include blinks.`;
  }
  if (known.problem !== null) return `The search for eyes failed (${known.problem}). ${middle}`;
  if (known.one !== null) return `No two eyes that blink together were found, only one large eye. Is this a close-up? ${middle}`;
  return `No blinking eye${eyes === 2 ? "s were" : " was"} found. ${middle}`;
}
