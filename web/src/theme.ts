// Light and dark: of the system, unless a person chose one.

export const THEMES = ["system", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];
/** Key of the choice in the storage of the browser. */
const KEY = "isoform-theme";

/** Returns true if an element is shown on a dark page. */
export function isDark(element: Element): boolean {
  const scheme = getComputedStyle(element).colorScheme;
  if (scheme === "dark" || scheme === "light") return scheme === "dark";
  return matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Returns the theme that was chosen last. */
export function chosen(): Theme {
  let stored: string | null = null;
  try {
    stored = localStorage.getItem(KEY);
  } catch {
    // Pages opened from disk may have no storage.
  }
  return THEMES.find((theme) => theme === stored) ?? "system";
}

/** Shows an element in a theme, and remembers it. */
export function choose(element: HTMLElement, theme: Theme): void {
  element.style.colorScheme = theme === "system" ? "" : theme;
  try {
    localStorage.setItem(KEY, theme);
  } catch {
    // The choice lasts as long as the page.
  }
}
