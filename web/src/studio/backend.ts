// What the page asks of the program: work of verbs, pictures, files, and the state of the project.

import type { SceneDoc } from "../scene";

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

export interface Problem {
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

/** Side of the program: a server, or the program itself as WebAssembly. */
export interface Backend {
  /** Does the work of a verb. */
  run(request: Request, work?: Work): Promise<Answer>;
  /** Returns a picture of files and texts. */
  scene(request: SceneRequest, signal?: AbortSignal): Promise<SceneDoc>;
  put(name: string, content: Blob | string | ArrayBuffer): Promise<void>;
  get(name: string): Promise<ArrayBuffer>;
  files(): Promise<{ name: string; size: number }[]>;
  /** Returns the address under which a browser finds a file; of a page that is to be seen, or of
   *  bytes that are to be kept. */
  address(name: string, isSeen: boolean): string;
  /** True if pages that verbs wrote can be opened; others are downloaded. */
  readonly opensPages: boolean;
  /** Returns the scan of a cup that the program carries; null if it carries none. */
  readonly example: (() => Promise<ArrayBuffer>) | null;
  stored(): Promise<Stored>;
  /** Stores a state that follows the version `base`; returns the new version, or the state of
   *  another window that was quicker. */
  store(base: number, document: object): Promise<number | Stored>;
  /** Resolves with the version of the state when it is another one, or after some seconds. */
  news(after: number): Promise<number>;
}

let current: Backend;
/** Sets the side of the program, before anything else is called. */
export function use(backend: Backend): void {
  current = backend;
}

export const run: Backend["run"] = (request, work) => current.run(request, work);
export const scene: Backend["scene"] = (request, signal) => current.scene(request, signal);
export const put: Backend["put"] = (name, content) => current.put(name, content);
export const get: Backend["get"] = (name) => current.get(name);
export const files: Backend["files"] = () => current.files();
export const example = (): Backend["example"] => current.example;
export const stored: Backend["stored"] = () => current.stored();
export const store: Backend["store"] = (base, document) => current.store(base, document);
export const news: Backend["news"] = (after) => current.news(after);

export async function text(name: string): Promise<string> {
  return new TextDecoder().decode(await get(name));
}
export async function json(name: string): Promise<Document> {
  return JSON.parse(await text(name));
}
/** Opens a page that a verb wrote, in a tab of its own. */
export function openPage(name: string): void {
  if (current.opensPages) open(current.address(name, true), "_blank", "noopener");
  else download(name);
}
/** Hands a file over to the downloads of the browser. */
export function download(name: string): void {
  const link = document.createElement("a");
  link.href = current.address(name, false);
  link.download = name;
  link.click();
}
