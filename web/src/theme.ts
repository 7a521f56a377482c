// Light and dark: of the system, unless a person chose one.

export const THEMES = ["system", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];
/** Key of the choice. */
const KEY = "isoform-theme";

/** Returns true if an element is shown on a dark page. */
export function isDark(element: Element): boolean {
  const scheme = getComputedStyle(element).colorScheme;
  if (scheme === "dark" || scheme === "light") return scheme === "dark";
  return matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Returns the theme that was chosen last. Each start of the studio has another port: cookies, unlike
 *  storage, do not depend on it. */
export function chosen(): Theme {
  let stored = document.cookie.match(new RegExp(`${KEY}=(\\w+)`))?.[1] ?? null;
  try {
    stored ??= localStorage.getItem(KEY);
  } catch {
    // Pages opened from disk may have no storage.
  }
  return THEMES.find((theme) => theme === stored) ?? "system";
}

/** Shows an element in a theme. */
export function apply(element: HTMLElement, theme: Theme): void {
  element.style.colorScheme = theme === "system" ? "" : theme;
}

/** Shows an element in a theme, and remembers it for a year. */
export function choose(element: HTMLElement, theme: Theme): void {
  apply(element, theme);
  document.cookie = `${KEY}=${theme}; path=/; max-age=31536000; SameSite=Strict`;
  try {
    localStorage.setItem(KEY, theme);
  } catch {
    // The choice lasts as long as the page.
  }
}
