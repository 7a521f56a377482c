// Faces of a scan: their list, and corrections by hand.

import { partColor, css } from "../colors";
import { brief, h } from "../dom";
import type { PointsLayer } from "../points";
import type { Document } from "./backend";
import type { Entry } from "./menu";
import { button, choice, two, withSd } from "./parts";

export const KINDS = ["plane", "cylinder", "cone", "sphere", "torus"];
const RELATIONS = [
  "parallel",
  "perpendicular",
  "coaxial",
  "coplanar",
  "concentric",
  "equal_radius",
  "tangent",
];

/** Relation of two faces that a person stated. */
export interface Relation {
  kind: string;
  faces: number[];
}

/** Reads relations as the state of a scan has them. */
export const relationsOf = (text: string): Relation[] =>
  text
    .split(" ")
    .filter((each) => each)
    .map((each) => {
      const [kind, faces = ""] = each.split("=");
      return { kind, faces: faces.split(",").map(Number) };
    });

/** Names a kind of relation. */
const words = (kind: string): string => kind.replace("_", " ");

/** Writes a relation as the command line takes it. */
export const relationText = ({ kind, faces }: Relation): string => `${kind}=${faces.join(",")}`;

/** Correction of the faces: new numbers of faces for points, kinds that are chosen, and relations. */
export interface Correction {
  label: string;
  /** Returns the face of a point, -1 for none, from the number that it has and its index. */
  face: (old: number, i: number) => number;
  kinds: Record<string, string>;
  relations: Relation[];
}

/** Degrees of an angle in radians. */
const DEGREES = 180 / Math.PI;

/** Describes the sizes of a face. */
export function sizes({ type, parameters, sd }: Document): string {
  const with_ = (key: string, factor = 1): string =>
    withSd(factor * parameters[key], factor * (sd?.[key] ?? 0));
  switch (type) {
    case "sphere":
    case "cylinder":
      return `radius ${with_("radius")}`;
    case "cone":
      return `half angle ${with_("half_angle", DEGREES)}°`;
    case "torus":
      return `radii ${with_("major_radius")} and ${with_("minor_radius")}`;
    default:
      return `normal ${parameters.normal.map((v: number) => brief(Number(v.toFixed(4)))).join(", ")}`;
  }
}

/** Describes a hole, a boss, a slot or a pocket. */
export function featureText(feature: Document): string {
  const { kind, depth, radius, width, length, through, widenings = [] } = feature;
  const short = (v: number): string => brief(Number(v.toPrecision(4)));
  const size =
    radius === undefined ? `${short(width)} by ${short(length)}` : `radius ${short(radius)}`;
  const reach = `${kind === "boss" ? "height" : through ? "through" : "depth"} ${short(depth)}`;
  const wider = widenings.map(
    (w: Document) => `${w.kind} radius ${short(w.radius)} depth ${short(w.depth)}`,
  );
  return [size, reach, ...wider].join(", ");
}

/** Lists numbers of faces in ascending order. */
const listed = (faces: Set<number>): string => [...faces].sort((a, b) => a - b).join(", ");

export class Faces {
  readonly element = h("div", { class: "faces" });
  private readonly list = h("ul", { class: "list", "aria-label": "Faces" });
  private readonly features = h("ul", { class: "list", "aria-label": "Features" });
  private readonly count = h("p", { class: "quiet", role: "status" });
  private readonly merge: HTMLButtonElement;
  private readonly remove: HTMLButtonElement;
  private readonly kind: HTMLSelectElement;
  private readonly relation: HTMLSelectElement;
  private readonly related = h("ul", { class: "list", "aria-label": "Relations" });
  private readonly box: HTMLButtonElement;
  private readonly rest: HTMLButtonElement;
  private readonly radius = h("input", { type: "number", min: "0", step: "any" });
  private readonly near: HTMLButtonElement;
  private readonly asNew: HTMLButtonElement;
  private readonly asNone: HTMLButtonElement;
  private readonly into: HTMLSelectElement;
  private readonly crop: HTMLButtonElement;
  private readonly cut: HTMLButtonElement;
  private readonly tools: HTMLElement;
  private readonly chosen = new Set<number>();
  private document: Document = null;
  private layer: PointsLayer | null = null;
  private selection: Uint8Array<ArrayBuffer> | null = null;
  /** Number of selected points. */
  private selected = 0;
  /** True if they were selected of the faces that were chosen then. */
  private isOfChosen = false;
  private kinds: Record<string, string> = {};
  private relations: Relation[] = [];
  private isBoxing = false;
  private picked: ArrayLike<number> | null = null;

