// Viewer: layers, picked and marked points, state. The panel and window.isoform call the methods of
// this class.

import type { Domain } from "./domain";
import { COLOR_MODES, type ColorMode, type Hit, type Layer, type Section } from "./layer";
import { MapLayer } from "./map";
import { ModelLayer } from "./model";
import { PointsLayer } from "./points";
import type { ParameterDoc } from "./scene";
import { add, isFinite3, norm, sub, unit, type V3 } from "./vector";
import type { Camera, View } from "./view";

export interface Picked {
  layer: string;
  point: V3;
  part?: string;
  entity?: number;
  deviation?: number;
  parameter?: [number, number];
  isCap?: boolean;
}
/** Marked point. Partners are all parameters (s : t : w) of the point of the double curve nearest
 *  to the pick. */
export interface Marked {
  space: V3;
  domain: [number, number];
  partners: V3[];
}
export interface LayerState {
  id: string;
  name: string;
  kind: string;
  visible: boolean;
  opacity: number;
  count: number;
}
/** State in the address of a page; its keys are stable. */
interface State {
  camera: Camera;
  /** Visible settings of each layer, and its options by their keys. */
  layers: Record<string, unknown>[];
  section: Section | null;
  parameters: Record<string, number>;
}
export interface Parameter {
  name: string;
  value: number;
  lower: number;
  upper: number;
  unit: string | null;
  description: string;
  isOpen: boolean;
}

/** Maximum distance of a point of the double curve from a pick near it, as a fraction of the
 *  distance from the eye. */
const BESIDE = 0.05;

/** Number of tape steps that take less than a frame, and milliseconds before larger updates. */
const AT_ONCE = 3e6;
const REST = 250;

const isNumber = (v: unknown): v is number => typeof v === "number" && Number.isFinite(v);

export class Viewer {
  readonly layers: Layer[];
  domain: Domain | null = null;
  marked: Marked | null = null;
  picked: Picked | null = null;
  /** Callback after changes of anything except the camera. */
  onChange: () => void = () => {};
  onPick: () => void = () => {};

  constructor(
    layers: Layer[],
    readonly view: View,
  ) {
    this.layers = layers;
    this.measure();
    // Points shown with a model are coloured by their deviations from it.
    if (this.models.length)
      for (const layer of layers) if (layer instanceof PointsLayer) layer.colorBy = "deviation";
  }

  /** Parameters moved by sliders, until the next frame. */
  private readonly slid = new Map<string, number>();
  private rest = 0;

  private get models(): ModelLayer[] {
    return this.layers.filter((l): l is ModelLayer => l instanceof ModelLayer);
  }
  get map(): MapLayer | null {
    return this.layers.find((l): l is MapLayer => l instanceof MapLayer) ?? null;
  }

  private layer(id: string): Layer {
    const layer = this.layers.find((l) => l.id === id);
    if (!layer) throw new RangeError(`no layer has the id ${id}`);
    return layer;
  }

  states(): LayerState[] {
    return this.layers.map(({ id, name, kind, visible, opacity, count }) => ({
      id,
      name,
      kind,
      visible,
      opacity,
      count,
    }));
  }

  /** Changes the given settings of a layer. */
  set(id: string, some: { visible?: unknown; opacity?: unknown; colorBy?: unknown }): void {
    const layer = this.layer(id);
    if (typeof some.visible === "boolean") layer.visible = some.visible;
    if (isNumber(some.opacity)) layer.opacity = Math.max(0, Math.min(1, some.opacity));
    if (some.colorBy !== undefined) {
      if (!COLOR_MODES.includes(some.colorBy as ColorMode))
        throw new RangeError(`colours are ${COLOR_MODES.join(", ")}`);
      if (layer.modes.includes(some.colorBy as ColorMode))
        layer.colorBy = some.colorBy as ColorMode;
    }
    this.view.want();
    this.onChange();
  }

  /** Shows some parts of a layer in their colours and the others pale; null shows all. */
  focus(id: string, parts: Set<number> | null): void {
    const layer = this.layer(id);
    layer.focus = parts?.size ? parts : null;
    this.view.want();
    this.onChange();
  }

  /** Returns the visible point at a pixel of the pane of space, with its layer. */
  hitAt(x: number, y: number): [Layer, Hit] | null {
    const ray = this.view.ray(x, y);
    let best: [Layer, Hit] | null = null;
    for (const layer of this.layers) {
      if (!layer.visible || layer.opacity === 0) continue;
      const hit = layer.pick(ray);
      if (hit && (!best || hit.t < best[1].t)) best = [layer, hit];
    }
    return best;
  }

