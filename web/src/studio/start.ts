// Start of Isoform Studio.

import { App } from "./app";
import { type Backend, use } from "./backend";

/** Shows the studio in its element. */
export function start(backend: Backend): void {
  const root = document.querySelector<HTMLElement>("[data-isoform-studio]")!;
  // The viewer's style sheet applies inside of this attribute.
  root.dataset.isoformView = "studio";
  use(backend);
  const app = new App(root);
  const ready = app.start().catch((error) => app.fail(error));
  Object.defineProperty(window, "isoform", {
    value: Object.freeze({
      ready,
      saved: () => app.history.saved(),
      screenshot: () => app.stage.view.picture(),
    }),
    enumerable: true,
  });
}
