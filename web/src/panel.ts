// Side panel: layers, parameters, section, picked point, view.

import { css, scaleColor } from "./colors";
import { brief, foreign, h, place, placeWithin } from "./dom";
import type { ColorMode, Extra, Layer } from "./layer";
import { angleAndRadius } from "./measure";
import { type V3, dot, norm, sub } from "./vector";
import type { Viewer } from "./viewer";

const COLORS: Record<ColorMode, string> = {
  none: "plain",
  part: "by part",
  deviation: "by deviation",
  quality: "by quality",
  u: "by u",
  v: "by v",
  bound: "by bound",
  file: "as in the file",
};
/** Number of steps of a slider. */
const STEPS = 1000;
/** Maximum number of parts that are listed. */
const MOST_PARTS = 40;

export const STANDARD: [string, V3][] = [
  ["Iso", [1, -1.3, 0.9]],
  ["Front", [0, -1, 0]],
  ["Right", [1, 0, 0]],
  ["Top", [0, -1e-3, 1]],
];

/** Describes the content of a layer in words. */
function counted({ kind, count }: Layer): string {
  if (kind === "model" && count === 1) return "model";
  const one = kind === "points" ? "point" : kind === "patches" ? "patch" : "triangle";
  const many = one === "patch" ? "patches" : `${one}s`;
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}

/** Creates the bars of a histogram. */
function bars(histogram: number[]): HTMLElement {
  const most = Math.max(1, ...histogram);
  const rows = histogram.map((n) => {
    const row = h("i");
    row.style.height = `${(100 * n) / most}%`;
    return row;
  });
  return h(
    "div",
    { class: "histogram", role: "img", "aria-label": "Histogram of the deviations" },
    ...rows,
  );
}

export class Panel {
  readonly element = h("aside", { "aria-label": "Controls" });
  private readonly rows: { layer: Layer; refresh: () => void }[] = [];
  private readonly sliders: { name: string; refresh: () => void }[] = [];
  private refreshSection: () => void = () => {};
  private readonly output = h("div", { class: "picked", role: "status" });
  private readonly measured: V3[] = [];
  private isMeasuring = false;

  constructor(private readonly viewer: Viewer) {
    this.element.append(this.layers());
    if (viewer.parameters().length) this.element.append(this.parameters());
    this.element.append(this.picking(), this.section(), this.camera());
    this.refresh();
    this.showPick();
  }

  refresh(): void {
    for (const row of [...this.rows, ...this.sliders]) row.refresh();
    this.refreshSection();
  }

  private group(title: string, ...children: (Node | string)[]): HTMLElement {
    // On a phone many sliders would hide what follows.
    const isOpen = title !== "Parameters" || innerWidth > 640;
    return h("details", { open: isOpen }, h("summary", {}, h("h2", {}, title)), ...children);
  }

  private layers(): HTMLElement {
    return this.group("Layers", ...this.viewer.layers.map((layer) => this.layer(layer)));
  }

  private layer(layer: Layer): HTMLElement {
    const { viewer } = this;
    const visible = h("input", {
      type: "checkbox",
      change: () => viewer.set(layer.id, { visible: visible.checked }),
    });
    const about = counted(layer);
    const opacity = h("input", {
      type: "range",
      min: "0",
      max: "1",
      step: "0.05",
      input: () => viewer.set(layer.id, { opacity: Number(opacity.value) }),
    });
    const colors = h("select", {
      title: "What the colours of this layer tell",
      change: () => viewer.set(layer.id, { colorBy: colors.value }),
    });
    const key = h("div", { class: "iv-key" });
    let shown = "";
    const refresh = () => {
      visible.checked = layer.visible;
      opacity.value = String(layer.opacity);
      if (colors.options.length !== layer.modes.length)
        colors.replaceChildren(...layer.modes.map((m) => h("option", { value: m }, COLORS[m])));
      colors.value = layer.colorBy;
      const scale = layer.scale();
      const now = JSON.stringify([layer.colorBy, scale, [...(layer.focus ?? [])]]);
      if (now !== shown) {
        const rows = [...key.querySelectorAll("button")];
        const at = rows.indexOf(document.activeElement as HTMLButtonElement);
        key.replaceChildren(...this.key(layer));
        if (at >= 0) key.querySelectorAll("button")[at]?.focus();
      }
      shown = now;
    };
    this.rows.push({ layer, refresh });
    const extras = (layer.extras ?? []).map((extra) => this.extra(extra));
    const tets =
      "tets" in layer && layer.tets ? `, ${(layer.tets as Uint32Array).length / 4} tetrahedra` : "";
    return h(
      "div",
      { class: "layer" },
      h("label", { class: "iv-name" }, visible, foreign(layer.name)),
      h("div", { class: "about" }, about + tets, ...(layer.note ? [h("br"), layer.note] : [])),
      h(
        "div",
        { class: "pair" },
        h("label", {}, h("span", {}, "Opacity"), opacity),
        ...(layer.modes.length > 1 ? [h("label", {}, h("span", {}, "Colour"), colors)] : []),
      ),
      ...extras,
      key,
    );
  }

