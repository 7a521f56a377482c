// Elements of the page. Texts of files are inserted as text nodes in <bdi>, never as HTML.

type Child = Node | string;
type Attributes = Record<string, string | boolean | ((e: Event) => void)>;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Returns an element with a text from a file, which may run in any direction. */
export const foreign = (text: string): HTMLElement => h("bdi", {}, text);

/** Formats a number with few significant digits. */
export function brief(v: number): string {
  if (!Number.isFinite(v)) return String(v);
  const text =
    Math.abs(v) >= 1e6 || (v !== 0 && Math.abs(v) < 1e-4)
      ? Number(v.toPrecision(5)).toExponential()
      : String(Number(v.toPrecision(6)));
  return text.replaceAll("-", "\u2212");
}
export const place = (p: ArrayLike<number>): string => Array.from(p).map(brief).join(", ");
/** Formats a point with decimals down to a hundred-thousandth of the scene's size, independent of
 *  its distance from the origin. */
export function placeWithin(p: ArrayLike<number>, size: number): string {
  const decimals = Math.max(0, Math.ceil(5 - Math.log10(size)));
  const far = (v: number): boolean => Math.abs(v) > 10 * size && decimals <= 20;
  const text = (v: number): string =>
    far(v) ? v.toFixed(decimals).replaceAll("-", "\u2212") : brief(v);
  return Array.from(p).map(text).join(", ");
}
