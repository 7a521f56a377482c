/** The worker: one run of the program for each message. */
import { Program } from "./program";
import type { Answer, Order } from "./session";

/** Sends an answer; buffers are handed over, not copied. */
function send(answer: Answer, transfer: Transferable[] = []): void {
  postMessage(answer, { transfer });
}

addEventListener("message", ({ data }: MessageEvent<Order>) => {
  const program = new Program(data.module);
  for (const [name, bytes] of data.files) program.put(name, bytes);
  const onMessage = (message: string) => send({ message });
  const outcome = program.run(data.words, { stdin: data.stdin, onMessage });
  const files = program.files();
  const buffers = new Set(
    [outcome.stdout, ...files.map(([, bytes]) => bytes)].map((b) => b.buffer),
  );
  send({ outcome, files }, [...buffers] as ArrayBuffer[]);
});
