// Start of Isoform Studio.

import { App } from "./app";
import { use } from "./backend";
import { server } from "./server";

const root = document.querySelector<HTMLElement>("[data-isoform-studio]");
if (root) {
  // The viewer's style sheet applies inside of this attribute.
  root.dataset.isoformView = "studio";
  use(server);
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