  /** Creates the control of an additional option. */
  private extra(extra: Extra): HTMLElement {
    const input = extra.isSlider
      ? h("input", { type: "range", min: "0", max: "1", step: "0.01" })
      : h("input", { type: "checkbox" });
    input.addEventListener("input", () => {
      extra.value = extra.isSlider ? Number(input.value) : Number(input.checked);
      this.viewer.view.want();
      this.refresh();
    });
    const said = h("span");
    this.sliders.push({
      name: extra.name,
      refresh: () => {
        input.checked = extra.value === 1;
        if (extra.isSlider) {
          input.value = String(extra.value);
          said.textContent = ` ${brief(extra.value)}`;
        }
      },
    });
    return extra.isSlider
      ? h("label", { class: "extra" }, h("span", {}, extra.name, said), input)
      : h("label", { class: "extra iv-name" }, input, extra.name);
  }

  /** Creates the legend of a layer's colours. */
  private key(layer: Layer): Node[] {
    const legend = layer.legend();
    if (legend.length) {
      const canFocus = layer.focus !== undefined;
      const rows = legend.slice(0, MOST_PARTS).map(([name, color], i) => {
        const chip = h("i");
        chip.style.background = color;
        if (!canFocus) return h("li", {}, chip, foreign(name));
        const toggle = h(
          "button",
          {
            type: "button",
            class: "part",
            "aria-pressed": String(layer.focus?.has(i) ?? false),
            title: "Show this part alone in colour",
            click: () => {
              const focus = new Set(layer.focus);
              if (!focus.delete(i)) focus.add(i);
              this.viewer.focus(layer.id, focus);
            },
          },
          chip,
          foreign(name),
        );
        return h("li", {}, toggle);
      });
      const more = legend.length - rows.length;
      return [h("ul", {}, ...rows), ...(more > 0 ? [h("p", {}, `and ${more} more`)] : [])];
    }
    const scale = layer.scale();
    if (!scale) return [];
    const bar = h("div", { class: "scale" });
    const stops = Array.from({ length: 41 }, (_, i) => {
      const value = scale.lower + (i / 40) * (scale.upper - scale.lower);
      return `${css(scaleColor(value, scale.lower, scale.upper, scale.isDiverging))} ${2.5 * i}%`;
    });
    bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
    const middle = 0.5 * (scale.lower + scale.upper);
    const figures = [`n ${scale.n.toLocaleString("en")}`];
    if (scale.left) figures.push(`without ${scale.left.toLocaleString("en")} outliers, grey`);
    if (Number.isFinite(scale.rms)) figures.push(`rms ${brief(Number(scale.rms.toPrecision(3)))}`);
    if (Number.isFinite(scale.max))
      figures.push(`${scale.isLeast ? "least" : "max"} ${brief(Number(scale.max.toPrecision(3)))}`);
    return [
      h("p", {}, scale.title),
      ...(scale.histogram ? [bars(scale.histogram)] : []),
      bar,
      h(
        "div",
        { class: "ends" },
        h("span", {}, brief(scale.lower)),
        h("span", {}, brief(middle)),
        h("span", {}, brief(scale.upper)),
      ),
      h("p", {}, figures.join(" \u00b7 ")),
    ];
  }