  /** Picks the visible point at a pixel of the pane of space. */
  pickSpace(x: number, y: number): Picked | null {
    const ray = this.view.ray(x, y);
    const best = this.hitAt(x, y);
    const near = best && best[0] instanceof MapLayer ? best[0].nearDouble(ray) : null;
    const isBeside =
      best &&
      near &&
      norm(sub(near, best[1].point)) <
        BESIDE * norm(sub(this.view.camera.target, this.view.camera.position));
    return this.mark(best && best[0], best && best[1], isBeside ? near : null);
  }

  /** Stores a hit as the picked point and marks it in both panes, with the parameters of a point of
   *  the double curve near it. */
  mark(layer: Layer | null, hit: Hit | null, double: V3 | null = null): Picked | null {
    this.picked = null;
    this.marked = null;
    if (layer && hit) {
      const { t: _, ...rest } = hit;
      this.picked = { layer: layer.id, ...rest };
      if (layer instanceof MapLayer && hit.parameter) {
        this.marked = {
          space: hit.point,
          domain: hit.parameter,
          partners: double ? layer.preimages(double) : [],
        };
      }
    }
    this.onPick();
    return this.picked;
  }

  camera(): Camera {
    const { position, target, up, orthographic, fov, height } = this.view.camera;
    return { position: [...position], target: [...target], up: [...up], orthographic, fov, height };
  }

  /** Takes those of the given camera settings that are valid. */
  setCamera(some: Partial<Camera>): void {
    const { camera } = this.view;
    const next = { ...camera };
    if (isFinite3(some.position)) next.position = [...some.position];
    if (isFinite3(some.target)) next.target = [...some.target];
    if (isFinite3(some.up) && norm(some.up) > 0) next.up = [...some.up];
    if (typeof some.orthographic === "boolean") next.orthographic = some.orthographic;
    if (isNumber(some.fov)) next.fov = Math.max(1, Math.min(150, some.fov));
    if (isNumber(some.height) && some.height > 0) next.height = some.height;
    if (norm(sub(next.position, next.target)) === 0)
      throw new RangeError("the camera is in its target");
    Object.assign(camera, next);
    this.view.want();
    this.onChange();
  }

  setSection(section: Section | null): void {
    if (section !== null) {
      if (!isFinite3(section.normal) || norm(section.normal) === 0 || !isNumber(section.offset))
        throw new RangeError("a section has a normal and an offset");
      const size = norm(section.normal);
      section = { normal: unit(section.normal), offset: section.offset / size };
    }
    this.view.section = section;
    this.view.want();
    this.onChange();
  }

  /** Returns the parameters of all models; equal names are one parameter. */
  parameters(): Parameter[] {
    const all = new Map<string, Parameter>();
    for (const model of this.models) {
      for (const p of model.parameters) {
        if (!all.has(p.name))
          all.set(p.name, {
            name: p.name,
            value: model.value(p),
            lower: p.lower,
            upper: p.upper,
            unit: p.unit,
            description: p.description,
            isOpen: p.isOpen,
          });
      }
    }
    return [...all.values()];
  }

  /** Moves a parameter by a slider; all moves until the next frame are applied at once. */
  slide(name: string, value: number): void {
    if (!this.slid.size) {
      requestAnimationFrame(() => {
        const values = Object.fromEntries(this.slid);
        this.slid.clear();
        this.setParameters(values, true);
      });
    }
    this.slid.set(name, value);
  }

  /** Sets values of parameters. While sliders move, deviations that take long are updated after a
   *  rest. */
  setParameters(values: Record<string, unknown>, isSliding = false): void {
    for (const name of Object.keys(values)) {
      if (!isNumber(values[name])) throw new RangeError(`the value of ${name} is no number`);
      if (!this.models.some((m) => m.parameters.some((p) => p.name === name)))
        throw new RangeError(`no parameter is called ${name}`);
    }
    for (const model of this.models) {
      const own = model.parameters.filter((p) => Object.hasOwn(values, p.name));
      const kept = (p: ParameterDoc) =>
        Math.max(p.lower, Math.min(p.upper, values[p.name] as number));
      if (own.length) model.setValues(own.map((p) => [p, kept(p)]));
    }
    clearTimeout(this.rest);
    if (isSliding && this.cost() > AT_ONCE) {
      this.rest = setTimeout(() => {
        this.measure();
        this.view.want();
        this.onChange();
      }, REST) as unknown as number;
    } else {
      this.measure();
    }
    this.view.want();
    this.onChange();
  }

