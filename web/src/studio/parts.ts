// Small parts of the page.

import { brief, h } from "../dom";
import type { Answer, Document } from "./backend";

export function button(name: string, act: () => void, look = ""): HTMLButtonElement {
  return h("button", { type: "button", class: look, click: act }, name);
}

/** Creates a field with its label above it. */
export function field(name: string, input: HTMLElement): HTMLLabelElement {
  return h("label", { class: "field" }, h("span", {}, name), input);
}

/** Creates a choice; the values are the keys of the options. */
export function choice(
  name: string,
  options: [value: string, text: string][],
  change: (value: string) => void,
): HTMLSelectElement {
  const select = h("select", {
    "aria-label": name,
    change: () => change(select.value),
  });
  select.append(...options.map(([value, text]) => h("option", { value }, text)));
  return select;
}

/** Shows these options, and one of them as chosen. */
export function setOptions(
  select: HTMLSelectElement,
  options: [value: string, text: string][],
  value: string,
): void {
  const known = [...select.options].map((o) => [o.value, o.text]);
  if (JSON.stringify(known) !== JSON.stringify(options))
    select.replaceChildren(...options.map(([v, text]) => h("option", { value: v }, text)));
  select.value = value;
}

export function section(title: string, ...children: (Node | string)[]): HTMLElement {
  return h("section", {}, h("h2", {}, title), ...children);
}

export const two = (v: number): number => Number(v.toPrecision(2));

/** Formats a number with an uncertainty: with the digits that it deserves, at least three. */
export function withSd(value: number, sd: number): string {
  if (!(sd > 0) || !Number.isFinite(sd)) return brief(value);
  const decimals = Math.max(0, Math.min(9, 1 - Math.floor(Math.log10(sd))));
  const text = decimals >= 9 ? brief(value) : value.toFixed(decimals);
  const spread = sd < 1e-9 * Math.abs(value) ? "" : ` ± ${brief(two(sd))}`;
  return `${text.replaceAll("-", "\u2212")}${spread}`;
}

/** Creates a list of warnings. */
export function warnings(list: string[]): Node[] {
  if (!list.length) return [];
  return [h("ul", { class: "warnings" }, ...list.map((text) => h("li", {}, text)))];
}

/** Creates the result of a certificate: what fails, in words. */
export function certificate(document: Document, answer?: Answer): HTMLElement {
  const { failures = [], holds, ok, complete } = document.certificate ?? {};
  const isProved = holds ?? (ok === true && complete === true);
  const words = (failure: Document): string =>
    typeof failure === "string" ? failure : (failure.message ?? JSON.stringify(failure));
  return h(
    "div",
    { class: isProved ? "verdict is-good" : "verdict is-doubtful" },
    h("strong", {}, isProved ? "The certificate holds." : "Not certified."),
    ...(failures.length
      ? [h("ul", {}, ...failures.map((f: Document) => h("li", {}, words(f))))]
      : []),
    ...warnings(answer?.warnings ?? []),
  );
}

/** Creates a table of names and values. */
export function figures(rows: [string, string][]): HTMLElement {
  return h(
    "dl",
    { class: "figures" },
    ...rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]),
  );
}
