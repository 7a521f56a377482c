// The studio as one file that holds the program as WebAssembly.

import { Offline } from "./offline";
import { start } from "./start";

/** Text of wasm/worker.ts, which offline.mjs puts here. */
declare const WORKER: string;

/** Returns the bytes of the module, which an element holds as base64 of a gzip file. */
async function moduleBytes(): Promise<ArrayBuffer> {
  const element = document.querySelector("[data-isoform-module]");
  const text = atob(element?.textContent ?? "");
  element?.remove();
  const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const address = URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" }));
const module = await WebAssembly.compile(await moduleBytes());
start(new Offline(module, () => new Worker(address)));
