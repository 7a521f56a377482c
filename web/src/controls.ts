// Camera control by mouse, touch and keys; a click picks a point, the right button opens a menu.

import type { View } from "./view";

/** Rotation in radians per pixel of a drag, and per press of an arrow key. */
const PER_PIXEL = 0.007;
const PER_KEY = 0.1;
/** Maximum movement of a press, in pixels, that counts as a click. */
const CLICK = 4;

export function control(
  view: View,
  pick: (x: number, y: number) => void,
  act: (key: string) => void,
  menu: (x: number, y: number) => void,
): void {
  const { pane } = view;
  const pointers = new Map<number, [number, number]>();
  let moved = 0;
  const place = (e: MouseEvent): [number, number] => {
    const box = pane.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };

  pane.addEventListener("pointerdown", (e) => {
    if ((e.target as HTMLElement).closest("button, input, select")) return;
    pane.setPointerCapture(e.pointerId);
    if (!pointers.size) moved = 0;
    pointers.set(e.pointerId, place(e));
  });
  pane.addEventListener("pointermove", (e) => {
    const old = pointers.get(e.pointerId);
    if (!old) return;
    const now = place(e);
    const [dx, dy] = [now[0] - old[0], now[1] - old[1]];
    moved += Math.abs(dx) + Math.abs(dy);
    const other = [...pointers].find(([id]) => id !== e.pointerId)?.[1];
    if (other) {
      // Half of the movement of one finger pans, the change of the gap zooms.
      view.pan(dx / 2, dy / 2);
      const gap = (p: [number, number]) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      view.zoom(gap(old) / gap(now), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
    } else if (e.shiftKey || e.ctrlKey || e.buttons & 6) view.pan(dx, dy);
    else view.turn(dx * PER_PIXEL, dy * PER_PIXEL);
    pointers.set(e.pointerId, now);
  });
  const end = (e: PointerEvent, isClick: boolean) => {
    if (!pointers.delete(e.pointerId)) return;
    if (isClick && !pointers.size && moved < CLICK) (e.button === 2 ? menu : pick)(...place(e));
  };
  pane.addEventListener("pointerup", (e) => end(e, true));
  pane.addEventListener("pointercancel", (e) => end(e, false));
  pane.addEventListener("contextmenu", (e) => {
    e.preventDefault();
    // The right button may begin a drag; its click is seen when it ends.
    if (e.pointerType === "touch") {
      pointers.clear();
      menu(...place(e));
    }
  });
  pane.addEventListener(
    "wheel",
    (e) => {
      // In an embedded view the wheel scrolls the surrounding page until the pane has the focus.
      const isChosen = document.activeElement === pane || e.ctrlKey;
      if (pane.closest("[data-isoform-view=embedded]") && !isChosen) return;
      e.preventDefault();
      const lines = e.deltaMode === 1 ? 16 : 1;
      view.zoom(Math.exp(Math.max(-600, Math.min(600, e.deltaY * lines)) * 0.0015), place(e));
    },
    { passive: false },
  );

  const keys: Record<string, (isShifted: boolean) => void> = {
    ArrowLeft: (s) => (s ? view.pan(30, 0) : view.turn(PER_KEY, 0)),
    ArrowRight: (s) => (s ? view.pan(-30, 0) : view.turn(-PER_KEY, 0)),
    ArrowUp: (s) => (s ? view.pan(0, 30) : view.turn(0, PER_KEY)),
    ArrowDown: (s) => (s ? view.pan(0, -30) : view.turn(0, -PER_KEY)),
    "+": () => view.zoom(0.85),
    "=": () => view.zoom(0.85),
    "-": () => view.zoom(1 / 0.85),
  };
  pane.addEventListener("keydown", (e) => {
    if (e.target !== pane || e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.key === "ContextMenu" || (e.key === "F10" && e.shiftKey)) {
      e.preventDefault();
      return menu(pane.clientWidth / 2, pane.clientHeight / 2);
    }
    const key = keys[e.key];
    if (key) {
      e.preventDefault();
      key(e.shiftKey);
    } else if (e.key === "Enter") pick(pane.clientWidth / 2, pane.clientHeight / 2);
    else act(e.key);
  });
}
