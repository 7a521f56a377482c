// Selection of points by a rectangle that is drawn over the pane of space.

import { h } from "../dom";
import type { View } from "../view";

/** Adds the selection to a pane, by the ends of the rectangle in pixels; returns the function that
 *  turns it on and off. */
export function boxSelect(
  view: View,
  select: (x: number[], y: number[]) => void,
): (isOn: boolean) => void {
  const frame = h("div", { class: "frame", hidden: true });
  const sheet = h("div", { class: "sheet", hidden: true }, frame);
  view.pane.append(sheet);
  let from: [number, number] | null = null;
  const place = (e: PointerEvent): [number, number] => {
    const box = sheet.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  const ends = (a: [number, number], b: [number, number]) =>
    [0, 1].map((k) => [Math.min(a[k], b[k]), Math.max(a[k], b[k])]);
  sheet.addEventListener("pointerdown", (e) => {
    // The other buttons move the view and open its menu.
    if (e.button !== 0) return;
    e.stopPropagation();
    sheet.setPointerCapture(e.pointerId);
    from = place(e);
  });
  sheet.addEventListener("pointermove", (e) => {
    if (!from) return;
    const [x, y] = ends(from, place(e));
    frame.hidden = false;
    Object.assign(frame.style, {
      left: `${x[0]}px`,
      top: `${y[0]}px`,
      width: `${x[1] - x[0]}px`,
      height: `${y[1] - y[0]}px`,
    });
  });
  sheet.addEventListener("pointerup", (e) => {
    if (!from) return;
    const [x, y] = ends(from, place(e));
    from = null;
    frame.hidden = true;
    select(x, y);
  });
  sheet.addEventListener("wheel", (e) => {
    e.preventDefault();
    view.zoom(Math.exp(e.deltaY * 0.0015), place(e as unknown as PointerEvent));
  });
  return (isOn) => {
    sheet.hidden = !isOn;
    from = null;
    frame.hidden = true;
  };
}