  /** Callbacks: a correction, points to be kept as a scan of their own, and a new picture. */
  onCorrect: (correction: Correction) => void = () => {};
  onCrop: (isKept: (i: number) => boolean, label: string) => void = () => {};
  onFocus: (faces: Set<number>) => void = () => {};
  onBoxing: (is: boolean) => void = () => {};
  /** Callback for a menu of a face in the list. */
  onMenu: (event: MouseEvent, face: number) => void = () => {};

  constructor() {
    this.merge = button("Merge", () => this.mergeChosen());
    this.merge.title = "Make one face of the chosen ones";
    this.remove = button("Delete", () => this.removeChosen());
    this.remove.title = "Leave the points of the chosen faces without a face";
    this.kind = choice(
      "Kind of the chosen faces",
      [["", "Kind…"], ...KINDS.map((k): [string, string] => [k, k])],
      (kind) => kind && this.setKind(kind),
    );
    this.relation = choice(
      "Relation of the two chosen faces",
      [["", "Relation…"], ...RELATIONS.map((r): [string, string] => [r, words(r)])],
      (kind) => kind && this.relate(kind),
    );
    this.box = button("Select points by a box", () => this.setBoxing(!this.isBoxing));
    this.box.setAttribute("aria-pressed", "false");
    this.rest = button("Select points without a face", () =>
      this.select((i) => this.layer?.entities?.[i] === 0),
    );
    this.radius.setAttribute("aria-label", "Radius around the picked point");
    this.radius.placeholder = "radius";
    this.near = button("Select around the picked point", () => this.selectNear());
    this.asNew = button("Make a face", () => this.move("New face", this.fresh()));
    this.asNone = button("Take out of faces", () => this.move("Points out of faces", -1));
    this.into = choice("Move the points into a face", [], (value) => {
      if (value) this.move(`Points into face ${value}`, Number(value));
    });
    this.crop = button("Keep these alone", () => this.cropTo(true));
    this.cut = button("Remove these", () => this.cropTo(false));
    this.tools = h(
      "div",
      { class: "tools" },
      this.asNew,
      this.into,
      this.asNone,
      this.crop,
      this.cut,
    );
    this.element.append(
      this.list,
      this.features,
      h("div", { class: "tools" }, this.merge, this.remove, this.kind, this.relation),
      this.related,
      h("div", { class: "tools" }, this.box, this.rest),
      h("div", { class: "tools" }, this.radius, this.near),
      this.count,
      this.tools,
    );
  }

  /** Shows the faces of a document; null for none. */
  show(document: Document, kinds: Record<string, string>, relations: string): void {
    this.kinds = kinds;
    this.relations = relationsOf(relations);
    this.related.hidden = !this.relations.length;
    this.related.replaceChildren(...this.relations.map((relation) => this.relationRow(relation)));
    if (this.document !== document) {
      this.document = document;
      this.chosen.clear();
      const entities: Document[] = document?.entities ?? [];
      this.list.replaceChildren(...entities.map((entity) => this.row(entity)));
      const features: Document[] = document?.features ?? [];
      this.features.replaceChildren(...features.map((feature) => this.featureRow(feature)));
      this.features.hidden = !features.length;
    }
    this.refresh();
  }

  private row(entity: Document): HTMLElement {
    const { id, type, n_points, rms } = entity;
    const chip = h("i");
    chip.style.background = css(partColor(id));
    const box = h("input", {
      type: "checkbox",
      "aria-label": `Face ${id}, ${type}`,
      change: () => {
        if (box.checked) this.chosen.add(id);
        else this.chosen.delete(id);
        this.onFocus(this.chosen);
        this.refresh();
      },
    });
    return h(
      "li",
      {
        "data-face": String(id),
        contextmenu: (e) => {
          e.preventDefault();
          this.onMenu(e as MouseEvent, id);
        },
        mouseenter: () => this.onFocus(new Set([...this.chosen, id])),
        mouseleave: () => this.onFocus(this.chosen),
      },
      h(
        "label",
        { title: `${n_points} points, rms ${brief(two(rms))}` },
        box,
        chip,
        h("b", {}, `${id} ${type}`),
        h("span", {}, sizes(entity)),
      ),
    );
  }

