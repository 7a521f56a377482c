// Pane of the parameter plane: the whole projective plane as a square standing on its corner, whose
// opposite sides are identified as the line at infinity; or its affine part around the origin.

import { css } from "./colors";
import type { Hit } from "./layer";
import type { V3 } from "./vector";
import { CHARTS, type MapLayer, QUADRANTS } from "./map";

/** Size of the square, as a fraction of half the pane. */
const ROOM = 0.94;
/** Initial half width of the affine window. */
const WINDOW = 3;

export class Domain {
  readonly canvas = document.createElement("canvas");
  private isAffine = false;
  private window = WINDOW;

  constructor(
    readonly pane: HTMLElement,
    readonly map: MapLayer,
    onPick: (hit: Hit | null) => void,
  ) {
    this.canvas.setAttribute("aria-hidden", "true");
    pane.prepend(this.canvas);
    new ResizeObserver(() => this.draw()).observe(pane);
    pane.addEventListener("click", (e) => {
      if ((e.target as HTMLElement).closest("button")) return;
      const box = pane.getBoundingClientRect();
      onPick(this.pick(e.clientX - box.left, e.clientY - box.top));
    });
    pane.addEventListener(
      "wheel",
      (e) => {
        if (!this.isAffine) return;
        e.preventDefault();
        this.window *= Math.exp(e.deltaY * 0.0015);
        this.draw();
      },
      { passive: false },
    );
  }

  /** Switches between the whole plane and its affine part. */
  setAffine(isAffine: boolean): void {
    this.isAffine = isAffine;
    this.window = WINDOW;
    this.draw();
  }

  private get half(): [number, number] {
    return [this.pane.clientWidth / 2, this.pane.clientHeight / 2];
  }

  /** Returns the pane coordinates of (s : t : w) with w ≥ 0. */
  private place(h: ArrayLike<number>): [number, number] {
    const [x, y] = this.half;
    if (this.isAffine) {
      const k = Math.min(x, y) / this.window;
      return [x + (k * h[0]) / h[2], y - (k * h[1]) / h[2]];
    }
    const sum = Math.abs(h[0]) + Math.abs(h[1]) + Math.abs(h[2]);
    return [x + (ROOM * x * h[0]) / sum, y - (ROOM * y * h[1]) / sum];
  }

  /** Returns the pane coordinates of a parameter point. */
  project([s, t]: [number, number]): [number, number] {
    const [chart, u, v] = this.map.chartOf([s, t]);
    const [a, b] = QUADRANTS[chart];
    return this.place([a * u, b * v, 1 - u - v]);
  }

  /** Returns the pane coordinates of homogeneous parameters (s : t : w). */
  projectHomogeneous([s, t, w]: V3): [number, number] {
    const q = Math.abs(w) < 1e-9 ? 0 : 1 / w;
    return q ? this.project([s * q, t * q]) : this.place([s, t, 0]);
  }

  /** Returns the object at a point of the pane. */
  pick(px: number, py: number): Hit | null {
    const [x, y] = this.half;
    let [s, t, w] = [0, 0, 1];
    if (this.isAffine) {
      const k = Math.min(x, y) / this.window;
      [s, t] = [(px - x) / k, (y - py) / k];
    } else {
      [s, t] = [(px - x) / (ROOM * x), (y - py) / (ROOM * y)];
      w = 1 - Math.abs(s) - Math.abs(t);
      if (w < 0) return null;
    }
    const sum = Math.abs(s) + Math.abs(t) + w;
    const chart = QUADRANTS.findIndex(([a, b]) => a * s >= 0 && b * t >= 0);
    return this.map.hit(Math.max(0, chart), Math.abs(s) / sum, Math.abs(t) / sum);
  }

