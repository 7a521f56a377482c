// Comparison of two files: deviations both ways, colours, a tolerance, a page to print.

import { brief, h } from "../dom";
import type { App, Space } from "./app";
import { endingOf, MESHES, POINTS, SOLIDS } from "./endings";
import type { Document, Request, SceneRequest } from "./backend";
import * as backend from "./backend";
import type { CompareState } from "./history";
import { button, choice, field, section, setOptions, warnings } from "./parts";

/** Maximum number of faces that are listed. */
const MOST_FACES = 200;
const ENDINGS = [...POINTS, ...MESHES, ...SOLIDS, "hf"];

/** Formats a length with four digits. */
const figure = (v: number | null | undefined): string =>
  typeof v === "number" ? brief(Number(v.toPrecision(4))) : "–";

export class CompareSpace implements Space {
  readonly title = "Compare";
  readonly element = h("div", { class: "space" });
  private readonly first: HTMLSelectElement;
  private readonly second: HTMLSelectElement;
  private readonly tolerance = h("input", { type: "number", min: "0", step: "any" });
  private readonly aligned = h("input", { type: "checkbox" });
  private readonly measure: HTMLButtonElement;
  private readonly printButton: HTMLButtonElement;
  private readonly fromScan: HTMLButtonElement;
  private readonly result = h("div", { role: "status" });
  private names: string[] = [];
  private document: Document = null;
  private loaded = "";

  constructor(private readonly app: App) {
    this.first = choice("Measured", [], (first) => this.change("Measured file", { first }));
    this.second = choice("Nominal", [], (second) => this.change("Nominal file", { second }));
    this.tolerance.addEventListener("change", () =>
      this.change("Tolerance", { tolerance: this.tolerance.value }),
    );
    this.aligned.addEventListener("change", () =>
      this.change("Alignment", { isAligned: this.aligned.checked }),
    );
    this.measure = app.whileIdle(button("Compare", () => void this.compare(), "primary"));
    this.fromScan = button("The scan with its model", () => this.takeScan());
    this.printButton = button("Print", () => print());
    this.printButton.title = "The figures and the picture, on paper or as PDF";
    this.element.append(
      section(
        "Compare",
        field("Measured: a scan, a mesh, a solid or a program", this.first),
        field("Nominal", this.second),
        field("Largest deviation that passes", this.tolerance),
        h("label", { class: "iv-name" }, this.aligned, "Align the measured one first (best fit)"),
        h("div", { class: "tools" }, this.measure, this.printButton, this.fromScan),
      ),
      section("Deviations", this.result),
    );
  }

  private get state(): CompareState {
    return this.app.history.state.compare;
  }
  private change(label: string, change: Partial<CompareState>): void {
    const compare = { ...this.state, document: "", points: "", ...change };
    this.app.history.commit(label, { compare });
  }

  picture(): { request: SceneRequest; subject: string } | null {
    const { first, second, points } = this.state;
    const files = [points || first, second].filter((name) => name !== "");
    return files.length ? { request: { file: files }, subject: files.join() } : null;
  }

  refresh(): void {
    const { first, second, tolerance, isAligned, document } = this.state;
    void this.list();
    const options: [string, string][] = [
      ["", "choose a file"],
      ...this.names.map((name): [string, string] => [name, name]),
    ];
    setOptions(this.first, options, first);
    setOptions(this.second, options, second);
    if (this.tolerance !== window.document.activeElement) this.tolerance.value = tolerance;
    this.aligned.checked = isAligned;
    this.measure.disabled = !first || !second || this.app.isBusy;
    this.printButton.disabled = document === "";
    this.fromScan.hidden = this.app.history.state.scan.fit === null;
    if (document !== this.loaded) void this.load(document);
    else this.tell();
  }

  /** Takes the scan and what was made of it. */
  private takeScan(): void {
    const { file, fit } = this.app.history.state.scan;
    if (fit)
      this.change("The scan with its model", {
        first: file,
        second: fit.files.step ?? fit.files.hf,
      });
  }

  private async list(): Promise<void> {
    try {
      const names = (await backend.files()).map((f) => f.name);
      const own = names.filter((name) => ENDINGS.includes(endingOf(name)));
      if (own.join("\n") === this.names.join("\n")) return;
      this.names = own;
      this.app.refresh();
    } catch {
      // The next request says that the server is gone.
    }
  }