  private parameters(): HTMLElement {
    const { viewer } = this;
    const rows = viewer.parameters().map(({ name, unit, description, lower, upper, isOpen }) => {
      const slider = h("input", {
        type: "range",
        min: String(lower),
        max: String(upper),
        step: String((upper - lower) / STEPS || 1),
      });
      const number = h("input", {
        type: "number",
        step: "any",
        min: String(lower),
        max: String(upper),
      });
      const move = (value: number) => {
        if (Number.isFinite(value)) viewer.slide(name, value);
      };
      slider.addEventListener("input", () => move(Number(slider.value)));
      number.addEventListener("change", () =>
        move(number.value === "" ? NaN : Number(number.value)),
      );
      slider.setAttribute("aria-label", name);
      number.setAttribute("aria-label", `${name}, as a number`);
      const refresh = () => {
        const now = viewer.parameters().find((p) => p.name === name)!.value;
        slider.value = String(now);
        if (document.activeElement !== number || Number(number.value) !== now)
          number.value = String(Number(now.toPrecision(9)));
      };
      this.sliders.push({ name, refresh });
      const head = h(
        "div",
        { class: "iv-name" },
        foreign(name),
        ...(unit ? [" in ", foreign(unit)] : []),
        ...(isOpen ? [" ", h("span", { class: "open" }, "undetermined")] : []),
      );
      return h(
        "div",
        { class: isOpen ? "parameter is-open" : "parameter" },
        head,
        number,
        slider,
        ...(description ? [h("small", {}, foreign(description))] : []),
      );
    });
    return this.group(
      "Parameters",
      ...rows,
      h(
        "button",
        {
          type: "button",
          title: "Back to the values that the page began with",
          click: () => viewer.resetParameters(),
        },
        "As given",
      ),
    );
  }

