/** The page's side: files, and runs of the program in a worker that can be ended. */
import type { Outcome, RunOptions } from "./program";

/** A run that a worker is to do. */
export interface Order {
  module: WebAssembly.Module;
  words: string[];
  stdin?: Uint8Array;
  files: [string, Uint8Array][];
}

/** What a worker sends: messages while it runs, then the outcome with all files. */
export type Answer = { message: string } | { outcome: Outcome; files: [string, Uint8Array][] };

/** Files of the page, and one run at a time. */
export class Session {
  /** Files by their names, `folder/part.hf`; runs read and write them. */
  readonly files = new Map<string, Uint8Array>();
  private worker: Worker | null = null;
  private cancelled: (() => void) | null = null;

  /** `start` makes a worker of worker.ts. */
  constructor(
    private readonly module: WebAssembly.Module,
    private readonly start: () => Worker,
  ) {}

  /**
   * Runs the program with these words behind its name; `null` if the run was cancelled. Throws
   * while another run is going on, and where the worker cannot work.
   */
  run(words: string[], options: RunOptions = {}): Promise<Outcome | null> {
    if (this.cancelled !== null) throw new Error("another run is going on");
    const worker = (this.worker ??= this.start());
    return new Promise<Outcome | null>((resolve, reject) => {
      this.cancelled = () => {
        this.close();
        resolve(null);
      };
      worker.onerror = (event) => {
        this.close();
        reject(new Error(event.message));
      };
      worker.onmessage = ({ data }: MessageEvent<Answer>) => {
        if ("message" in data) {
          options.onMessage?.(data.message);
          return;
        }
        this.cancelled = null;
        this.files.clear();
        for (const [name, bytes] of data.files) this.files.set(name, bytes);
        resolve(data.outcome);
      };
      const order: Order = {
        module: this.module,
        words,
        stdin: options.stdin,
        files: [...this.files],
      };
      worker.postMessage(order);
    });
  }

  /** Ends the run, if there is one; files are as they were before it. */
  cancel(): void {
    this.cancelled?.();
  }

  /** Ends the worker; the next run starts another one. */
  close(): void {
    this.worker?.terminate();
    this.worker = null;
    this.cancelled = null;
  }
}
