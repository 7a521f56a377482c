// The server of isoform studio.

import { unpackScene } from "../scene";
import { type Answer, type Backend, Failure, type Stored } from "./backend";

const LOST = "The program that serves this page has ended. Start isoform studio again.";

/** Sends a request; a server that does not answer is an error in words. */
async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, { cache: "no-store", ...init });
  } catch (error) {
    if (init.signal?.aborted) throw error;
    throw new Error(LOST, { cause: error });
  }
  if (response.status === 422) throw new Failure((await response.json()).failure);
  if (!response.ok && response.status !== 409)
    throw new Error(`${path.split("?")[0]}: ${response.status} ${response.statusText}`);
  return response;
}

/** Yields the lines of a body as they come. */
async function* lines(
  body: ReadableStream<Uint8Array<ArrayBuffer>>,
  signal?: AbortSignal,
): AsyncGenerator<string> {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read().catch((error) => {
      if (signal?.aborted) throw error;
      throw new Error(LOST, { cause: error });
    });
    if (done) return;
    const parts = (rest + value).split("\n");
    rest = parts.pop()!;
    yield* parts;
  }
}

const pathOf = (name: string): string => `files/${encodeURIComponent(name)}`;

export const server: Backend = {
  async run(request, work = {}) {
    const response = await ask("run", {
      method: "POST",
      body: JSON.stringify(request),
      signal: work.signal,
    });
    for await (const line of lines(response.body!, work.signal)) {
      const message = JSON.parse(line);
      if (message.command) work.onCommand?.(message.command);
      if (message.progress) work.onProgress?.(message.progress.phase, message.progress.done);
      if (message.failure) throw new Failure(message.failure);
      if (message.answer) return message.answer as Answer;
    }
    throw new Error(LOST);
  },
  async scene(request, signal) {
    const body = JSON.stringify(request);
    const response = await ask("scene", { method: "POST", body, signal });
    return unpackScene(await response.arrayBuffer());
  },
  async put(name, content) {
    await ask(pathOf(name), { method: "PUT", body: content });
  },
  async get(name) {
    return (await ask(pathOf(name))).arrayBuffer();
  },
  async files() {
    return (await ask("files")).json();
  },
  address: (name, isSeen) => pathOf(name) + (isSeen ? "?open" : ""),
  opensPages: true,
  example: async () => (await ask("example")).arrayBuffer(),
  async stored() {
    return (await ask("project")).json();
  },
  async store(base, document) {
    const body = JSON.stringify(document);
    const response = await ask(`project?base=${base}`, { method: "PUT", body });
    const result = await response.json();
    return response.status === 409 ? (result as Stored) : result.version;
  },
  async news(after) {
    return (await (await ask(`news?after=${after}`)).json()).version;
  },
};
