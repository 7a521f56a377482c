// The program itself as WebAssembly, with files in memory: no server, no network.

import { unpackScene } from "../scene";
import { Session } from "../wasm/session";
import { type Answer, type Backend, type Document, Failure, type Stored } from "./backend";

/** Exit codes of runs that have a result (DESIGN of the command line: 0 done, 3 partial). */
const WITH_RESULT = [0, 3];

const bytesOf = async (content: Blob | string | ArrayBuffer): Promise<Uint8Array> =>
  new Uint8Array(await new Blob([content]).arrayBuffer());
const encoded = (text: string): Uint8Array => new TextEncoder().encode(text);
const decoded = (bytes: Uint8Array): string => new TextDecoder().decode(bytes);

/** Quotes a word of a command line. */
function quoted(word: string): string {
  return /^[\p{L}\p{N}\-_./=,:+@%]+$/u.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/** Returns the failure that a document tells; null if it has a result. */
function failureOf(document: Document, code: number): Failure | null {
  if (WITH_RESULT.includes(code) || !document.error) return null;
  return new Failure({ where: {}, why: "", hint: "", ...document.error });
}

/** Name of the file of a request among the files of a run. */
const REQUEST = "request.json";
/** Name of the file of a picture. */
const SCENE = "scene.bin";

export class Offline implements Backend {
  private readonly kept = new Map<string, Uint8Array>();
  private readonly addresses = new Map<string, string>();
  private version = 1;
  readonly example = null;
  // A page at an address of this one has its policy, too, which permits no other script.
  readonly opensPages = false;

  /** `start` makes a worker of wasm/worker.ts. */
  constructor(
    private readonly module: WebAssembly.Module,
    private readonly start: () => Worker,
  ) {}

  /** Runs the program with files; returns its document and the files that it has written. */
  private async call(
    words: string[],
    files: Map<string, Uint8Array>,
    signal?: AbortSignal,
    onMessage?: (text: string) => void,
  ) {
    const session = new Session(this.module, this.start);
    for (const [name, bytes] of files) session.files.set(name, bytes.slice());
    const cancel = () => session.cancel();
    signal?.addEventListener("abort", cancel);
    try {
      const outcome = signal?.aborted ? null : await session.run(words, { onMessage });
      if (!outcome) throw new DOMException("cancelled", "AbortError");
      return { outcome, files: session.files };
    } finally {
      signal?.removeEventListener("abort", cancel);
      session.close();
    }
  }

  async run(request: Parameters<Backend["run"]>[0], work: Parameters<Backend["run"]>[1] = {}) {
    const { verb, ...rest } = request;
    const list = Object.entries(rest).map(([name, value]) => `${name}=${JSON.stringify(value)}`);
    work.onCommand?.(`isoform ${verb} ${list.map(quoted).join(" ")}`);
    const files = new Map(this.kept).set(REQUEST, encoded(JSON.stringify(request)));
    const warnings: string[] = [];
    const onMessage = (text: string): void => {
      for (const line of text.split("\n")) {
        if (line.startsWith("warning: ")) warnings.push(line.slice("warning: ".length));
        else if (line.endsWith(" ...")) work.onProgress?.(line.slice(0, -4), 0);
      }
    };
    const words = ["--json", "run", REQUEST];
    const { outcome, files: after } = await this.call(words, files, work.signal, onMessage);
    const document: Document = JSON.parse(decoded(outcome.stdout) || "{}");
    const failure = failureOf(document, outcome.code);
    if (failure) throw failure;
    if (!outcome.stdout.length) throw new Error(outcome.stderr.trim().split("\n").pop());
    for (const [name, bytes] of after)
      if (name !== REQUEST && !same(bytes, this.kept.get(name))) this.keep(name, bytes);
    return { exit: outcome.code, document, warnings } satisfies Answer;
  }

  async scene(request: Parameters<Backend["scene"]>[0], signal?: AbortSignal) {
    const files = new Map<string, Uint8Array>();
    const names = request.file.map((file) => {
      if (typeof file !== "string") {
        files.set(file.name, encoded(file.text));
        return file.name;
      }
      const kept = this.kept.get(file);
      if (kept) files.set(file, kept);
      return file;
    });
    const box = "box" in request ? [`--box=${String(request.box)}`] : [];
    const words = ["--json", "view", "--packed", "-o", SCENE, ...box, "--", ...names];
    const { outcome, files: after } = await this.call(words, files, signal);
    const document: Document = JSON.parse(decoded(outcome.stdout) || "{}");
    const failure = failureOf(document, outcome.code);
    if (failure) throw failure;
    const packed = after.get(SCENE);
    if (!packed) throw new Error(outcome.stderr.trim().split("\n").pop());
    return unpackScene(packed.slice().buffer as ArrayBuffer);
  }

  private keep(name: string, bytes: Uint8Array): void {
    const old = this.addresses.get(name);
    if (old) URL.revokeObjectURL(old);
    this.addresses.delete(name);
    this.kept.set(name, bytes);
  }

  async put(name: string, content: Blob | string | ArrayBuffer): Promise<void> {
    this.keep(name, await bytesOf(content));
  }
  async get(name: string): Promise<ArrayBuffer> {
    const bytes = this.kept.get(name);
    if (!bytes) throw new Error(`there is no file ${name}`);
    return bytes.slice().buffer as ArrayBuffer;
  }
  async files(): Promise<{ name: string; size: number }[]> {
    const all = [...this.kept].map(([name, bytes]) => ({ name, size: bytes.length }));
    return all.sort((a, b) => (a.name < b.name ? -1 : 1));
  }
  address(name: string): string {
    const known = this.addresses.get(name);
    if (known) return known;
    const bytes = (this.kept.get(name) ?? new Uint8Array()) as Uint8Array<ArrayBuffer>;
    const address = URL.createObjectURL(new Blob([bytes]));
    this.addresses.set(name, address);
    return address;
  }

  async stored(): Promise<Stored> {
    return { version: this.version, name: "in this window", document: null, opened: [] };
  }
  async store(): Promise<number> {
    return ++this.version;
  }
  async news(): Promise<number> {
    // No other window has this state.
    return new Promise(() => {});
  }
}

function same(a: Uint8Array, b: Uint8Array | undefined): boolean {
  return b !== undefined && a.length === b.length && a.every((v, i) => v === b[i]);
}