  private featureRow(feature: Document): HTMLElement {
    const faces: Document[] = this.document.faces;
    const own = new Set<number>(feature.faces.map((face: number) => faces[face].entity));
    return h(
      "li",
      {
        mouseenter: () => this.onFocus(own),
        mouseleave: () => this.onFocus(this.chosen),
        title: `Faces ${listed(own)}`,
      },
      h("b", {}, feature.kind),
      h("span", {}, featureText(feature)),
    );
  }

  private relationRow(relation: Relation): HTMLElement {
    const { kind, faces } = relation;
    const text = `${faces.join(" and ")}: ${words(kind)}`;
    const drop = button("Remove", () =>
      this.change(
        `No relation of faces ${faces.join(" and ")}`,
        this.relations.filter((r) => r !== relation),
      ),
    );
    drop.setAttribute("aria-label", `Remove the relation ${text}`);
    return h("li", {}, h("span", {}, text), drop);
  }

  private relate(kind: string): void {
    const faces = [...this.chosen].sort((a, b) => a - b);
    const label = `Faces ${faces.join(" and ")}: ${words(kind)}`;
    const isNew = !this.relations.some((r) => relationText(r) === relationText({ kind, faces }));
    if (isNew) this.change(label, [...this.relations, { kind, faces }]);
    this.relation.value = "";
  }

  /** Corrects the relations alone. */
  private change(label: string, relations: Relation[]): void {
    this.onCorrect({ label, face: (old) => old, kinds: this.kinds, relations });
  }

  /** Takes the layer of points that is drawn. */
  setLayer(layer: PointsLayer | null): void {
    if (layer === this.layer) return;
    this.layer = layer;
    this.picked = null;
    this.select(null);
    this.onFocus(this.chosen);
  }

  /** Returns the entries of a menu at a point. They act on the chosen faces, or on the face of the
   *  point alone if it is not one of them. */
  menu(entity: number | undefined, point: ArrayLike<number> | null): Entry[] {
    if (point) this.picked = point;
    const { selection } = this;
    const isOther = entity !== undefined && !this.chosen.has(entity);
    const target = isOther ? new Set([entity]) : new Set(this.chosen);
    const faces = target.size > 1 ? `faces ${listed(target)}` : `face ${listed(target)}`;
    const entry = (name: string, act: () => void): Entry => ({
      name: `${name} ${faces}`,
      act: () => {
        if (isOther) for (const face of [...this.chosen, entity]) this.toggle(face);
        act();
      },
    });
    const ofFaces: Entry[] = target.size
      ? [
          ...(target.size > 1 ? [entry("Merge", () => this.mergeChosen())] : []),
          entry("Delete", () => this.removeChosen()),
          ...KINDS.map((kind) => entry(`Fit a ${kind} to`, () => this.setKind(kind))),
          null,
        ]
      : [];
    const ofPoints: Entry[] = selection
      ? this.pointTools().map((each) => ({
          name: `${each.textContent}`,
          act: () => each.click(),
        }))
      : [];
    const around = {
      name: "Select around this point",
      act: () => (this.radius.value ? this.selectNear() : this.radius.focus()),
    };
    return [...ofFaces, ...(point ? [around] : []), ...ofPoints, null];
  }

  /** Returns the buttons for selected points. */
  private pointTools(): HTMLButtonElement[] {
    const all = [this.asNew, this.asNone, this.crop, this.cut];
    return all.filter((each) => !each.hidden);
  }

  /** Chooses a face, or leaves it. */
  private toggle(face: number): void {
    this.list.querySelector<HTMLInputElement>(`[data-face="${face}"] input`)?.click();
  }

  /** Chooses the face of a picked point, and keeps the point. */
  pick(entity: number | undefined, point: ArrayLike<number> | null): void {
    this.picked = point;
    if (entity !== undefined && !this.isBoxing) {
      const box = this.list.querySelector<HTMLInputElement>(`[data-face="${entity}"] input`);
      box?.click();
      box?.scrollIntoView({ block: "nearest" });
    }
    this.refresh();
  }

