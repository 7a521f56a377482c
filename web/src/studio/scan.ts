// Scan to model: faces, corrections, the fit with its verdict, files for CAD.

import { brief, foreign, h } from "../dom";
import type { Hit } from "../layer";
import { PointsLayer } from "../points";
import type { Viewer } from "../viewer";
import type { App, Space } from "./app";
import { endingOf, MESHES, POINTS } from "./endings";
import type { Answer, Document, Request, SceneRequest } from "./backend";
import * as backend from "./backend";
import { boxSelect } from "./boxselect";
import { type Correction, Faces, relationText, relationsOf } from "./faces";
import type { FitState, ScanState } from "./history";
import { EMPTY } from "./history";
import { type Entry, openMenu } from "./menu";
import { button, choice, field, figures, section, setOptions, warnings, withSd } from "./parts";
import { Ply } from "./ply";
import { cross, norm, sub, unit, type V3 } from "../vector";

const UNITS: [string, string][] = [
  ["", "guessed"],
  ["mm", "mm"],
  ["cm", "cm"],
  ["m", "m"],
  ["in", "inches"],
  ["ft", "feet"],
];
const EXAMPLES: [string, string][] = [
  ["", "Examples…"],
  ["flange", "Mesh of a flange"],
  ["testpart", "Mesh of a block with holes"],
  ["cup", "Scan of a cup, with its template"],
];

/** Files of a fit by their endings, with their words. */
const EXPORTS: [string, string, string][] = [
  ["step", "STEP", "Solid of exact faces, for CAD"],
  ["hf", "HyperFun", "Program with the fitted dimensions"],
  ["py", "build123d", "Python program with the fitted dimensions"],
  ["scad", "OpenSCAD", "OpenSCAD program with the fitted dimensions"],
  ["stl", "STL", "Triangles of the model"],
  ["3mf", "3MF", "Triangles of the model, with its unit"],
];

/** Distance from the origin, in sizes of the scan, from which its box is given to pictures, and the
 *  margin of this box. */
const FAR = 100;
const MARGIN = 0.2;

type Look = "points" | "faces" | "deviation" | "solid";

export class ScanSpace implements Space {
  readonly title = "Scan";
  readonly element = h("div", { class: "space" });
  private readonly about = h("div", { role: "status" });
  private readonly unit: HTMLSelectElement;
  private readonly look: HTMLSelectElement;
  private readonly make: HTMLButtonElement;
  private readonly find: HTMLButtonElement;
  private readonly propose: HTMLButtonElement;
  private readonly align: HTMLButtonElement;
  /** Points that are picked for a frame; null if none is being picked. */
  private picks: V3[] | null = null;
  private readonly example: HTMLSelectElement;
  private readonly faces = new Faces();
  private readonly facesPart: HTMLElement;
  private readonly result = h("div", {});
  private readonly resultPart: HTMLElement;
  private readonly dropped = h("div", { class: "tools" });
  private chosenLook: Look | null = null;
  /** Documents by the names of their files. */
  private readonly documents = new Map<string, Document>();
  private readonly loading = new Set<string>();
  private shownResult = "";

  constructor(private readonly app: App) {
    this.unit = choice("Unit", UNITS, (unit) => this.change("Unit", { unit, fit: null }));
    this.look = choice("Show", [], (look) => {
      this.chosenLook = look as Look;
      app.refresh();
    });
    this.make = app.whileIdle(button("Make a CAD model", () => void this.recover(), "primary"));
    this.make.title = "Recognize, fit, and make a solid (Ctrl Enter)";
    this.find = app.whileIdle(button("Recognize faces", () => void this.recognize()));
    this.propose = app.whileIdle(button("Propose a program", () => void this.proposeProgram()));
    this.propose.title = "Open a template made of the faces in the tab Program";
    this.align = app.whileIdle(button("Align to axes", () => this.beginAlignment()));
    this.align.title = "Pick the origin, a point along x, and a point in the plane of x and y";
    this.example = choice(
      "Examples",
      EXAMPLES.filter(([name]) => name !== "cup" || backend.example() !== null),
      (name) => void this.openExample(name),
    );
    this.facesPart = section("Faces", this.faces.element);
    this.resultPart = section("Model", this.result);
    this.dropped.append(this.example);
    this.element.append(
      section(
        "Scan",
        this.about,
        this.dropped,
        h("div", { class: "pair" }, field("Unit", this.unit), field("Show", this.look)),
        h("div", { class: "tools" }, this.make, this.find, this.propose, this.align),
      ),
      this.resultPart,
      this.facesPart,
    );
    this.faces.onCorrect = (correction) => void this.correct(correction);
    this.faces.onCrop = (isKept, label) => void this.rewrite(label, (ply) => ply.filtered(isKept));
    this.faces.onFocus = (faces) => {
      const layer = this.pointsLayer();
      if (layer && app.viewer) app.viewer.focus(layer.id, faces);
    };
    const { view } = app.stage;
    const leave = boxSelect(view, (x, y) => {
      const layer = this.pointsLayer();
      if (layer) this.faces.select(layer.seenIn(view.ray(0, 0), x, y));
    });
    this.faces.onBoxing = leave;
    this.faces.onMenu = (event, face) =>
      openMenu(app.root, "Faces", [event.clientX, event.clientY], this.faces.menu(face, null));
  }