  /** Returns the number of tape steps for the deviations of all points. */
  private cost(): number {
    const points = this.layers.filter((l) => l instanceof PointsLayer);
    const steps = this.models[0]?.doc.tape.steps.length ?? 0;
    return steps * points.reduce((sum, layer) => sum + layer.count, 0);
  }

  /** Resets the parameters to their original values. */
  resetParameters(): void {
    for (const model of this.models) model.setValues(model.parameters.map((p) => [p, p.value]));
    this.measure();
    this.view.want();
    this.onChange();
  }

  /** Computes deviations of points from the first model. Those of the file are kept as long as the
   *  model is unchanged. */
  private measure(): void {
    const model = this.models[0];
    if (!model) return;
    for (const points of this.layers.filter((l): l is PointsLayer => l instanceof PointsLayer)) {
      if (points.hasOwnDeviation && model.isAsGiven) {
        points.measure(null);
        continue;
      }
      const places = points.positions();
      for (let i = 0; i < places.length; i += 3)
        for (let k = 0; k < 3; k++) places[i + k] -= model.doc.origin[k];
      const deviation = new Float32Array(points.count);
      model.solid.read(places, (i, distance) => {
        deviation[i] = 0 - distance;
      });
      points.measure(deviation);
    }
  }

  /** Returns the parameters that differ from their original values. */
  moved(): Parameter[] {
    const came = this.asCame();
    return this.parameters().filter((p) => p.value !== came[p.name]);
  }

  /** Returns the original values of parameters. */
  private asCame(): Record<string, number> {
    const all = this.models.flatMap((m) => m.parameters).reverse();
    return Object.fromEntries(all.map((p) => [p.name, p.value]));
  }

  /** Returns the part of the view that a link keeps. Of parameters only changed ones are kept, so
   *  that the others follow a changed file. */
  state(): string {
    const layers = this.layers.map((l) => ({
      visible: l.visible,
      opacity: l.opacity,
      color: l.colorBy,
      ...Object.fromEntries((l.extras ?? []).map((e) => [e.key, e.value])),
    }));
    const { section } = this.view;
    const whole: State = {
      camera: this.view.camera,
      layers,
      section: section && { normal: section.normal, offset: section.offset },
      parameters: Object.fromEntries(this.moved().map((p) => [p.name, p.value])),
    };
    const utf8 = new TextEncoder().encode(JSON.stringify(whole));
    return btoa(String.fromCharCode(...utf8))
      .replaceAll("+", "-")
      .replaceAll("/", "_")
      .replaceAll("=", "");
  }

  /** Restores a state; returns false, without any change, if it is not valid. */
  restore(text: string): boolean {
    const before = this.state();
    try {
      const raw = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
      const whole = JSON.parse(
        new TextDecoder().decode(Uint8Array.from(raw, (c) => c.charCodeAt(0))),
      );
      this.take(whole);
      return true;
    } catch {
      if (text !== before) this.restore(before);
      return false;
    }
  }

  /** Takes a state: missing keys change nothing, unknown ones are ignored. */
  private take({ camera, layers, section, parameters }: Partial<State>): void {
    if (camera) {
      const { position, target, up, fov, height } = camera;
      if (![...position, ...target, ...up, fov, height].every(isNumber))
        throw new RangeError("no state");
      this.setCamera(camera);
    }
    if (layers) {
      if (layers.length !== this.layers.length) throw new RangeError("no state");
      layers.forEach((told, i) => {
        const layer = this.layers[i];
        this.set(layer.id, { visible: told.visible, opacity: told.opacity, colorBy: told.color });
        for (const extra of layer.extras ?? []) {
          const value = told[extra.key];
          if (isNumber(value)) extra.value = Math.max(0, Math.min(1, value));
        }
      });
    }
    if (section !== undefined) this.setSection(section);
    if (parameters) {
      const came = this.asCame();
      const given = Object.entries(parameters).filter(([name]) => Object.hasOwn(came, name));
      this.setParameters({ ...came, ...Object.fromEntries(given) });
    }
  }

  /** Returns the diagonal of the box of visible layers. */
  extent(): number {
    const b = this.view.bounds();
    return b ? norm(sub(b.hi, b.lo)) : 1;
  }

  /** Returns the centre of the visible layers, the initial position of a section. */
  middle(): V3 {
    const b = this.view.bounds();
    return b ? (add(b.lo, b.hi).map((v) => v / 2) as V3) : [0, 0, 0];
  }
}