  /** Selects points: those of the chosen faces alone, if there are any. */
  select(isIn: ((i: number) => boolean) | null): void {
    const { layer } = this;
    this.selection = null;
    this.selected = 0;
    this.isOfChosen = this.chosen.size > 0;
    if (layer && isIn) {
      const { entities } = layer;
      const selection = new Uint8Array(layer.count);
      let n = 0;
      for (let i = 0; i < layer.count; i++) {
        const isShown = !this.chosen.size || (entities && this.chosen.has(entities[i] - 1));
        if (isShown && isIn(i)) n += selection[i] = 1;
      }
      if (n) this.selection = selection;
      this.selected = n;
    }
    layer?.select(this.selection);
    this.refresh();
    this.onFocus(this.chosen);
  }

  private selectNear(): void {
    const { layer, picked } = this;
    const radius = Number(this.radius.value);
    if (!layer || !picked || !(radius > 0)) return;
    this.select(layer.within(picked, radius));
  }

  setBoxing(is: boolean): void {
    this.isBoxing = is;
    this.box.setAttribute("aria-pressed", String(is));
    this.onBoxing(is);
  }

  /** Ends the selection of points; returns false if there is none. */
  leave(): boolean {
    if (!this.isBoxing && !this.selection) return false;
    this.setBoxing(false);
    this.select(null);
    return true;
  }

  /** Returns a number that no face has. */
  private fresh(): number {
    const entities: Document[] = this.document?.entities ?? [];
    return entities.reduce((most, { id }) => Math.max(most, id + 1), 0);
  }

  private mergeChosen(): void {
    const first = Math.min(...this.chosen);
    const chosen = new Set(this.chosen);
    const kinds = { ...this.kinds };
    for (const face of chosen) if (face !== first) delete kinds[face];
    const face = (old: number): number => (chosen.has(old) ? first : old);
    const relations = this.relations
      .map((r) => ({ ...r, faces: r.faces.map(face) }))
      .filter(({ faces: [a, b] }) => a !== b);
    this.onCorrect({ label: `Merge faces ${listed(chosen)}`, face, kinds, relations });
  }

  private removeChosen(): void {
    const chosen = new Set(this.chosen);
    const kinds = { ...this.kinds };
    for (const face of chosen) delete kinds[face];
    this.onCorrect({
      label: `Delete faces ${listed(chosen)}`,
      face: (old) => (chosen.has(old) ? -1 : old),
      kinds,
      relations: this.relations,
    });
  }

  private setKind(kind: string): void {
    const kinds = { ...this.kinds };
    for (const face of this.chosen) kinds[face] = kind;
    this.onCorrect({
      label: `Faces ${listed(this.chosen)}: ${kind}`,
      face: (old) => old,
      kinds,
      relations: this.relations,
    });
    this.kind.value = "";
  }

  private move(label: string, to: number): void {
    const selection = this.selection;
    if (!selection) return;
    const face = (old: number, i: number): number => (selection[i] ? to : old);
    this.onCorrect({ label, face, kinds: this.kinds, relations: this.relations });
  }

  private cropTo(isKept: boolean): void {
    const selection = this.selection;
    if (!selection) return;
    this.onCrop(
      (i) => (selection[i] === 1) === isKept,
      isKept ? "Crop to the selection" : "Remove the selection",
    );
  }

  private refresh(): void {
    const n = this.selected;
    const has = this.document !== null;
    this.list.hidden = !has;
    this.merge.disabled = this.chosen.size < 2;
    this.remove.disabled = this.chosen.size === 0;
    this.kind.disabled = this.chosen.size === 0;
    this.relation.disabled = this.chosen.size !== 2;
    this.relation.title = this.chosen.size === 2 ? "" : "Choose two faces first";
    this.near.disabled = this.picked === null;
    this.near.title = this.picked ? "" : "Click a point first";
    this.count.textContent = n
      ? `${n.toLocaleString("en")} points selected${this.isOfChosen ? " of the chosen faces" : ""}`
      : "";
    this.tools.hidden = n === 0;
    for (const each of [this.asNew, this.asNone, this.into, this.rest]) each.hidden = !has;
    const entities: Document[] = this.document?.entities ?? [];
    this.into.replaceChildren(
      h("option", { value: "" }, "Move into face…"),
      ...entities.map(({ id, type }) => h("option", { value: String(id) }, `${id} ${type}`)),
    );
  }
}