  menu(layer: string, hit: Hit): Entry[] {
    const own = this.pointsLayer();
    if (this.facesPart.hidden || !own || own.id !== layer) return [];
    return this.faces.menu(hit.entity, hit.point);
  }

  private get state(): ScanState {
    return this.app.history.state.scan;
  }

  private change(label: string, change: Partial<ScanState>): void {
    this.app.history.commit(label, { scan: { ...this.state, ...change } });
  }

  /** Adds the result of work on a scan, which another window may have replaced meanwhile. */
  private conclude(label: string, scan: string, change: Partial<ScanState>): void {
    if (this.state.file !== scan)
      throw new Error(`${label}: another scan is open now, and the result is dropped.`);
    this.change(label, change);
  }

  private pointsLayer(): PointsLayer | null {
    const layers = this.app.viewer?.layers ?? [];
    return (
      layers.find((l): l is PointsLayer => l instanceof PointsLayer && l.entities !== null) ??
      layers.find((l): l is PointsLayer => l instanceof PointsLayer) ??
      null
    );
  }

  /** Returns the document of a file; null until it is there. */
  private document(name: string): Document {
    if (!name) return null;
    if (!this.documents.has(name) && !this.loading.has(name)) {
      this.loading.add(name);
      backend.json(name).then(
        (document) => {
          this.documents.set(name, document);
          this.app.refresh();
        },
        (error) => this.app.fail(error),
      );
    }
    return this.documents.get(name) ?? null;
  }

  private get looks(): [Look, string][] {
    const { file, labels, fit } = this.state;
    const all: [boolean, Look, string][] = [
      [fit !== null, "deviation", "model and deviations"],
      [fit?.files.step !== undefined, "solid", "solid"],
      [labels !== "", "faces", "points by face"],
      [file !== "", "points", "points"],
    ];
    return all.filter(([is]) => is).map(([, look, text]) => [look, text]);
  }
  private get shownLook(): Look | null {
    const { looks } = this;
    return looks.find(([look]) => look === this.chosenLook)?.[0] ?? looks[0]?.[0] ?? null;
  }

  leave(): boolean {
    this.picks = null;
    return this.faces.leave();
  }

  picture(): { request: SceneRequest; subject: string } | null {
    const { file, labels, fit } = this.state;
    const look = this.shownLook;
    if (!look) return null;
    const files = {
      points: [file],
      faces: [labels],
      deviation: fit ? [fit.files.hf, fit.files.ply] : [],
      solid: [fit?.files.step ?? ""],
    }[look];
    const request: SceneRequest = { file: files };
    const box = look === "deviation" ? farBox(this.document(aboutOf(file))) : null;
    if (box) request.box = box;
    return { request, subject: file };
  }

  shown(_: Viewer): void {
    const canSelect = this.shownLook === "faces" || this.shownLook === "points";
    this.faces.setLayer(canSelect ? this.pointsLayer() : null);
  }