  private async load(name: string): Promise<void> {
    this.loaded = name;
    this.document = name ? await backend.json(name) : null;
    this.tell();
  }

  async open(name: string): Promise<boolean> {
    if (!ENDINGS.includes(endingOf(name))) return false;
    const { first, second } = this.state;
    const isFirst = first === "" || second !== "";
    this.app.history.commit(`Open ${name}`, {
      tab: "compare",
      compare: {
        ...this.state,
        ...(isFirst ? { first: name } : { second: name }),
        document: "",
        points: "",
      },
    });
    return true;
  }

  private async compare(): Promise<void> {
    const { first, second, tolerance, isAligned } = this.state;
    const points = this.app.history.fresh("deviation", "ply");
    await this.app.work("Comparing", async (run) => {
      const request: Request = { verb: "compare", first, second, output: [points] };
      if (tolerance.trim()) request.tolerance = tolerance.trim();
      if (isAligned) request.align = true;
      const answer = await run(request);
      const name = points.replace(/ply$/, "json");
      await backend.put(name, JSON.stringify({ ...answer.document, told: answer.warnings }));
      this.app.history.commit("Compare", { compare: { ...this.state, document: name, points } });
    });
  }

  private tell(): void {
    const { document } = this;
    if (!document) {
      this.result.replaceChildren(
        h("p", { class: "quiet" }, "Choose two files, then press Compare."),
      );
      return;
    }
    const ways: [string, Document][] = [
      ["measured to nominal", document.first_to_second],
      ["nominal to measured", document.second_to_first],
    ];
    const cells = (key: string): HTMLElement[] =>
      ways.map(([, way]) => h("td", {}, figure(way?.[key])));
    const rows = [
      ["rms", "rms"],
      ["mean", "mean"],
      ["95 % within", "p95"],
      ["largest", "max"],
    ].map(([name, key]) => h("tr", {}, h("th", { scope: "row" }, name), ...cells(key)));
    const isToleranced = document.tolerance !== null && document.tolerance !== undefined;
    const passes = document.within_tolerance === true;
    this.result.replaceChildren(
      ...(isToleranced
        ? [
            h(
              "div",
              { class: passes ? "verdict is-good" : "verdict is-doubtful" },
              h(
                "strong",
                {},
                passes
                  ? `Passes: all within ${brief(document.tolerance)}.`
                  : `Fails: not all within ${brief(document.tolerance)}.`,
              ),
            ),
          ]
        : []),
      h(
        "table",
        {},
        h("caption", {}, "Distances, in the unit of the files"),
        h(
          "thead",
          {},
          h("tr", {}, h("td", {}), ...ways.map(([name]) => h("th", { scope: "col" }, name))),
        ),
        h("tbody", {}, ...rows),
      ),
      ...this.faces(document.faces ?? []),
      ...warnings(document.told ?? []),
    );
  }

  /** Creates the table of the faces of the nominal file, those that fail first. */
  private faces(all: Document[]): Node[] {
    if (!all.length) return [];
    const rank = (face: Document): number =>
      face.within_tolerance === false ? 0 : face.samples ? 1 : 2;
    const sorted = [...all].sort((a, b) => rank(a) - rank(b) || (b.max ?? 0) - (a.max ?? 0));
    const verdict = ({ within_tolerance }: Document): string =>
      ({ true: "passes", false: "fails" })[String(within_tolerance)] ?? "–";
    const shown = sorted.slice(0, MOST_FACES);
    return [
      h(
        "table",
        {},
        h("caption", {}, "Measured points by the nearest face of the nominal file"),
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            ...["face", "points", "rms", "largest", "verdict"].map((name) =>
              h("th", { scope: "col" }, name),
            ),
          ),
        ),
        h(
          "tbody",
          {},
          ...shown.map((face) =>
            h(
              "tr",
              {},
              h("th", { scope: "row" }, face.face),
              h("td", {}, face.samples.toLocaleString("en")),
              h("td", {}, figure(face.rms)),
              h("td", {}, figure(face.max)),
              h("td", {}, verdict(face)),
            ),
          ),
        ),
      ),
      ...(sorted.length > MOST_FACES
        ? [h("p", { class: "quiet" }, `and ${sorted.length - MOST_FACES} more faces`)]
        : []),
    ];
  }
}
