// Start of the page: layers from the document, panes, panel, and window.isoform.

import { Vector3 } from "three";
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
import { type LayerDoc, type MeshDoc, type ModelDoc, readScene, type Vec3 } from "./scene";
import { around, center, sub, type V3 } from "./vector";
import { View, type Camera } from "./view";
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

/** Shows the error that prevents the page from working. */
function refuse(root: Element, error: unknown): never {
  const message = error instanceof Error ? error.message : String(error);
  root.append(
    h(
      "p",
      { class: "failure", role: "alert" },
      `The page cannot show its shapes: ${message}. It needs WebGL 2, ` +
        "which any recent browser has.",
    ),
  );
  throw error;
}

async function start(root: HTMLElement): Promise<Viewer> {
  const scene = readScene();
  const origin = center(around(scene.layers.map(boxOf)));
  const layers = await Promise.all(
    scene.layers.map((doc, i) => layerOf(doc, `layer-${i + 1}`, origin)),
  );
  const space = h("div", {
    "data-pane": "space",
    tabindex: "0",
    role: "application",
    "aria-label":
      "Space. Arrow keys turn the view, plus and minus zoom, Enter picks in the middle.",
  });
  const panes = h("div", { class: "panes" }, space);
  const isPage = root.dataset.isoformView === "page";
  const title = isPage ? [h("header", {}, h("h1", {}, h("bdi", {}, scene.title)))] : [];
  root.append(...title, panes);
  const view = new View(space, layers, origin);
  const viewer = new Viewer(layers, view);
  if (viewer.map) addDomain(viewer, panes);
  const panel = new Panel(viewer);
  root.append(panel.element);
  const marks = new Marks(viewer);
  viewer.onChange = () => panel.refresh();
  viewer.onPick = () => {
    panel.showPick();
    marks.refresh();
  };
  view.onDrawn = () => marks.refresh();
  control(
    view,
    (x, y) => viewer.pickSpace(x, y),
    (key) => act(viewer, panel, key),
  );
  view.fit(STANDARD[0][1], [0, 0, 1]);
  const restore = () => {
    if (location.hash.length > 1) viewer.restore(location.hash.slice(1));
  };
  restore();
  addEventListener("hashchange", restore);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    view.want();
    viewer.domain?.draw();
  });
  view.draw();
  panel.refresh();
  return viewer;
}

/** Adds the pane of parameters next to the pane of space. */
function addDomain(viewer: Viewer, panes: HTMLElement): void {
  const pane = h("div", {
    "data-pane": "domain",
    role: "group",
    "aria-label": "The plane of parameters s and t",
  });
  panes.append(pane);
  const map = viewer.map!;
  const domain = new Domain(pane, map, (hit) => viewer.mark(hit && map, hit));
  viewer.domain = domain;
  const toggle = h("button", { type: "button", class: "over", "aria-pressed": "false" }, "Affine");
  toggle.addEventListener("click", () => {
    const isAffine = toggle.getAttribute("aria-pressed") !== "true";
    toggle.setAttribute("aria-pressed", String(isAffine));
    domain.setAffine(isAffine);
    viewer.onPick();
  });
  pane.append(toggle);
}

/** Handles keys of the pane of space. */
function act(viewer: Viewer, panel: Panel, key: string): void {
  const { view } = viewer;
  const standard = STANDARD[Number(key) - 1];
  if (standard) view.fit(standard[1], [0, 0, 1]);
  else if (key === "f" || key === "F") view.fit();
  else if (key === "p" || key === "P") view.flatten(!view.camera.orthographic);
  panel.refresh();
}

/** Creates the programming interface of the page. Each method resolves when its change is drawn.
 *  The list of layers is available when the page is ready. */
function isoform(ready: Promise<Viewer>): Record<string, unknown> {
  let viewer: Viewer | undefined;
  const isReady = ready.then((v) => {
    viewer = v;
  });
  const drawn =
    <T>(verb: (v: Viewer) => T) =>
    async (): Promise<T> => {
      const viewer = await ready;
      const result = verb(viewer);
      viewer.view.draw();
      return result;
    };
  const asked = <T>(verb: (v: Viewer) => T) => ready.then(verb);
  const pick = (v: Viewer, x: number, y: number) => {
    const place = (pane: HTMLElement): [number, number] | null => {
      const box = pane.getBoundingClientRect();
      const isIn = x >= box.left && x <= box.right && y >= box.top && y <= box.bottom;
      return isIn ? [x - box.left, y - box.top] : null;
    };
    const inDomain = v.domain && place(v.domain.pane);
    if (inDomain) {
      const hit = v.domain!.pick(...inDomain);
      return v.mark(hit && v.map, hit);
    }
    const inSpace = place(v.view.pane);
    return inSpace ? v.pickSpace(...inSpace) : v.mark(null, null);
  };
  return Object.freeze({
    ready: isReady,
    layers: () => viewer?.states() ?? asked((v) => v.states()),
    set: (id: string, some: object) => drawn((v) => v.set(id, some))(),
    pick: (x: number, y: number) => asked((v) => pick(v, x, y)),
    marked: () => asked((v) => v.marked),
    camera: (some?: Partial<Camera>) =>
      some ? drawn((v) => v.setCamera(some))() : asked((v) => v.camera()),
    fitView: drawn((v) => v.view.fit()),
    section: (some: never) => drawn((v) => v.setSection(some ?? null))(),
    parameters: () =>
      asked((v) =>
        v.parameters().map(({ name, value, lower, upper }) => ({ name, value, lower, upper })),
      ),
    setParameter: (name: string, value: number) =>
      drawn((v) => v.setParameters({ [name]: value }))(),
    state: () => asked((v) => v.state()),
    screenshot: () => asked((v) => v.view.picture()),
  });
}

const root = document.querySelector<HTMLElement>("[data-isoform-view]");
if (root) {
  const ready = start(root).catch((error) => refuse(root, error));
  Object.defineProperty(window, "isoform", { value: isoform(ready), enumerable: true });
}