  refresh(): void {
    const { state } = this;
    const has = state.file !== "";
    const inspected = this.document(aboutOf(state.file));
    this.about.replaceChildren(
      ...(has
        ? [h("p", {}, foreign(state.file)), ...this.told(inspected)]
        : [h("p", {}, "Drop a scan or a mesh anywhere, open one, or begin with the example.")]),
    );
    this.dropped.hidden = has;
    this.unit.value = state.unit;
    this.unit.disabled = !has;
    setOptions(this.look, this.looks, this.shownLook ?? "");
    this.look.disabled = this.looks.length < 2;
    const isIdle = !this.app.isBusy;
    for (const each of [this.make, this.find, this.propose, this.align])
      each.disabled = !has || !isIdle;
    this.example.disabled = !isIdle;
    this.find.textContent = state.labels ? "Recognize again" : "Recognize faces";
    this.make.textContent = state.fit ? "Make the CAD model again" : "Make a CAD model";
    const canSelect = this.shownLook === "faces" || this.shownLook === "points";
    this.facesPart.hidden = !has || !canSelect;
    this.faces.show(this.document(state.faces), state.kinds, state.relations);
    const { picked, layers } = this.app.viewer ?? { picked: null, layers: [] };
    if (picked !== this.lastPick && canSelect) {
      this.lastPick = picked;
      const own = layers.some((l) => l === this.pointsLayer() && l.id === picked?.layer);
      if (picked && own && this.picks) this.pickForFrame(picked.point);
      else if (picked && own) this.faces.pick(picked.entity, picked.point);
    }
    this.resultPart.hidden = state.fit === null;
    if (state.fit) this.tell(state.fit, this.document(state.fit.document));
  }
  private lastPick: unknown = null;

  /** Describes the points of a scan. */
  private told(inspected: Document): Node[] {
    if (!inspected) return [];
    const { points, bounds, unit } = inspected;
    if (!bounds) return [h("p", { class: "quiet" }, "There are no points.")];
    const size = bounds[1].map((v: number, k: number) => brief(three(v - bounds[0][k])));
    const isGuess = unit && !unit.stated && !this.state.unit;
    const name = this.state.unit || unit?.name || "";
    return [
      h(
        "p",
        { class: "quiet" },
        `${points.toLocaleString("en")} points, ${size.join(" × ")} ${name}`,
      ),
      ...(isGuess ? [h("p", { class: "quiet" }, `Unit: ${unit.reason}.`)] : []),
    ];
  }

  async open(name: string): Promise<boolean> {
    const ending = endingOf(name);
    if (![...POINTS, ...MESHES].includes(ending)) return false;
    await this.app.work(`Reading ${name}`, async (run) => {
      const { document } = await run({ verb: "inspect", file: name });
      await this.keep(aboutOf(name), document);
      this.chosenLook = null;
      this.app.history.commit(`Open ${name}`, {
        tab: "scan",
        scan: { ...EMPTY.scan, file: name },
      });
    });
    return true;
  }

  /** Stores a document and keeps it at hand. */
  private async keep(name: string, document: Document): Promise<void> {
    await backend.put(name, JSON.stringify(document));
    this.documents.set(name, document);
  }

  private async openExample(name: string): Promise<void> {
    this.example.value = "";
    const { history } = this.app;
    if (name === "cup") {
      const file = history.fresh("cup", "ply");
      await backend.put(file, await backend.example()!());
      // A cup is no body of planes and cylinders alone: its template comes with it.
      if (await this.open(file)) this.change("Template cup", { template: "cup" });
    } else if (name) {
      const file = history.fresh(name, "stl");
      const isMade = await this.app.work("Making the example", async (run) => {
        await run({ verb: "mesh", model: name, surface_only: true, output: [file] });
      });
      if (isMade) await this.open(file);
    }
  }

  /** Arguments that say which faces there are. */
  private given(): Partial<Request> {
    const { labels, isCorrected, kinds, relations } = this.state;
    if (!isCorrected) return {};
    return {
      labels,
      kind: Object.entries(kinds).map(([face, kind]) => `${face}=${kind}`),
      relate: relationsOf(relations).map(relationText),
    };
  }

  private async recognize(): Promise<void> {
    const { history } = this.app;
    const stem = stemOf(this.state.file);
    const labels = history.fresh(`${stem}-faces`, "ply");
    const scan = this.state.file;
    await this.app.work("Recognizing faces", async (run) => {
      const { document } = await run({
        verb: "recognize",
        scan: this.state.file,
        output: [labels],
      });
      const faces = labels.replace(/ply$/, "json");
      await this.keep(faces, document);
      this.chosenLook = "faces";
      this.conclude("Recognize faces", scan, {
        labels,
        faces,
        isCorrected: false,
        kinds: {},
        relations: "",
        template: "",
        fit: null,
      });
      if (!document.entities.length) this.app.say("No face was found in these points.");
    });
  }

