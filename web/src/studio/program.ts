// HyperFun programs: an editor, the shape that follows it, meshes and solids with certificates.

import { brief, h } from "../dom";
import type { App, Space } from "./app";
import { endingOf } from "./endings";
import type { Document, Failure, Request, SceneRequest } from "./backend";
import * as backend from "./backend";
import { Editor, type FunctionDoc, functionsOf } from "./editor";
import { FIRST_PROGRAM, type ProgramState } from "./history";
import { button, certificate, choice, figures, section, setOptions } from "./parts";

/** Milliseconds of rest after which typing becomes a step that can be undone. */
const REST = 700;

const EXPORTS: [string, string, string][] = [
  ["stl", "STL", "Triangles, for printing"],
  ["3mf", "3MF", "Triangles with their unit, for printing"],
  ["msh", "MSH", "Tetrahedra, for Gmsh and solvers"],
  ["inp", "INP", "Tetrahedra, for CalculiX and Abaqus"],
];

export class ProgramSpace implements Space {
  readonly title = "Program";
  readonly element = h("div", { class: "space is-editor" });
  private readonly holder = h("div", { class: "holder" });
  private editor: Editor | null = null;
  private readonly error = h("div", { class: "error", role: "status" });
  private readonly examples: HTMLSelectElement;
  private readonly functions: HTMLSelectElement;
  private readonly size = h("input", { type: "number", min: "0", step: "any" });
  private readonly meshButton: HTMLButtonElement;
  private readonly solidButton: HTMLButtonElement;
  private readonly result = h("div", { role: "status" });
  private readonly withScan = h("input", { type: "checkbox" });
  private programs: Document[] = [];
  private table: FunctionDoc[] = [];
  /** Text that is drawn while it is typed; null to draw the text of the project. */
  private typed: string | null = null;
  private rest = 0;
  /** Text and values of the result that is shown. */
  private resultOf = "";

  constructor(private readonly app: App) {
    this.examples = choice("Examples", [], (name) => this.openExample(name));
    this.functions = choice("Insert a function", [], (name) => {
      const found = this.table.find((f) => f.names[0] === name);
      if (found) this.editor?.insert(found.signature);
      this.functions.value = "";
    });
    this.meshButton = app.whileIdle(
      button("Mesh and certify", () => void this.mesh("msh", false), "primary"),
    );
    this.solidButton = app.whileIdle(button("Make a solid (STEP)", () => void this.solid()));
    const save = button("Save program", () => void this.saveProgram());
    this.size.setAttribute("aria-label", "Length of edges");
    this.size.placeholder = "a fortieth";
    this.withScan.addEventListener("change", () => app.refresh());
    const fit = app.whileIdle(button("Fit to the scan", () => void this.fit()));
    fit.title = "Use this program as the template of the scan, and fit its parameters";
    this.fitButton = fit;
    this.scanRow = h("label", { class: "iv-name" }, this.withScan, "Show the scan with it");
    const exports = EXPORTS.map(([ending, name, title]) => {
      const each = app.whileIdle(button(name, () => void this.mesh(ending, true)));
      each.title = title;
      return each;
    });
    this.exports = exports;
    this.element.append(
      h("div", { class: "tools" }, this.examples, this.functions, save),
      this.holder,
      this.error,
      section(
        "Check and save",
        h(
          "div",
          { class: "tools" },
          this.meshButton,
          this.solidButton,
          fit,
          h("label", { class: "inline" }, "Edges ", this.size),
        ),
        this.scanRow,
        this.result,
        h("div", { class: "tools" }, ...exports),
      ),
    );
  }
  private readonly fitButton: HTMLButtonElement;
  private readonly scanRow: HTMLElement;
  private readonly exports: HTMLButtonElement[];

  private get state(): ProgramState {
    return this.app.history.state.program;
  }
  private get text(): string {
    return this.typed ?? this.state.text;
  }

  /** Creates the editor when the tab is first seen; it needs the table of functions. */
  private begin(): void {
    if (this.holder.dataset.state) return;
    this.holder.dataset.state = "loading";
    const table = backend.run({ verb: "functions" });
    const list = backend.run({ verb: "fit", list: true });
    Promise.all([table, list])
      .then(([{ document }, { document: gallery }]) => {
        this.table = functionsOf(document);
        this.programs = gallery.templates;
        this.editor = new Editor("HyperFun program", this.table);
        this.holder.replaceChildren(this.editor.element);
        this.editor.onType = (text) => this.type(text);
        setOptions(
          this.examples,
          [
            ["", "Examples…"],
            ["plate", "Plate with a hole"],
            ...this.programs.map((p): [string, string] => [p.name, p.title ?? p.name]),
          ],
          "",
        );
        setOptions(
          this.functions,
          [
            ["", "Functions…"],
            ...this.table.map((f): [string, string] => [f.names[0], f.signature]),
          ],
          "",
        );
        this.app.refresh();
      })
      .catch((error) => this.app.fail(error));
  }

  /** Follows the typing: the shape at once, a step of the project after a rest. */
  private type(text: string): void {
    this.typed = text;
    clearTimeout(this.rest);
    this.rest = setTimeout(() => this.keep(), REST) as unknown as number;
    this.app.draw();
  }

  settle(): void {
    this.keep();
  }

