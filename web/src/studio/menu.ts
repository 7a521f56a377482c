// Context menu.

import { h } from "../dom";

/** Entry of a menu; null for a line between entries. */
export type Entry = { name: string; act: () => void; isDisabled?: boolean } | null;

/** Closes the menu that is open. */
let open: (() => void) | null = null;
export const closeMenu = (): void => open?.();

/** Distance from the edge of the window, in pixels. */
const MARGIN = 4;

/** Shows a menu at a place of the window; it closes after a choice, at Escape and at a press outside.
 *  The focus returns to where it was. */
export function openMenu(
  root: HTMLElement,
  name: string,
  [x, y]: number[],
  entries: Entry[],
): void {
  closeMenu();
  const focused = document.activeElement as HTMLElement | null;
  const close = (): void => {
    open = null;
    menu.remove();
    removeEventListener("pointerdown", outside, true);
    removeEventListener("blur", close);
    if (focused?.isConnected) focused.focus();
  };
  const outside = (e: Event): void => {
    if (!menu.contains(e.target as Node)) close();
  };
  // Lines are between entries alone.
  const shown = entries.filter(
    (entry, i) => entry || (entries[i - 1] && entries.slice(i).some((later) => later)),
  );
  const items = shown.map((entry) =>
    entry
      ? h(
          "button",
          {
            type: "button",
            role: "menuitem",
            tabindex: "-1",
            disabled: entry.isDisabled === true,
            click: () => {
              close();
              entry.act();
            },
          },
          entry.name,
        )
      : h("hr"),
  );
  const buttons = items.filter((item): item is HTMLButtonElement => item.matches("button:enabled"));
  const menu = h(
    "div",
    {
      class: "menu",
      role: "menu",
      "aria-label": name,
      contextmenu: (e) => e.preventDefault(),
      keydown: (event) => {
        const { key } = event as KeyboardEvent;
        const at = buttons.indexOf(document.activeElement as HTMLButtonElement);
        const to = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: -1 }[key];
        const isChoice = key === "Enter" || key === " ";
        if (to === undefined && !isChoice) close();
        // Other keys do what they do without a menu.
        if (to === undefined && key !== "Escape" && key !== "Tab") return;
        event.preventDefault();
        event.stopPropagation();
        if (to !== undefined) buttons[(to + buttons.length) % buttons.length]?.focus();
      },
    },
    ...items,
  );
  open = close;
  root.append(menu);
  const { width, height } = menu.getBoundingClientRect();
  menu.style.left = `${Math.max(MARGIN, Math.min(x, innerWidth - width - MARGIN))}px`;
  menu.style.top = `${Math.max(MARGIN, Math.min(y, innerHeight - height - MARGIN))}px`;
  addEventListener("pointerdown", outside, true);
  addEventListener("blur", close);
  buttons[0]?.focus();
}