  /** Gives points other faces and faces other kinds, and fits them again. */
  private async correct({ label, face, kinds, relations }: Correction): Promise<void> {
    const { history } = this.app;
    const stem = stemOf(this.state.file);
    const given = history.fresh(`${stem}-given`, "ply");
    const labels = history.fresh(`${stem}-faces`, "ply");
    const scan = this.state.file;
    await this.app.work(label, async (run) => {
      const ply = await this.shownPoints(this.state.labels);
      const old = ply.column("entity");
      const now = old.map((v, i) => face(v, i));
      await backend.put(
        given,
        ply.withColumn("entity", (i) => now[i]),
      );
      const left = new Set(now);
      const kept = Object.entries(kinds).filter(([n]) => left.has(Number(n)));
      const related = relations.filter((r) => r.faces.every((n) => left.has(n)));
      const { document, warnings } = await run({
        verb: "recognize",
        scan: this.state.file,
        labels: given,
        kind: kept.map(([n, kind]) => `${n}=${kind}`),
        relate: related.map(relationText),
        output: [labels],
      });
      const faces = labels.replace(/ply$/, "json");
      await this.keep(faces, document);
      // The faces have new numbers, in the order of the old ones.
      const moved = new Map<number, number>(
        document.entities.map((e: Document) => [e.label ?? e.id, e.id]),
      );
      this.conclude(label, scan, {
        labels,
        faces,
        isCorrected: true,
        kinds: Object.fromEntries(
          kept.map(([n, kind]): [string, string] => [String(moved.get(Number(n)) ?? n), kind]),
        ),
        relations: related
          .map((r) => relationText({ ...r, faces: r.faces.map((n) => moved.get(n) ?? n) }))
          .join(" "),
        template: "",
        fit: null,
      });
      if (warnings.length) this.app.say(warnings.join(" "));
    });
  }

  /** Reads the points of a file, which must be those that are drawn. */
  private async shownPoints(name: string): Promise<Ply> {
    const ply = new Ply(await backend.get(name));
    if (ply.count !== this.pointsLayer()?.count)
      throw new Error("The points that are shown are not all that the file holds.");
    return ply;
  }

  /** Makes a new scan of the points. */
  private async rewrite(label: string, change: (ply: Ply) => ArrayBuffer): Promise<void> {
    const { history } = this.app;
    const stem = stemOf(this.state.file);
    const target = history.fresh(stem, "ply");
    await this.app.work(label, async (run) => {
      let source = this.shownLook === "faces" ? this.state.labels : this.state.file;
      if (endingOf(source) !== "ply" || source === this.state.file) {
        source = history.fresh(`${stem}-points`, "ply");
        await run({ verb: "convert", file: this.state.file, output: source });
      }
      await backend.put(target, change(await this.shownPoints(source)));
      const { document } = await run({ verb: "inspect", file: target });
      await this.keep(aboutOf(target), document);
      this.chosenLook = "points";
      history.commit(label, {
        scan: { ...EMPTY.scan, file: target, unit: this.state.unit },
      });
    });
  }

  private beginAlignment(): void {
    this.picks = [];
    if (this.shownLook !== "faces") this.chosenLook = "points";
    this.app.say("Click the new origin, then a point along x, then one in the plane of x and y.");
    this.app.refresh();
  }

  private pickForFrame(point: V3): void {
    const picks = this.picks!;
    picks.push(point);
    if (picks.length < 3) return;
    this.picks = null;
    const [origin, onX, inXy] = picks;
    const x = sub(onX, origin);
    const z = cross(x, sub(inXy, origin));
    if (!(norm(z) > 1e-9 * norm(x) ** 2)) {
      this.app.fail(new Error("The three points lie on one line. Pick others."));
      return;
    }
    const axes: [V3, V3, V3] = [unit(x), unit(cross(z, x)), unit(z)];
    void this.rewrite("Align to axes", (ply) => ply.inFrame(origin, axes));
  }

