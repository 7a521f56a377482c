// Surfaces by formulas: F(x, y, z) = 0, or X, Y, Z and W in s and t, with their certificates.

import { foreign, h } from "../dom";
import type { App, Space } from "./app";
import { endingOf } from "./endings";
import type { Document, Failure, Request, SceneRequest } from "./backend";
import * as backend from "./backend";
import type { SurfaceState } from "./history";
import { button, certificate, choice, field, figures, section, warnings } from "./parts";
import { measures } from "./program";

/** Milliseconds of rest before a surface is computed anew. */
const REST = 250;

type Formula = "F" | "X" | "Y" | "Z" | "W";

const EXAMPLES: [string, Partial<SurfaceState>][] = [
  ["Rounded ball", { kind: "implicit", F: "x^2 + y^2 + z^4 = 1", box: "" }],
  ["Hyperboloid", { kind: "implicit", F: "x^2 + y^2 - z^2 = 1", box: "" }],
  ["Ring", { kind: "implicit", F: "(sqrt(x^2 + y^2) - 1)^2 + z^2 = r^2/9", box: "" }],
  ["Sphere", { kind: "map", X: "2*s", Y: "2*t", Z: "s^2 + t^2 - 1", W: "s^2 + t^2 + 1", box: "2" }],
  [
    "Roman surface",
    { kind: "map", X: "2*s*t", Y: "2*t", Z: "2*s", W: "s^2 + t^2 + 1", box: "1.2" },
  ],
  [
    "Enneper's surface",
    {
      kind: "map",
      X: "3*s - s^3 + 3*s*t^2",
      Y: "3*t - t^3 + 3*s^2*t",
      Z: "3*s^2 - 3*t^2",
      W: "1",
      box: "6",
    },
  ],
  ["Whitney's umbrella", { kind: "map", X: "s*t", Y: "s", Z: "t^2", W: "1", box: "2" }],
];

export class SurfaceSpace implements Space {
  readonly title = "Surface";
  readonly element = h("div", { class: "space" });
  private readonly kind: HTMLSelectElement;
  private readonly examples: HTMLSelectElement;
  private readonly fields = new Map<Formula | "box", HTMLInputElement>();
  private readonly rows = new Map<Formula | "box", HTMLElement>();
  private readonly error = h("div", { class: "error", role: "status" });
  private readonly proof: HTMLButtonElement;
  private readonly patches: HTMLButtonElement;
  private readonly saveStl: HTMLButtonElement;
  private readonly savePage: HTMLButtonElement;
  private readonly result = h("div", { role: "status" });
  private typed: Partial<SurfaceState> | null = null;
  private rest = 0;
  private resultOf = "";

  constructor(private readonly app: App) {
    this.kind = choice(
      "Kind of the surface",
      [
        ["implicit", "F(x, y, z) = 0"],
        ["map", "(X : Y : Z : W) of s and t"],
      ],
      (kind) => this.change("Kind of the surface", { kind: kind as SurfaceState["kind"] }),
    );
    this.examples = choice(
      "Examples",
      [["", "Examples…"], ...EXAMPLES.map(([name]): [string, string] => [name, name])],
      (name) => {
        this.examples.value = "";
        const found = EXAMPLES.find((e) => e[0] === name);
        if (found) this.change(`Example ${name}`, found[1]);
      },
    );
    for (const key of ["F", "X", "Y", "Z", "W", "box"] as const) {
      const input = h("input", {
        type: "text",
        spellcheck: "false",
        autocapitalize: "off",
        input: () => this.type(key, input.value),
        change: () => this.keep(),
      });
      if (key === "box") input.placeholder = "chosen";
      this.fields.set(key, input);
      this.rows.set(key, field(key === "box" ? "Half the width of the box" : key, input));
    }
    this.proof = app.whileIdle(
      button("Triangulate and certify", () => void this.check(), "primary"),
    );
    this.patches = app.whileIdle(button("Rational patch", () => void this.patch()));
    this.patches.title = "A rational patch on the surface, with a proved distance";
    this.saveStl = app.whileIdle(button("STL", () => void this.check("stl")));
    this.saveStl.title = "Triangles, for printing";
    this.savePage = app.whileIdle(button("Page", () => void this.page()));
    this.savePage.title = "One page that shows the surface in any browser";
    this.element.append(
      section(
        "Surface",
        h("div", { class: "tools" }, this.kind, this.examples),
        ...this.rows.values(),
        this.error,
      ),
      section(
        "Check and save",
        h("div", { class: "tools" }, this.proof, this.patches, this.saveStl, this.savePage),
        this.result,
      ),
    );
  }

  private get stored(): SurfaceState {
    return this.app.history.state.surface;
  }
  private get state(): SurfaceState {
    return { ...this.stored, ...this.typed };
  }

  private change(label: string, change: Partial<SurfaceState>): void {
    this.typed = null;
    this.app.history.commit(label, { surface: { ...this.stored, ...change } });
  }

  private type(key: Formula | "box", value: string): void {
    this.typed = { ...this.typed, [key]: value };
    clearTimeout(this.rest);
    this.rest = setTimeout(() => this.app.draw(), REST) as unknown as number;
  }

  settle(): void {
    this.keep();
  }

  /** Makes what was typed a step of the project. */
  private keep(): void {
    clearTimeout(this.rest);
    if (!this.typed) return;
    const surface = this.state;
    this.typed = null;
    this.app.history.commit("Edit the surface", { surface });
  }

  /** Returns the document of the surface. */
  private document(): string {
    const { kind, F, X, Y, Z, W } = this.state;
    return JSON.stringify(kind === "map" ? { X, Y, Z, W: W || "1" } : { F });
  }