  /** Makes what was typed a step of the project. */
  private keep(): void {
    clearTimeout(this.rest);
    const text = this.typed;
    this.typed = null;
    if (text === null || text === this.state.text) return;
    this.app.history.commit("Edit the program", { program: { ...this.state, text } }, true);
  }

  private openExample(name: string): void {
    this.examples.value = "";
    const found = this.programs.find((p) => p.name === name);
    const text = found?.program ?? FIRST_PROGRAM;
    this.typed = null;
    this.app.history.commit(`Example ${name}`, { program: { name: `${name}.hf`, text } });
  }

  picture(): { request: SceneRequest; subject: string } | null {
    const { scan } = this.app.history.state;
    const points = this.withScan.checked && scan.file ? [scan.file] : [];
    const { name } = this.state;
    return { request: { file: [{ name, text: this.text }, ...points] }, subject: name };
  }

  failed(error: Error | null): void {
    const { where, hint } = (error ?? {}) as Partial<Failure>;
    this.error.replaceChildren(
      ...(error ? [h("strong", {}, error.message), ...(hint ? [` Try: ${hint}`] : [])] : []),
    );
    const at = where?.line
      ? { message: error!.message, line: where.line, column: where.column ?? 1 }
      : null;
    this.editor?.mark(at);
  }

  refresh(): void {
    this.begin();
    if (this.typed === null) this.editor?.set(this.state.text);
    const { scan } = this.app.history.state;
    this.scanRow.hidden = scan.file === "";
    this.fitButton.hidden = scan.file === "";
    for (const each of [this.meshButton, this.solidButton, this.fitButton, ...this.exports])
      each.disabled = this.app.isBusy;
    if (this.resultOf !== this.subject()) this.result.replaceChildren();
  }

  private subject(): string {
    return JSON.stringify([this.text, this.values()]);
  }

  /** Returns the parameters that sliders have moved, as they are set in requests. */
  private values(): string[] {
    return (this.app.viewer?.moved() ?? []).map((p) => `${p.name}=${p.value}`);
  }

  async open(name: string): Promise<boolean> {
    if (endingOf(name) !== "hf") return false;
    const text = await backend.text(name);
    this.typed = null;
    this.app.history.commit(`Open ${name}`, { tab: "program", program: { name, text } });
    return true;
  }

  /** Writes the program to a file; returns its name. */
  private async written(): Promise<string> {
    this.keep();
    const { name, text } = this.state;
    const file = this.app.history.fresh(stemOf(name), "hf");
    await backend.put(file, text);
    return file;
  }

  private async saveProgram(): Promise<void> {
    try {
      backend.download(await this.written());
    } catch (error) {
      this.app.fail(error as Error);
    }
  }

  /** Meshes the program; the file is saved if it is wanted. */
  private async mesh(ending: string, isSaved: boolean): Promise<void> {
    const model = await this.written();
    const output = this.app.history.fresh(stemOf(this.state.name), ending);
    await this.app.work("Meshing", async (run) => {
      const request: Request = { verb: "mesh", model, output: [output] };
      if (ending === "stl" || ending === "3mf") request.surface_only = true;
      if (Number(this.size.value) > 0) request.size = Number(this.size.value);
      const values = this.values();
      if (values.length) request.set = values;
      const answer = await run(request);
      const { document } = answer;
      this.resultOf = this.subject();
      this.result.replaceChildren(certificate(document, answer), figures(measures(document)));
      if (isSaved) backend.download(output);
    });
  }

  private async solid(): Promise<void> {
    const model = await this.written();
    const output = this.app.history.fresh(stemOf(this.state.name), "step");
    await this.app.work("Making a solid", async (run) => {
      const request: Request = { verb: "brep", model, output: [output] };
      const values = this.values();
      if (values.length) request.set = values;
      const answer = await run(request);
      this.resultOf = this.subject();
      this.result.replaceChildren(
        certificate(answer.document, answer),
        figures(measures(answer.document)),
      );
      if (answer.document.files?.length) backend.download(output);
    });
  }

  /** Takes the program as the template of the scan. */
  private async fit(): Promise<void> {
    try {
      const template = await this.written();
      const { history } = this.app;
      const { scan } = history.state;
      history.commit("Template of the scan", {
        tab: "scan",
        scan: { ...scan, template, fixed: {}, fit: null },
      });
      document.querySelector<HTMLButtonElement>("#space-scan button.primary")?.click();
    } catch (error) {
      this.app.fail(error as Error);
    }
  }
}

const stemOf = (name: string): string => name.replace(/\.[^.]*$/, "").replace(/(-\d+)?$/, "");

/** Returns the measures of a mesh or a solid. */
export function measures(document: Document): [string, string][] {
  const { counts, certificate: proof } = document;
  const rows: [string, Document][] = [
    ["solids", document.solids],
    ["faces", document.faces?.length],
    ["points", counts?.points],
    ["triangles", counts?.triangles],
    ["tetrahedra", counts?.tets || undefined],
    ["volume", document.volume ?? proof?.volume],
    ["area", document.area ?? proof?.area],
    ["thinnest wall", proof?.walls?.thickness],
  ];
  return rows
    .filter(([, value]) => typeof value === "number")
    .map(([name, value]) => [name, brief(value)]);
}