  /** Opens a program made of the faces in the tab of programs. */
  private async proposeProgram(): Promise<void> {
    const { history } = this.app;
    const name = history.fresh(stemOf(this.state.file), "hf");
    await this.app.work("Proposing a program", async (run) => {
      const request: Request = { verb: "recognize", scan: this.state.file, output: [name] };
      await run({ ...request, ...this.given() } as Request);
      const text = await backend.text(name);
      history.commit("Propose a program", { tab: "program", program: { name, text } });
    });
  }

  /** Fits a model, and makes a solid of it. */
  private async recover(): Promise<void> {
    const { history } = this.app;
    const { file, unit, template, fixed } = this.state;
    const stem = stemOf(file);
    const names = ["hf", "ply", "html", "step", "py", "scad"].map((ending) => [
      ending,
      history.fresh(`${stem}-model`, ending),
    ]);
    const files: Record<string, string> = Object.fromEntries(names);
    const request: Request = { verb: "recover", scan: file, output: Object.values(files) };
    if (unit) request.units = unit;
    if (template) request.template = template;
    else Object.assign(request, this.given());
    if (Object.keys(fixed).length)
      request.fix = Object.entries(fixed).map(([name, value]) => `${name}=${value}`);
    await this.app.work("Making a CAD model", async (run) => {
      const answer = await run(request);
      const name = files.hf.replace(/hf$/, "json");
      await this.keep(name, { ...answer.document, told: answer.warnings, exit: answer.exit });
      const written: string[] = answer.document.outputs ?? [];
      const kept = Object.entries(files).filter(([, path]) => written.includes(path));
      this.chosenLook = "deviation";
      this.conclude("Make a CAD model", file, {
        fit: { document: name, files: Object.fromEntries(kept) },
      });
    });
  }

  /** Shows the result of a fit. */
  private tell(fit: FitState, document: Document): void {
    const key = JSON.stringify([fit, this.state.fixed, document !== null, this.app.isBusy]);
    if (key === this.shownResult || !document) return;
    this.shownResult = key;
    const isGood = document.verdict === "accepted" && document.exit === 0;
    const reasons: string[] = (document.reasons ?? []).map(inWords);
    const solid = document.solid;
    const verdict = h(
      "div",
      { class: isGood ? "verdict is-good" : "verdict is-doubtful", role: "status" },
      h(
        "strong",
        {},
        isGood ? "The model explains the scan." : `The model is ${document.verdict}.`,
      ),
      ...(reasons.length ? [h("ul", {}, ...reasons.map((r) => h("li", {}, r)))] : []),
      ...(solid ? [h("p", {}, solidWords(solid))] : []),
      ...(document.error ? [h("p", {}, inWords(document.error))] : []),
      ...warnings(document.told ?? []),
    );
    const { volume, area } = solid ?? {};
    const unit = document.units ?? "";
    this.result.replaceChildren(
      verdict,
      this.dimensions(document, unit),
      figures([
        ["rms of the points", `${brief(three(document.rms))} ${unit}`],
        ["noise of the scan", `${brief(three(document.noise))} ${unit}`],
        ["points left out", `${document.n_outliers + document.n_left_out} of ${document.n_points}`],
        ...(volume ? [["volume", `${brief(volume)} ${unit}³`] as [string, string]] : []),
        ...(area ? [["area", `${brief(area)} ${unit}²`] as [string, string]] : []),
      ]),
      h("h3", {}, "Save"),
      this.exports(fit),
    );
  }

  /** Creates the table of dimensions, in which values can be held. */
  private dimensions(document: Document, unit: string): HTMLElement {
    const own = document.parameters.filter((p: Document) => !p.name.startsWith("pose_"));
    const rows = own.map((p: Document) => {
      const isFixed = p.name in this.state.fixed;
      const input = h("input", {
        type: "number",
        step: "any",
        value: String(this.state.fixed[p.name] ?? p.nominal ?? Number(p.value.toPrecision(6))),
        "aria-label": `Value at which ${p.name} is held`,
      });
      const toggle = h("input", {
        type: "checkbox",
        "aria-label": `Hold ${p.name}`,
        title: "Hold this dimension at the value, then make the model again",
        change: () => this.fix(p.name, toggle.checked ? Number(input.value) : null),
      });
      toggle.checked = isFixed;
      input.addEventListener("change", () => {
        if (toggle.checked) this.fix(p.name, Number(input.value));
      });
      const text = p.status === "determined" ? withSd(p.value, p.sd) : inWords(p.status);
      return h(
        "tr",
        {},
        h("th", { scope: "row" }, foreign(p.name)),
        h("td", {}, text),
        h("td", {}, toggle, input),
      );
    });
    return h(
      "table",
      { class: "dimensions" },
      h("caption", {}, `Dimensions in ${unit || "units of the scan"}, ± standard deviation`),
      h(
        "thead",
        {},
        h("tr", {}, ...["Name", "Value", "Hold at"].map((name) => h("th", { scope: "col" }, name))),
      ),
      h("tbody", {}, ...rows),
    );
  }

