// Arrays of numbers from the elements of the page, or from a packed scene.

import type { BlobRef, Numbers, Positions } from "./scene";

type Decoder = typeof Uint8Array & { fromBase64?: (text: string) => Uint8Array<ArrayBuffer> };

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const own = (Uint8Array as Decoder).fromBase64;
  if (own) return own.call(Uint8Array, text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Returns the bytes of an array; the element that holds them is emptied to free memory. */
async function bytesOf(ref: BlobRef): Promise<ArrayBuffer> {
  let bytes = ref.bytes;
  if (!bytes) {
    const element = document.querySelector(`[data-isoform-blob="${ref.blob}"]`);
    bytes = fromBase64(element?.textContent ?? "");
    element?.remove();
  }
  return (ref.deflated ? await inflate(bytes) : bytes).buffer as ArrayBuffer;
}

export async function f64(ref: BlobRef): Promise<Float64Array> {
  return new Float64Array(await bytesOf(ref));
}
export async function u32(ref: BlobRef): Promise<Uint32Array> {
  return new Uint32Array(await bytesOf(ref));
}
export async function u16(ref: BlobRef): Promise<Uint16Array> {
  return new Uint16Array(await bytesOf(ref));
}
export async function u8(ref: BlobRef): Promise<Uint8Array> {
  return new Uint8Array(await bytesOf(ref));
}
export async function f32(ref: BlobRef): Promise<Float32Array> {
  return new Float32Array(await bytesOf(ref));
}

async function plain(ref: BlobRef): Promise<Float32Array | Uint16Array> {
  return ref.type === "u16"
    ? new Uint16Array(await bytesOf(ref))
    : new Float32Array(await bytesOf(ref));
}

/** Coordinates as stored, with the transformation to coordinates of the file. */
export interface Coordinates {
  array: Float32Array | Uint16Array;
  from: number[];
  step: number[];
  lo: number[];
  hi: number[];
}

export async function coordinates(doc: Positions): Promise<Coordinates> {
  return { array: await plain(doc.array), from: doc.from, step: doc.step, lo: doc.lo, hi: doc.hi };
}

/** Returns coordinates in double precision. */
export function doubles(c: Coordinates): Float64Array {
  const out = new Float64Array(c.array.length);
  for (let i = 0; i < out.length; i += 3) {
    for (let k = 0; k < 3; k++) out[i + k] = c.from[k] + c.step[k] * c.array[i + k];
  }
  return out;
}

export async function numbers(doc: Numbers): Promise<Float32Array> {
  const array = await plain(doc.array);
  if (array instanceof Float32Array) return array;
  const out = new Float32Array(array.length);
  for (let i = 0; i < out.length; i++) out[i] = doc.from + doc.step * array[i];
  return out;
}