  private section(): HTMLElement {
    const { viewer } = this;
    const isOn = h("input", { type: "checkbox" });
    const numbers = ["x", "y", "z"].map((axis) =>
      h("input", { type: "number", step: "any", "aria-label": `Normal, ${axis}` }),
    );
    const offset = h("input", {
      type: "number",
      step: "any",
      "aria-label": "Offset along the normal",
    });
    const slider = h("input", {
      type: "range",
      min: "0",
      max: "1000",
      "aria-label": "Place of the section",
    });
    const reach = (n: V3): [number, number] => {
      const b = viewer.view.bounds();
      if (!b) return [-1, 1];
      const all = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
        dot(
          n,
          [0, 1, 2].map((k) => ((i >> k) & 1 ? b.hi[k] : b.lo[k])),
        ),
      );
      return [Math.min(...all), Math.max(...all)];
    };
    const cut = (normal: V3, at?: number) =>
      viewer.setSection({ normal, offset: at ?? dot(normal, viewer.middle()) });
    const typed = (): void => {
      const normal = numbers.map((n) => Number(n.value)) as V3;
      if (norm(normal) > 0 && offset.value !== "") cut(normal, Number(offset.value));
    };
    const axes = (["x", "y", "z"] as const).map((axis, k) =>
      h(
        "button",
        {
          type: "button",
          "aria-label": `Cut across ${axis}`,
          click: () => cut([0, 1, 2].map((i) => (i === k ? 1 : 0)) as V3),
        },
        axis,
      ),
    );
    const flip = h(
      "button",
      {
        type: "button",
        click: () => {
          const { section } = viewer.view;
          if (section)
            viewer.setSection({
              normal: section.normal.map((v) => 0 - v) as V3,
              offset: -section.offset,
            });
        },
      },
      "Other side",
    );
    for (const input of [...numbers, offset]) input.addEventListener("change", typed);
    slider.addEventListener("input", () => {
      const { section } = viewer.view;
      if (!section) return;
      const [lo, hi] = reach(section.normal);
      viewer.setSection({
        normal: section.normal,
        offset: lo + (Number(slider.value) / 1000) * (hi - lo),
      });
    });
    isOn.addEventListener("change", () =>
      isOn.checked ? cut([1, 0, 0]) : viewer.setSection(null),
    );
    const fields = h(
      "div",
      { class: "fields" },
      h("div", { class: "buttons" }, ...axes, flip),
      slider,
      h("div", { class: "four" }, ...numbers, offset),
      h("small", {}, "Normal x, y, z, and offset: what lies beyond is cut away."),
    );
    this.refreshSection = () => {
      const { section } = viewer.view;
      isOn.checked = section !== null;
      fields.hidden = section === null;
      if (!section) return;
      const [lo, hi] = reach(section.normal);
      numbers.forEach((n, k) => {
        if (document.activeElement !== n)
          n.value = String(Number(section.normal[k].toPrecision(7)));
      });
      if (document.activeElement !== offset)
        offset.value = String(Number(section.offset.toPrecision(7)));
      slider.value = String(Math.round((1000 * (section.offset - lo)) / (hi - lo || 1)));
    };
    return this.group("Section", h("label", { class: "iv-name" }, isOn, "Cut by a plane"), fields);
  }

  private picking(): HTMLElement {
    const measure = h(
      "button",
      {
        type: "button",
        title: "Distances, angles and circles through the points that are clicked",
        "aria-pressed": "false",
      },
      "Measure",
    );
    measure.addEventListener("click", () => {
      this.isMeasuring = !this.isMeasuring;
      this.measured.length = 0;
      measure.setAttribute("aria-pressed", String(this.isMeasuring));
      this.showPick();
    });
    return this.group("Picked", this.output, measure);
  }

  /** Shows the picked point; while measuring, the measures of the last two or three points. */
  showPick(): void {
    const { picked } = this.viewer;
    const rows: [string, Node | string][] = [];
    if (picked) {
      const layer = this.viewer.layers.find((l) => l.id === picked.layer);
      rows.push(["Point", placeWithin(picked.point, this.viewer.extent())]);
      if (layer && this.viewer.layers.length > 1) rows.push(["Layer", foreign(layer.name)]);
      if (picked.part) rows.push(["Part", foreign(picked.part)]);
      if (picked.isCap) rows.push(["", "on a cut"]);
      if (picked.deviation !== undefined) rows.push(["Deviation", brief(picked.deviation)]);
      if (picked.parameter)
        rows.push([layer?.kind === "map" ? "s, t" : "u, v", place(picked.parameter)]);
      const partners = this.viewer.marked?.partners ?? [];
      if (partners.length > 1) {
        const told = ([s, t, w]: V3) =>
          w < 1e-9 ? `(${place([s, t])} : 0)` : place([s / w, t / w]);
        rows.push([
          "Double",
          `${partners.length} sheets, at s, t = ${partners.map(told).join("; ")}`,
        ]);
      }
      if (this.isMeasuring) this.measured.push(picked.point);
    }
    if (this.measured.length > 3) this.measured.splice(0, this.measured.length - 3);
    const last = this.measured.slice(-2);
    if (last.length === 2)
      rows.push(
        ["Distance", brief(norm(sub(last[1], last[0])))],
        ["by x, y, z", place(sub(last[1], last[0]))],
      );
    if (this.measured.length === 3) {
      const { angle, radius } = angleAndRadius(this.measured as [V3, V3, V3]);
      rows.push(
        ["Angle", `${brief(angle)}\u00b0 at the second of three`],
        ["Radius", `${brief(radius)} of the circle through three`],
      );
    }
    const hint = this.isMeasuring
      ? "Click two places for their distance, a third for the angle and the circle."
      : "Click, or press Enter, on the shape.";
    const list = h(
      "dl",
      {},
      ...rows.flatMap(([name, value]) => [h("dt", {}, name || "\u00a0"), h("dd", {}, value)]),
    );
    this.output.replaceChildren(...(rows.length ? [list] : [h("p", {}, hint)]));
  }

  private camera(): HTMLElement {
    const { viewer } = this;
    const button = (name: string, act: () => void, title = `View: ${name}`) =>
      h("button", { type: "button", title, click: act }, name);
    const views = STANDARD.map(([name, from]) =>
      button(name, () => viewer.view.fit(from, [0, 0, 1])),
    );
    const flat = h("input", { type: "checkbox", change: () => viewer.view.flatten(flat.checked) });
    const said = h("small", { role: "status" });
    const link = button(
      "Link",
      () => {
        location.hash = viewer.state();
        said.textContent = "The address of this page now restores the view.";
        navigator.clipboard?.writeText(location.href).catch(() => {});
      },
      "Copy the address that shows this view",
    );
    const shot = button(
      "Picture",
      () => {
        viewer.view.draw();
        const save = h("a", { href: viewer.view.picture(), download: "isoform.png" });
        save.click();
      },
      "Save this picture as PNG",
    );
    this.rows.push({
      layer: viewer.layers[0],
      refresh: () => {
        flat.checked = viewer.view.camera.orthographic;
      },
    });
    return this.group(
      "View",
      h(
        "div",
        { class: "buttons" },
        button("Fit", () => viewer.view.fit(), "All of the scene (F)"),
        ...views,
      ),
      h(
        "label",
        { class: "iv-name", title: "Without perspective, as in drawings (P)" },
        flat,
        "Parallel projection",
      ),
      h("div", { class: "buttons" }, link, shot),
      said,
      h(
        "small",
        {},
        "Drag turns, wheel or two fingers zoom, Shift with a drag moves. Keys: arrows, + and " +
          "\u2212, F fits, 1 to 4 are the views, P is parallel.",
      ),
    );
  }
}