  private fix(name: string, value: number | null): void {
    const fixed = { ...this.state.fixed };
    delete fixed[name];
    if (value !== null && Number.isFinite(value)) fixed[name] = value;
    this.change(value === null ? `Release ${name}` : `Hold ${name}`, { fixed });
  }

  private exports(fit: FitState): HTMLElement {
    const buttons = EXPORTS.map(([ending, name, title]) => {
      const save = button(name, () => void this.save(fit, ending, name));
      save.title = title;
      // Of a doubtful fit there is no solid unless a person asks for one; programs come with the fit.
      const isMissing = ["py", "scad"].includes(ending) && !fit.files[ending];
      save.disabled = this.app.isBusy || isMissing;
      return save;
    });
    const report = button("Report", () => backend.openPage(fit.files.html));
    report.title = "Dimensions, drawing and deviations on a page";
    if (!fit.files.html) report.disabled = true;
    return h("div", { class: "tools" }, ...buttons, report);
  }

  /** Saves a file of the fit, which is made first if there is none. */
  private async save(fit: FitState, ending: string, name: string): Promise<void> {
    let file = fit.files[ending];
    if (!file) {
      const made = this.app.history.fresh(stemOf(fit.files.hf), ending);
      const isMade = await this.app.work(`Making ${name}`, async (run) => {
        const answer = await run(requestOf(fit.files.hf, ending, made));
        this.warn(answer);
        this.change(`Save ${name}`, { fit: { ...fit, files: { ...fit.files, [ending]: made } } });
      });
      if (!isMade) return;
      file = made;
    }
    backend.download(file);
  }

  private warn({ warnings }: Answer): void {
    if (warnings.length) this.app.say(warnings.join(" "));
  }
}

/** Returns the request that makes a file of a fitted program. */
function requestOf(program: string, ending: string, output: string): Request {
  if (ending === "step") return { verb: "brep", model: program, output: [output] };
  return { verb: "mesh", model: program, surface_only: true, output: [output] };
}

/** Returns the box of a scan with a margin, if it is so far from the origin that the model would not
 *  be found there; null otherwise. */
function farBox(inspected: Document): string | null {
  if (!inspected?.bounds) return null;
  const [lo, hi]: [V3, V3] = inspected.bounds;
  const size = norm(sub(hi, lo));
  if (norm(lo) < FAR * size) return null;
  return [...lo.map((v) => v - MARGIN * size), ...hi.map((v) => v + MARGIN * size)].join();
}

/** Returns the name of the document that describes a file. */
const aboutOf = (name: string): string => (name ? `${name}.about.json` : "");
const stemOf = (name: string): string =>
  name.replace(/\.[^.]*$/, "").replace(/(-model|-faces)*(-\d+)?$/, "");
const three = (v: number): number => Number(v.toPrecision(3));

/** Describes the solid of a fit. */
function solidWords(solid: Document): string {
  if (solid.ok === false)
    return solid.error
      ? `No solid: ${inWords(solid.error)}`
      : "No solid was made, as the model is in doubt. The button STEP makes one nevertheless.";
  const faces = solid.faces?.length ?? 0;
  return solid.certificate?.holds
    ? `A solid of ${faces} exact faces, with a certificate.`
    : `A solid of ${faces} faces, not certified.`;
}

/** Returns the words of a document's entry. */
function inWords(entry: Document): string {
  if (typeof entry === "string") return entry.replaceAll("_", " ");
  return entry?.message ?? entry?.text ?? JSON.stringify(entry);
}