  picture(): { request: SceneRequest; subject: string } | null {
    const { kind, box } = this.state;
    const request: SceneRequest = { file: [{ name: "surface.json", text: this.document() }] };
    if (box.trim()) request.box = box.trim();
    return { request, subject: `${kind} ${box}` };
  }

  failed(error: Error | null): void {
    const { hint, where } = (error ?? {}) as Partial<Failure>;
    const place = where?.key ? `${where.key}: ` : "";
    this.error.replaceChildren(
      ...(error
        ? [h("strong", {}, place + error.message), ...(hint ? [` Try: ${hint}`] : [])]
        : []),
    );
    for (const [key, input] of this.fields)
      input.setAttribute("aria-invalid", String(error !== null && where?.key === key));
  }

  refresh(): void {
    const { state } = this;
    this.kind.value = state.kind;
    for (const [key, input] of this.fields) {
      if (input.value !== state[key]) input.value = state[key];
      const isMap = state.kind === "map";
      this.rows.get(key)!.hidden = key !== "box" && isMap === (key === "F");
    }
    this.patches.hidden = state.kind === "map";
    this.proof.textContent = state.kind === "map" ? "Triangulate and certify" : "Mesh and certify";
    for (const each of [this.proof, this.patches, this.saveStl, this.savePage])
      each.disabled = this.app.isBusy;
    if (this.resultOf !== this.document() + state.box) this.result.replaceChildren();
  }

  async open(name: string): Promise<boolean> {
    if (endingOf(name) !== "json") return false;
    let document: Document;
    try {
      document = await backend.json(name);
    } catch {
      return false;
    }
    const texts = Object.fromEntries(
      Object.entries(document ?? {}).filter(
        ([key, value]) => /^[fxyzw]$/i.test(key) && typeof value === "string",
      ),
    ) as Record<string, string>;
    const of = (key: string): string => texts[key] ?? texts[key.toLowerCase()] ?? "";
    const isMap = of("X") !== "";
    if (!isMap && !of("F")) return false;
    const box = typeof document.box === "number" ? String(document.box) : "";
    const own: Partial<SurfaceState> = isMap
      ? { kind: "map", X: of("X"), Y: of("Y"), Z: of("Z"), W: of("W") || "1", box }
      : { kind: "implicit", F: of("F"), box };
    this.typed = null;
    this.app.history.commit(`Open ${name}`, {
      tab: "surface",
      surface: { ...this.stored, ...own },
    });
    return true;
  }

  /** Writes the surface to a file; returns its name. */
  private async written(): Promise<string> {
    this.keep();
    const name = this.app.history.fresh("surface", "json");
    await backend.put(name, this.document());
    return name;
  }

  /** Triangulates a map or meshes a solid; a file is saved if an ending is given. */
  private async check(saved?: string): Promise<void> {
    const { box } = this.state;
    const isMap = this.state.kind === "map";
    await this.app.work(isMap ? "Triangulating" : "Meshing", async (run) => {
      const file = await this.written();
      const output = this.app.history.fresh("surface", saved ?? "ply");
      const request: Request = isMap
        ? { verb: "triangulate", map: file, output: [output] }
        : { verb: "mesh", model: file, surface_only: true, output: [output] };
      if (box.trim()) request.box = isMap ? box.trim() : cube(box.trim());
      const answer = await run(request);
      const { document } = answer;
      this.resultOf = this.document() + box;
      this.result.replaceChildren(
        ...(isMap
          ? [claims(document), ...warnings(answer.warnings)]
          : [certificate(document, answer)]),
        figures(measures(document)),
      );
      if (saved) backend.download(output);
    });
  }

  private async patch(): Promise<void> {
    await this.app.work("Seeking a patch", async (run) => {
      const file = await this.written();
      const output = this.app.history.fresh("patch", "json");
      const answer = await run({ verb: "parameterize", model: file, output: [output] });
      this.resultOf = this.document() + this.state.box;
      const patches: Document[] = answer.document.patches ?? [answer.document];
      this.result.replaceChildren(
        h(
          "div",
          { class: answer.exit === 0 ? "verdict is-good" : "verdict is-doubtful" },
          h(
            "strong",
            {},
            `${patches.length} rational ${patches.length === 1 ? "patch" : "patches"}`,
          ),
          ...warnings(answer.warnings),
        ),
      );
      backend.download(output);
    });
  }

  private async page(): Promise<void> {
    await this.app.work("Making a page", async (run) => {
      const file = await this.written();
      const output = this.app.history.fresh("surface", "html");
      const request: Request = { verb: "view", file: [file], output };
      if (this.state.box.trim()) request.box = this.state.box.trim();
      await run(request);
      backend.download(output);
    });
  }
}

/** Returns the box of half a width as corners; what is no positive number stays, and is refused. */
function cube(half: string): string {
  const opposite = `-${half}`;
  return Number(half) > 0 ? [opposite, opposite, opposite, half, half, half].join() : half;
}

/** Creates the list of the claims of a rational surface. */
function claims(document: Document): HTMLElement {
  const rows = (document.claims as Document[]).map(({ claim, basis, holds, text }) =>
    h(
      "li",
      { class: holds ? "holds" : "open" },
      h("b", {}, `${holds ? "proved" : "open"}: `),
      foreign(text ?? claim),
      h("small", {}, ` (${basis})`),
    ),
  );
  return h(
    "div",
    { class: document.certified ? "verdict is-good" : "verdict is-doubtful" },
    h("strong", {}, document.certified ? "The certificate holds." : "Not certified."),
    h(
      "details",
      {},
      h("summary", {}, `${rows.length} claims`),
      h("ul", { class: "claims" }, ...rows),
    ),
  );
}
