// Start of the page: layers from the document, panes, panel, and window.isoform.

import { h } from "./dom";
import { addSaving } from "./report";
import { readScene } from "./scene";
import { Stage } from "./stage";
import type { Camera } from "./view";
import type { Viewer } from "./viewer";

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
  const stage = new Stage();
  const isPage = root.dataset.isoformView === "page";
  const title = isPage ? [h("header", {}, h("h1", {}, h("bdi", {}, scene.title)))] : [];
  root.append(...title, stage.panes);
  const [viewer, panel] = await stage.show(scene);
  root.append(panel.element);
  stage.view.fit();
  const restore = () => {
    if (location.hash.length > 1) viewer.restore(location.hash.slice(1));
  };
  restore();
  addEventListener("hashchange", restore);
  stage.view.draw();
  panel.refresh();
  return viewer;
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

addSaving(document);
const root = document.querySelector<HTMLElement>("[data-isoform-view]");
if (root) {
  const ready = start(root).catch((error) => refuse(root, error));
  Object.defineProperty(window, "isoform", { value: isoform(ready), enumerable: true });
}
