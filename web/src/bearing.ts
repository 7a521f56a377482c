// Axes and scale at the corner of the pane of space.

import { brief } from "./dom";
import { dot, type V3 } from "./vector";
import type { View } from "./view";

const SVG = "http://www.w3.org/2000/svg";

/** Length of an axis that is seen across, and maximum length of the scale, in pixels. */
const REACH = 24;
const LONGEST = 90;

/** Returns the largest of 1, 2 and 5 times a power of ten that is not above a length. */
export function roundBelow(length: number): number {
  const power = 10 ** Math.floor(Math.log10(length));
  const steps = [5, 2, 1].map((k) => k * power);
  return steps.find((step) => step <= length * (1 + 1e-9)) ?? power;
}

function element(tag: string, attributes: Record<string, string | number>): SVGElement {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  return made;
}

export class Bearing {
  private readonly root = element("svg", {
    class: "bearing",
    width: 110,
    height: 104,
    "aria-hidden": "true",
  });
  private readonly rays = ["x", "y", "z"].map((name) => {
    const line = element("line", { class: name });
    const label = element("text", { class: name, "text-anchor": "middle" });
    label.textContent = name;
    this.root.append(line, label);
    return { line, label };
  });
  private readonly bar = element("path", { class: "bar" });
  private readonly length = element("text", { x: 6, y: 86 });

  constructor(private readonly view: View) {
    this.root.append(this.bar, this.length);
    view.pane.append(this.root);
  }

  /** Follows the camera. */
  refresh(): void {
    const [right, up, ahead] = this.view.axes();
    const [x, y] = [36, 36];
    const along = (axis: V3, by: number) => [x + by * dot(axis, right), y - by * dot(axis, up)];
    this.rays.forEach(({ line, label }, k) => {
      const axis: V3 = [0, 0, 0];
      axis[k] = 1;
      const [tip, name] = [along(axis, REACH), along(axis, REACH + 8)];
      const ends = { x1: x, y1: y, x2: tip[0], y2: tip[1] };
      for (const [key, value] of Object.entries(ends)) line.setAttribute(key, value.toFixed(1));
      label.setAttribute("x", name[0].toFixed(1));
      label.setAttribute("y", (name[1] + 4).toFixed(1));
      // What points away is fainter.
      const share = dot(axis, ahead) > 0.2 ? "0.45" : "1";
      for (const part of [line, label]) part.setAttribute("opacity", share);
    });
    const pixel = this.view.perPixel();
    const length = roundBelow(LONGEST * pixel);
    const width = length / pixel;
    const isSound = Number.isFinite(width) && width > 0;
    this.bar.setAttribute("d", isSound ? `M6 91v5h${width.toFixed(1)}v-5` : "");
    this.length.textContent = isSound ? brief(length) : "";
  }
}
