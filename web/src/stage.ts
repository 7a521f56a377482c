// Stage: the panes of space and parameters and the panel, for one scene after the other.

import { Vector3 } from "three";
import { Bearing } from "./bearing";
import { control } from "./controls";
import { h } from "./dom";
import { Domain } from "./domain";
import type { Layer } from "./layer";
import { MapLayer } from "./map";
import { Marks } from "./marks";
import { MeshLayer } from "./mesh";
import { ModelLayer } from "./model";
import { Panel, STANDARD } from "./panel";
import { PatchesLayer } from "./patches";
import { PointsLayer } from "./points";
import type { LayerDoc, MeshDoc, ModelDoc, SceneDoc, Vec3 } from "./scene";
import { around, center, sub, type V3 } from "./vector";
import { View } from "./view";
import { Viewer } from "./viewer";

/** Returns the box of a layer's document, in coordinates of the file. */
function boxOf(doc: LayerDoc): { lo: V3; hi: V3 } {
  if (doc.kind === "model" && "tape" in doc) {
    const moved = (p: Vec3) => p.map((v, k) => v + doc.origin[k]) as V3;
    return { lo: moved(doc.bounds[0]), hi: moved(doc.bounds[1]) };
  }
  if (doc.kind === "patches") return { lo: doc.bounds[0], hi: doc.bounds[1] };
  const { positions } = doc as MeshDoc;
  return { lo: positions.lo, hi: positions.hi };
}

/** Creates a layer. Its coordinates are relative to the centre of its own box: in single precision,
 *  in which they are drawn, this keeps small layers accurate that are far from the origin or from
 *  one another. */
async function layerOf(doc: LayerDoc, id: string, origin: V3): Promise<Layer> {
  if (doc.kind === "model" && "tape" in doc) return new ModelLayer(id, doc as ModelDoc, origin);
  const own = center(boxOf(doc));
  const layer = await arraysOf(doc, id, own);
  layer.object.position.add(new Vector3(...sub(own, origin)));
  return layer;
}

async function arraysOf(doc: LayerDoc, id: string, origin: V3): Promise<Layer> {
  switch (doc.kind) {
    case "points":
      return PointsLayer.of(id, doc, origin);
    case "patches":
      return PatchesLayer.of(id, doc, origin);
    case "map":
      return MapLayer.of(id, doc, origin);
    default:
      return MeshLayer.of(id, doc as MeshDoc, origin);
  }
}

export class Stage {
  readonly space = h("div", {
    "data-pane": "space",
    tabindex: "0",
    role: "application",
    "aria-label":
      "Space. Arrow keys turn the view, plus and minus zoom, Enter picks in the middle.",
  });
  readonly panes = h("div", { class: "panes" }, this.space);
  readonly view = new View(this.space);
  private shown: { viewer: Viewer; panel: Panel; marks: Marks } | null = null;
  /** Callback after a point was picked. */
  onPick: () => void = () => {};
  /** Callback at the right button, with the place in the pane; null picks as other buttons do. */
  onMenu: ((x: number, y: number) => void) | null = null;

  constructor() {
    const { view } = this;
    control(
      view,
      (x, y) => this.shown?.viewer.pickSpace(x, y),
      (key) => this.act(key),
      (x, y) => (this.onMenu ? this.onMenu(x, y) : this.shown?.viewer.pickSpace(x, y)),
    );
    const bearing = new Bearing(view);
    view.onDrawn = () => {
      this.shown?.marks.refresh();
      bearing.refresh();
    };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.repaint());
  }

  /** Draws again after a change of the theme. */
  repaint(): void {
    this.view.want();
    this.shown?.viewer.domain?.draw();
  }

  /** Shows a scene; the camera stays as it is if it is kept. */
  async show(scene: SceneDoc, isCameraKept = false): Promise<[Viewer, Panel]> {
    const origin = scene.layers.length
      ? center(around(scene.layers.map(boxOf)))
      : ([0, 0, 0] as V3);
    const layers = await Promise.all(
      scene.layers.map((doc, i) => layerOf(doc, `layer-${i + 1}`, origin)),
    );
    this.clear();
    this.view.put(layers, origin);
    const viewer = new Viewer(layers, this.view);
    if (viewer.map) this.addDomain(viewer);
    const panel = new Panel(viewer);
    const marks = new Marks(viewer);
    this.shown = { viewer, panel, marks };
    viewer.onChange = () => panel.refresh();
    viewer.onPick = () => {
      panel.showPick();
      marks.refresh();
      this.onPick();
    };
    if (!isCameraKept) this.view.fit(STANDARD[0][1], [0, 0, 1]);
    this.view.want();
    panel.refresh();
    return [viewer, panel];
  }

  /** Removes what is shown. */
  private clear(): void {
    this.shown?.marks.remove();
    for (const pane of this.panes.querySelectorAll("[data-pane=domain]")) pane.remove();
    this.shown = null;
  }

  /** Adds the pane of parameters next to the pane of space. */
  private addDomain(viewer: Viewer): void {
    const pane = h("div", {
      "data-pane": "domain",
      role: "group",
      "aria-label": "The plane of parameters s and t",
    });
    this.panes.append(pane);
    const map = viewer.map!;
    const domain = new Domain(pane, map, (hit) => viewer.mark(hit && map, hit));
    viewer.domain = domain;
    const toggle = h(
      "button",
      {
        type: "button",
        class: "over",
        title: "Only the finite parameters s and t, without those at infinity",
        "aria-pressed": "false",
      },
      "Affine",
    );
    toggle.addEventListener("click", () => {
      const isAffine = toggle.getAttribute("aria-pressed") !== "true";
      toggle.setAttribute("aria-pressed", String(isAffine));
      domain.setAffine(isAffine);
      viewer.onPick();
    });
    pane.append(toggle);
  }

  /** Handles keys of the pane of space. */
  act(key: string): void {
    const { view } = this;
    const standard = STANDARD[Number(key) - 1];
    if (standard) view.fit(standard[1], [0, 0, 1]);
    else if (key === "f" || key === "F") view.fit();
    else if (key === "p" || key === "P") view.flatten(!view.camera.orthographic);
    this.shown?.panel.refresh();
  }
}
