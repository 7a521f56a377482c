// Pane of space: cameras, drawing, lines of sight.

import {
  type BufferGeometry,
  Color,
  ColorManagement,
  LinearSRGBColorSpace,
  type Material,
  type Mesh,
  OrthographicCamera,
  PerspectiveCamera,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import type { Layer, Ray, Section } from "./layer";
import * as theme from "./theme";
import {
  add,
  along,
  around,
  type Box,
  center,
  cross,
  diagonal,
  dot,
  norm,
  scale,
  sub,
  unit,
  type V3,
} from "./vector";

/** Vertical angle of view, in degrees. */
const FOV = 35;
/** Milliseconds of rest before the picture is drawn finely, and the factor of resolution. */
const REST = 250;
const FINER = 2;
/** Milliseconds of a frame that is slow. */
const SLOW = 50;
/** Least share of a large layer that moves with the view. */
const LEAST = 0.02;
/** Factor by which the view exceeds its content. */
const MARGIN = 1.06;

export interface Camera {
  position: V3;
  target: V3;
  up: V3;
  orthographic: boolean;
  fov: number;
  height: number;
}

export class View {
  readonly canvas: HTMLCanvasElement;
  readonly camera: Camera = {
    position: [3, -4, 2.5],
    target: [0, 0, 0],
    up: [0, 0, 1],
    orthographic: false,
    fov: FOV,
    height: 2,
  };
  section: Section | null = null;
  /** Callback after each drawing. */
  onDrawn: () => void = () => {};
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly perspective = new PerspectiveCamera();
  private readonly flat = new OrthographicCamera();
  private isWanted = false;
  private rest = 0;
  private frame = 0;
  /** Share of large layers that moves with the view. */
  private share = 1;
  /** Milliseconds that the last frame of a motion took. */
  private pace = 0;
  /** Sign that the graphics card gives when it has drawn the last frame; null if none waits. */
  private last: WebGLSync | null = null;
  /** True if all of large layers is drawn. */
  private isWhole = false;
  /** True if the picture is drawn finely. */
  private isFine = false;

  private layers: Layer[] = [];
  /** Layers that are no longer shown, until the next drawing, which may use their shaders. */
  private readonly past: Layer[] = [];
  /** Centre of the scene, in coordinates of the file. */
  origin: V3 = [0, 0, 0];

  constructor(readonly pane: HTMLElement) {
    // Colours are used exactly as in the style sheet, without conversion.
    ColorManagement.enabled = false;
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("aria-hidden", "true");
    pane.prepend(this.canvas);
    new ResizeObserver(() => this.isOfSize() || this.draw()).observe(pane);
    pane.addEventListener("pointerenter", () => this.refine());
  }

  /** Shows these layers in place of others. */
  put(layers: Layer[], origin: V3): void {
    for (const layer of this.layers) this.scene.remove(layer.object);
    this.past.push(...this.layers);
    this.layers = layers;
    this.origin = origin;
    this.section = null;
    for (const layer of layers) this.scene.add(layer.object);
  }

  /** Frees the memory of layers that are no longer shown. */
  private clean(): void {
    for (const { object } of this.past.splice(0)) {
      object.traverse((part) => {
        const { geometry, material } = part as Partial<Mesh<BufferGeometry, Material>>;
        geometry?.dispose();
        material?.dispose();
      });
    }
  }

  /** True if the picture has the size of the pane. */
  private isOfSize(): boolean {
    const { x, y } = this.renderer.getSize(new Vector2());
    const [width, height] = this.size;
    return x === width && y === height;
  }

  /** Returns the pane's width and height, which need not be whole pixels. */
  get size(): [number, number] {
    const { width, height } = this.pane.getBoundingClientRect();
    return [width, height];
  }

  /** Requests a drawing, one for all changes until then. */
  want(): void {
    if (this.isWanted) return;
    this.isWanted = true;
    requestAnimationFrame(() => {
      if (!this.isWanted) return;
      this.draw();
      if (this.passes || this.isSampled) this.time();
    });
  }

  /** Measures the time until the picture is drawn, which the graphics card does on its own. A rest
   *  begins only then: fine pictures between those of a slow motion would make it slower. */
  private time(): void {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.last = sync;
    if (!sync) return;
    gl.flush();
    const began = performance.now();
    const look = () => {
      if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) {
        setTimeout(look, 4);
        return;
      }
      gl.deleteSync(sync);
      this.pace = performance.now() - began;
      if (this.passes) this.adapt();
      else if (sync === this.last) this.refine();
    };
    setTimeout(look, 4);
  }

  /** Draws less of large layers where a frame takes long, and more where it does not. */
  private adapt(): void {
    if (this.pace > SLOW) this.share = Math.max(this.share / 2, LEAST);
    else if (this.pace < SLOW / 2) this.share = Math.min(1, 1.1 * this.share);
  }

  /** Draws finely after a rest, which smooths the edges of models with one sample per pixel. */
  private refine(): void {
    clearTimeout(this.rest);
    const passes = this.passes;
    if (passes ? this.isWhole : this.isFine) return;
    // Not between two frames of a slow motion.
    const rest = REST + 2 * this.pace;
    if (passes) {
      const isClear = this.layers.some((l) => l.passes && l.visible && l.opacity < 1);
      // Parts that are drawn over one another would blend with themselves.
      const all = () => (isClear ? this.draw(1, true) : this.add(1, passes));
      this.rest = setTimeout(all, rest) as unknown as number;
      return;
    }
    if (!this.isSampled) return;
    this.rest = setTimeout(() => this.draw(FINER), rest) as unknown as number;
  }

  /** True if a visible layer has one sample per pixel. */
  private get isSampled(): boolean {
    return this.layers.some((l) => l.visible && l.isSampled);
  }

  /** Number of parts in which the layers are drawn; 0 if one frame suffices. */
  private get passes(): number {
    return Math.max(0, ...this.layers.map((l) => (l.visible ? (l.passes ?? 0) : 0)));
  }

  /** Draws one part of large layers over the picture, and the next ones in the frames after it. */
  private add(part: number, passes: number): void {
    const shown = this.layers.map((l) => l.object.visible);
    for (const layer of this.layers) {
      if (part <= (layer.passes ?? 0)) layer.pass?.(part);
      else layer.object.visible = false;
    }
    this.renderer.autoClear = false;
    this.renderer.render(this.scene, this.three());
    this.renderer.autoClear = true;
    this.layers.forEach((layer, i) => (layer.object.visible = shown[i]));
    this.isWhole = part === passes;
    if (part < passes)
      this.frame = requestAnimationFrame(() => this.add(part + 1, passes)) as unknown as number;
  }

  /** Draws immediately, with a multiple of the screen's resolution; of large layers what moves with
   *  the view, and the rest later, unless the whole is asked for. */
  draw(finer = 1, isWhole = false): void {
    clearTimeout(this.rest);
    cancelAnimationFrame(this.frame);
    this.isWanted = false;
    this.last = null;
    const [width, height] = this.size;
    if (!width || !height) return;
    const ratio = finer * Math.min(2, devicePixelRatio || 1);
    const isDark = theme.isDark(this.pane);
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    const old = this.renderer.getSize(new Vector2());
    if (old.x !== width || old.y !== height) this.renderer.setSize(width, height, false);
    const paint = getComputedStyle(this.pane).backgroundColor;
    this.renderer.setClearColor(new Color(paint), 1);
    for (const layer of this.layers) {
      layer.update(this.section, { isDark, pixelRatio: ratio });
      layer.pass?.(isWhole ? null : 0, this.share);
    }
    this.renderer.render(this.scene, this.three());
    this.clean();
    this.onDrawn();
    this.isWhole = isWhole;
    this.isFine = finer > 1;
    if (!isWhole && this.passes) this.refine();
  }

  /** Returns the box of all visible layers. */
  bounds(): Box | null {
    const boxes = this.layers
      .filter((l) => l.visible)
      .map((l) => l.bounds())
      .filter((b): b is Box => b !== null);
    return boxes.length ? around(boxes) : null;
  }

  /** Returns the camera for three.js. */
  private three(): PerspectiveCamera | OrthographicCamera {
    const { position, target, up, orthographic, fov, height } = this.camera;
    const aspect = this.size[0] / this.size[1];
    const boxes = this.layers.map((l) => l.bounds()).filter((b): b is Box => b !== null);
    const all = boxes.length ? around(boxes) : { lo: target, hi: target };
    const reach = norm(sub(center(all), position)) + diagonal(all) + 1e-9;
    const camera = orthographic ? this.flat : this.perspective;
    if (orthographic) {
      const half = height / 2;
      Object.assign(this.flat, {
        left: -half * aspect,
        right: half * aspect,
        top: half,
        bottom: -half,
        near: -reach,
        far: reach,
      });
    } else {
      Object.assign(this.perspective, {
        fov,
        aspect,
        near: Math.min(1e-3 * diagonal(all) || 1e-3, norm(sub(target, position)) / 10),
        far: reach,
      });
    }
    const [p, t] = [sub(position, this.origin), sub(target, this.origin)];
    camera.position.set(...p);
    camera.up.set(...up);
    camera.lookAt(new Vector3(...t));
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return camera;
  }

  /** Returns the unit vectors to the right, up and ahead. */
  axes(): [V3, V3, V3] {
    const ahead = unit(sub(this.camera.target, this.camera.position));
    let right = cross(ahead, this.camera.up);
    if (norm(right) < 1e-9) right = cross(ahead, Math.abs(ahead[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
    right = unit(right);
    return [right, cross(right, ahead), ahead];
  }

  /** Returns the size of a pixel at the target, in model units. */
  perPixel(): number {
    const { position, target, orthographic, fov, height } = this.camera;
    const whole = orthographic
      ? height
      : 2 * norm(sub(target, position)) * Math.tan((fov * Math.PI) / 360);
    return whole / Math.max(1, this.size[1]);
  }

  /** Returns the line of sight of a pixel of the pane. */
  ray(x: number, y: number): Ray {
    const [right, up, ahead] = this.axes();
    const [width, height] = this.size;
    const { position, orthographic, fov } = this.camera;
    const half = orthographic ? this.camera.height / 2 : Math.tan((fov * Math.PI) / 360);
    const [u, v] = [
      ((x - width / 2) / (height / 2)) * half,
      (-(y - height / 2) / (height / 2)) * half,
    ];
    const side = add(scale(right, u), scale(up, v));
    const project = (p: ArrayLike<number>): [number, number, number] => {
      const r = sub(p, position);
      const depth = dot(r, ahead);
      const k = ((orthographic ? 1 : depth) * half) / (height / 2);
      return [width / 2 + dot(r, right) / k, height / 2 - dot(r, up) / k, depth];
    };
    const form = (v: V3): number[] => [...v, -dot(v, position)];
    const perUnit = height / 2 / half;
    const depth = form(ahead);
    const w = orthographic ? [0, 0, 0, 1] : depth;
    const less = (f: number[], by: number): number[] => f.map((v, k) => v - by * w[k]);
    const forms = [
      less(form(scale(right, perUnit)), x - width / 2),
      less(form(scale(up, -perUnit)), y - height / 2),
      w,
      depth,
    ];
    const common = { section: this.section, project, pixel: [x, y] as [number, number], forms };
    return orthographic
      ? { o: add(position, side), d: ahead, from: -Infinity, ...common }
      : { o: position, d: unit(add(ahead, side)), from: 0, ...common };
  }

  /** Returns the pane coordinates and depth of a point. */
  project(p: V3): [number, number, number] {
    return this.ray(0, 0).project(p);
  }

  /** Rotates the camera around the target by angles to the right and up. */
  turn(right: number, up: number): void {
    const { target, position } = this.camera;
    const pole = unit(this.camera.up);
    const from = sub(position, target);
    const size = norm(from);
    const height = Math.asin(Math.max(-1, Math.min(1, dot(from, pole) / size)));
    const most = Math.PI / 2 - 1e-3;
    const to = Math.max(-most, Math.min(most, height + up));
    let level = sub(from, scale(pole, dot(from, pole)));
    if (norm(level) < 1e-6 * size) level = scale(cross(this.axes()[0], pole), -1);
    level = unit(level);
    const beside = cross(pole, level);
    const way = add(scale(level, Math.cos(-right)), scale(beside, Math.sin(-right)));
    this.camera.position = add(
      target,
      add(scale(way, size * Math.cos(to)), scale(pole, size * Math.sin(to))),
    );
    this.want();
  }

  /** Moves the camera across the line of sight, by pixels. */
  pan(x: number, y: number): void {
    const [right, up] = this.axes();
    const by = add(scale(right, -x * this.perPixel()), scale(up, y * this.perPixel()));
    this.camera.position = add(this.camera.position, by);
    this.camera.target = add(this.camera.target, by);
    this.want();
  }

  /** Scales the distance from the target by a factor; the point at a given pixel stays in place. */
  zoom(factor: number, at?: [number, number]): void {
    if (at) {
      const [x, y] = [at[0] - this.size[0] / 2, at[1] - this.size[1] / 2];
      this.pan(-x * (1 - factor), -y * (1 - factor));
    }
    this.camera.position = along(
      this.camera.target,
      sub(this.camera.position, this.camera.target),
      factor,
    );
    this.camera.height *= factor;
    this.want();
  }

  /** Fits all visible layers into the pane; keeps the direction unless one is given. */
  fit(direction?: V3, up?: V3): void {
    const bounds = this.bounds();
    if (!bounds) return;
    if (up) this.camera.up = up;
    const from = unit(direction ?? sub(this.camera.position, this.camera.target));
    this.camera.target = center(bounds);
    const size = diagonal(bounds) || 1;
    this.camera.position = along(this.camera.target, from, size);
    const [right, upward, ahead] = this.axes();
    const [width, height] = this.size;
    const aspect = width / Math.max(1, height) || 1;
    const slope = Math.tan((this.camera.fov * Math.PI) / 360);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
      sub(
        [0, 1, 2].map((k) => ((i >> k) & 1 ? bounds.hi[k] : bounds.lo[k])),
        this.camera.target,
      ),
    );
    const half = Math.max(
      ...corners.map((c) => Math.max(Math.abs(dot(c, upward)), Math.abs(dot(c, right)) / aspect)),
    );
    const away = Math.max(
      ...corners.map(
        (c) =>
          Math.max(Math.abs(dot(c, upward)), Math.abs(dot(c, right)) / aspect) / slope -
          dot(c, ahead),
      ),
    );
    this.camera.height = 2 * MARGIN * half || 1;
    this.camera.position = along(this.camera.target, from, MARGIN * Math.max(away, 1e-3 * size));
    this.want();
  }

  /** Switches between perspective and parallel projection; the size at the target is kept. */
  flatten(isFlat: boolean): void {
    if (isFlat === this.camera.orthographic) return;
    const height = this.perPixel() * this.size[1];
    const slope = Math.tan((this.camera.fov * Math.PI) / 360);
    const from = unit(sub(this.camera.position, this.camera.target));
    this.camera.orthographic = isFlat;
    if (isFlat) this.camera.height = height;
    else this.camera.position = along(this.camera.target, from, height / 2 / slope);
    this.want();
  }

  picture(): string {
    if (this.passes) this.draw(1, true);
    return this.canvas.toDataURL("image/png");
  }
}
