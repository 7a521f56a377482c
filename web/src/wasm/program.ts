/**
 * The program `isoform` as WebAssembly (scripts/wasm.sh), with files in memory. A run blocks its
 * thread, so that pages start runs in a worker (session.ts).
 */
import { Directory, Fd, File, OpenFile, PreopenDirectory, WASI } from "@bjorn3/browser_wasi_shim";
import type { Inode } from "@bjorn3/browser_wasi_shim";

/** What a run has printed, and its exit code. */
export interface Outcome {
  /** 0 done, 1 usage, 2 input, 3 partial, 4 no result, 5 an internal error. */
  code: number;
  /** The document of `--json`, or the text or file that goes to stdout. */
  stdout: Uint8Array;
  /** Messages, in lines. */
  stderr: string;
}

/** Options of a run. */
export interface RunOptions {
  /** Bytes of the file `-`. */
  stdin?: Uint8Array;
  /** Takes messages while the program runs, as it writes them. */
  onMessage?: (text: string) => void;
}

/** Exit code of a run that broke off, as of the other internal errors. */
const INTERNAL = 5;
/** An error number of WASI: not supported. */
const UNSUPPORTED = 58;

/** A pipe that something is written to. It is no terminal: the program draws no bars. */
class Pipe extends Fd {
  constructor(private readonly take: (bytes: Uint8Array) => void) {
    super();
  }
  override fd_write(bytes: Uint8Array): { ret: number; nwritten: number } {
    this.take(bytes);
    return { ret: 0, nwritten: bytes.length };
  }
}

/**
 * What the C library of the module lacks. Threads are not started, and paths have no links that
 * could be followed: the standard library of Rust takes both as "not supported". The tag is that of
 * panics.
 */
const MISSING = {
  __cpp_exception: new WebAssembly.Tag({ parameters: ["i32"] }),
  pthread_attr_init: () => 0,
  pthread_attr_setstacksize: () => 0,
  pthread_attr_destroy: () => 0,
  pthread_create: () => UNSUPPORTED,
  pthread_detach: () => 0,
  pthread_join: () => UNSUPPORTED,
  realpath: () => 0,
};

/** The program with its files. */
export class Program {
  /** Folders and files below "/", which is where runs start, too. */
  private readonly root = new Directory(new Map());

  /** Makes a program without files of a compiled module. */
  constructor(private readonly module: WebAssembly.Module) {}

  /** Compiles the module. */
  static async load(module: ArrayBuffer): Promise<Program> {
    return new Program(await WebAssembly.compile(module));
  }

  /** Writes a file and makes the folders of its path; throws where a folder of it is a file. */
  put(name: string, bytes: Uint8Array): void {
    const parts = name.split("/").filter((part) => part !== "" && part !== ".");
    const last = parts.pop();
    if (last === undefined) throw new Error(`"${name}" is not the name of a file`);
    let folder = this.root;
    for (const part of parts) {
      const inner = folder.contents.get(part) ?? new Directory(new Map());
      if (!(inner instanceof Directory)) throw new Error(`${part} is a file, not a folder`);
      folder.contents.set(part, inner);
      folder = inner;
    }
    folder.contents.set(last, new File(bytes));
  }

  /** Returns the bytes of a file, `null` if there is none. */
  take(name: string): Uint8Array | null {
    const found = this.files().find(([path]) => path === name);
    return found === undefined ? null : found[1];
  }

  /** Returns the names of all files, with their folders. */
  list(): string[] {
    return this.files().map(([path]) => path);
  }

  /** Returns the files by their names. */
  files(): [string, Uint8Array][] {
    const found: [string, Uint8Array][] = [];
    const visit = (prefix: string, contents: Map<string, Inode>) => {
      for (const [name, inode] of contents) {
        if (inode instanceof File) found.push([prefix + name, inode.data]);
        if (inode instanceof Directory) visit(`${prefix}${name}/`, inode.contents);
      }
    };
    visit("", this.root.contents);
    return found;
  }

  /**
   * Runs the program with these words behind its name. Files that it writes stay. A program that
   * breaks off (too little memory, too deep a recursion) has exit code 5, and the reason
   * is the last line of its messages.
   */
  run(words: string[], options: RunOptions = {}): Outcome {
    const printed: Uint8Array[] = [];
    const decoder = new TextDecoder();
    let stderr = "";
    const say = (text: string) => {
      stderr += text;
      if (text !== "") options.onMessage?.(text);
    };
    const args = ["isoform", ...words];
    const wasi = new WASI(
      args,
      [],
      [
        new OpenFile(new File(options.stdin ?? new Uint8Array())),
        new Pipe((bytes) => printed.push(bytes)),
        new Pipe((bytes) => say(decoder.decode(bytes, { stream: true }))),
        new PreopenDirectory("/", this.root.contents),
      ],
      { debug: false },
    );
    const instance = new WebAssembly.Instance(this.module, {
      // Types of TypeScript do not know that tags are imported.
      env: MISSING as object as WebAssembly.ModuleImports,
      wasi_snapshot_preview1: { ...wasi.wasiImport, args_sizes_get },
    }) as WebAssembly.Instance & Parameters<WASI["start"]>[0];
    // The shim counts code units, not the bytes that it will write.
    function args_sizes_get(count: number, size: number): number {
      const view = new DataView(instance.exports.memory.buffer);
      const bytes = args.map((word) => new TextEncoder().encode(word).length + 1);
      view.setUint32(count, args.length, true);
      view.setUint32(
        size,
        bytes.reduce((sum, n) => sum + n, 0),
        true,
      );
      return 0;
    }
    let code;
    try {
      code = wasi.start(instance);
    } catch (error) {
      code = INTERNAL;
      say(`${decoder.decode()}error: the program broke off: ${String(error)}\n`);
    }
    say(decoder.decode());
    return { code, stdout: joined(printed), stderr };
  }
}

/** Returns the parts as one array. */
function joined(parts: Uint8Array[]): Uint8Array {
  const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