  draw(): void {
    const [x, y] = this.half;
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(2 * x * ratio));
    this.canvas.height = Math.max(1, Math.round(2 * y * ratio));
    const c = this.canvas.getContext("2d");
    if (!c || !x || !y) return;
    c.scale(ratio, ratio);
    const style = getComputedStyle(this.pane);
    const [ink, field] = [style.getPropertyValue("--quiet"), style.getPropertyValue("--field")];
    if (!this.isAffine) this.outline(c, ink, field);
    this.triangles(c, ratio);
    this.axes(c, ink);
    this.edges(c, style.getPropertyValue("--ink"));
    this.basePoints(c);
    c.fillStyle = ink;
    c.font = "12px system-ui, sans-serif";
    c.fillText("s", 2 * x - 14, y - 6);
    c.fillText("t", x + 6, 14);
  }

  private outline(c: CanvasRenderingContext2D, ink: string, field: string): void {
    const corners = [
      [1, 0, 0],
      [0, 1, 0],
      [-1, 0, 0],
      [0, -1, 0],
    ].map((h) => this.place(h));
    c.beginPath();
    for (const p of corners) c.lineTo(...p);
    c.closePath();
    c.fillStyle = field;
    c.strokeStyle = ink;
    c.fill();
    c.stroke();
  }

  private axes(c: CanvasRenderingContext2D, ink: string): void {
    const [x, y] = this.half;
    c.save();
    c.strokeStyle = ink;
    c.setLineDash([6, 5]);
    c.beginPath();
    const [rx, ry] = this.isAffine ? [x, y] : [ROOM * x, ROOM * y];
    c.moveTo(x - rx, y);
    c.lineTo(x + rx, y);
    c.moveTo(x, y - ry);
    c.lineTo(x, y + ry);
    c.stroke();
    c.restore();
  }

  /** Returns the pane coordinates of a corner of a triangle. */
  private corner(triangle: number, k: number): [number, number] {
    const [a, b] = QUADRANTS[this.map.charts[triangle]];
    const u = this.map.corners[6 * triangle + 2 * k];
    const v = this.map.corners[6 * triangle + 2 * k + 1];
    return this.place([a * u, b * v, Math.max(1 - u - v, 1e-9)]);
  }

  private triangles(c: CanvasRenderingContext2D, ratio: number): void {
    const count = this.map.charts.length;
    c.lineWidth = Math.max(0.25, Math.min(0.6, 6000 / count)) / ratio;
    for (let chart = 0; chart < 4; chart++) {
      c.beginPath();
      for (let i = 0; i < count; i++) {
        if (this.map.charts[i] !== chart) continue;
        c.moveTo(...this.corner(i, 0));
        c.lineTo(...this.corner(i, 1));
        c.lineTo(...this.corner(i, 2));
        c.closePath();
      }
      c.fillStyle = c.strokeStyle = css(CHARTS[chart]);
      c.fill();
      c.strokeStyle = "rgb(70 90 110 / 0.55)";
      c.stroke();
    }
  }

  /** Draws the edges of only one triangle, where the drawn surface ends, and those of more than
   *  two, where sheets meet. */
  private edges(c: CanvasRenderingContext2D, ink: string): void {
    const { triangles } = this.map;
    const uses = new Map<number, number>();
    const key = (i: number, k: number) => {
      const [a, b] = [triangles[3 * i + k], triangles[3 * i + ((k + 1) % 3)]];
      return Math.min(a, b) * 0x4000000 + Math.max(a, b);
    };
    const count = triangles.length / 3;
    for (let i = 0; i < count; i++)
      for (let k = 0; k < 3; k++) uses.set(key(i, k), (uses.get(key(i, k)) ?? 0) + 1);
    const line = (isOpen: boolean) => {
      c.beginPath();
      for (let i = 0; i < count; i++)
        for (let k = 0; k < 3; k++) {
          const n = uses.get(key(i, k)) ?? 2;
          if (n === 2 || (n === 1) !== isOpen) continue;
          c.moveTo(...this.corner(i, k));
          c.lineTo(...this.corner(i, (k + 1) % 3));
        }
      c.lineWidth = 1.5;
      c.strokeStyle = isOpen ? ink : "rgb(209 73 91)";
      c.stroke();
    };
    line(true);
    line(false);
  }

  private basePoints(c: CanvasRenderingContext2D): void {
    for (const [s, t, w] of this.map.doc.basePoints) {
      const ends =
        w === 0
          ? [
              [s, t, 0],
              [-s, -t, 0],
            ]
          : [[s * Math.sign(w), t * Math.sign(w), Math.abs(w)]];
      for (const h of ends) {
        if (this.isAffine && h[2] === 0) continue;
        c.beginPath();
        c.arc(...this.place(h), 4, 0, 2 * Math.PI);
        c.fillStyle = "#fff";
        c.strokeStyle = "#b8251b";
        c.lineWidth = 2;
        c.fill();
        c.stroke();
      }
    }
  }
}
