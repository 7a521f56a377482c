// Marks over the panes: rings at picked points. They are elements, so that a pick does not redraw
// the scene.

import { h } from "./dom";
import type { Viewer } from "./viewer";

export class Marks {
  private readonly space = h("div", { class: "mark", hidden: true });
  private readonly domain = h("div", { class: "mark", hidden: true });
  private partners: HTMLElement[] = [];

  constructor(private readonly viewer: Viewer) {
    viewer.view.pane.append(this.space);
    viewer.domain?.pane.append(this.domain);
  }

  refresh(): void {
    const { picked, marked, view, domain } = this.viewer;
    const at = picked && view.project(picked.point);
    show(
      this.space,
      at && at[2] > 0 ? [at[0], at[1]] : at && view.camera.orthographic ? [at[0], at[1]] : null,
    );
    if (!domain) return;
    show(this.domain, marked && domain.project(marked.domain));
    for (const old of this.partners) old.remove();
    this.partners = (marked?.partners ?? []).map((parameter) => {
      const mark = h("div", { class: "mark partner" });
      show(mark, domain.projectHomogeneous(parameter));
      domain.pane.append(mark);
      return mark;
    });
  }

  /** Removes the marks from the pane of space. */
  remove(): void {
    this.space.remove();
  }
}

function show(mark: HTMLElement, at: [number, number] | null | undefined): void {
  mark.hidden = !at || !at.every(Number.isFinite);
  if (at) {
    mark.style.left = `${at[0]}px`;
    mark.style.top = `${at[1]}px`;
  }
}
