// Requests to the server: work of verbs, pictures, files, and the state of the project.

import { type SceneDoc, unpackScene } from "../scene";

export type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
/** Document of a verb; its keys are those of `--json`. */
// eslint-disable-next-line @typescript-eslint/no-explicit-any
export type Document = any;

/** Request of a verb: its name and its arguments. */
export interface Request {
  verb: string;
  [argument: string]: Json;
}
/** Text in place of a file. */
export interface Text {
  name: string;
  text: string;
}
/** Request of a picture: the arguments of `view`. */
export interface SceneRequest {
  file: (string | Text)[];
  [argument: string]: Json | (string | Text)[];
}

export interface Answer {
  exit: number;
  document: Document;
  warnings: string[];
}

interface Problem {
  code: string;
  message: string;
  where: { file?: string; line?: number; column?: number; key?: string };
  why: string;
  hint: string;
}

/** Failure of a verb. */
export class Failure extends Error {
  readonly where: Problem["where"];
  readonly why: string;
  readonly hint: string;
  constructor(problem: Problem) {
    super(problem.message);
    this.where = problem.where;
    this.why = problem.why;
    this.hint = problem.hint;
  }
}

export interface Work {
  /** Receives the command line that does the same. */
  onCommand?: (line: string) => void;
  /** Receives the phase and the share of it that is done, 0 to 1. */
  onProgress?: (phase: string, done: number) => void;
  /** Ends the work. */
  signal?: AbortSignal;
}

/** State of the project as the server keeps it. */
export interface Stored {
  version: number;
  name: string;
  document: Json;
  opened: string[];
}

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
async function* lines(body: ReadableStream<Uint8Array<ArrayBuffer>>): AsyncGenerator<string> {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const parts = (rest + value).split("\n");
    rest = parts.pop()!;
    yield* parts;
  }
}

/** Does the work of a verb. */
export async function run(request: Request, work: Work = {}): Promise<Answer> {
  const response = await ask("run", {
    method: "POST",
    body: JSON.stringify(request),
    signal: work.signal,
  });
  for await (const line of lines(response.body!)) {
    const message = JSON.parse(line);
    if (message.command) work.onCommand?.(message.command);
    if (message.progress) work.onProgress?.(message.progress.phase, message.progress.done);
    if (message.failure) throw new Failure(message.failure);
    if (message.answer) return message.answer;
  }
  throw new Error(LOST);
}

/** Returns a picture of files and texts. */
export async function scene(request: SceneRequest, signal?: AbortSignal): Promise<SceneDoc> {
  const response = await ask("scene", { method: "POST", body: JSON.stringify(request), signal });
  return unpackScene(await response.arrayBuffer());
}

const pathOf = (name: string): string => `files/${encodeURIComponent(name)}`;

export async function put(name: string, content: Blob | string | ArrayBuffer): Promise<void> {
  await ask(pathOf(name), { method: "PUT", body: content });
}
export async function get(name: string): Promise<ArrayBuffer> {
  return (await ask(pathOf(name))).arrayBuffer();
}
export async function text(name: string): Promise<string> {
  return (await ask(pathOf(name))).text();
}
export async function json(name: string): Promise<Document> {
  return (await ask(pathOf(name))).json();
}
export async function files(): Promise<{ name: string; size: number }[]> {
  return (await ask("files")).json();
}
/** Returns the scan of a cup that the program carries. */
export async function example(): Promise<ArrayBuffer> {
  return (await ask("example")).arrayBuffer();
}
/** Returns the address of a page that a verb wrote. */
export const pageAddress = (name: string): string => `${pathOf(name)}?open`;

/** Hands a file over to the downloads of the browser. */
export function download(name: string): void {
  const link = document.createElement("a");
  link.href = pathOf(name);
  link.download = name;
  link.click();
}

export async function stored(): Promise<Stored> {
  return (await ask("project")).json();
}
/** Stores a state that follows the version `base`; returns the new version, or the state of another
 *  window that was quicker. */
export async function store(base: number, document: object): Promise<number | Stored> {
  const response = await ask(`project?base=${base}`, {
    method: "PUT",
    body: JSON.stringify(document),
  });
  const result = await response.json();
  return response.status === 409 ? result : result.version;
}
/** Resolves with the version of the state when it is another one, or after some seconds. */
export async function news(after: number): Promise<number> {
  return (await (await ask(`news?after=${after}`)).json()).version;
}
