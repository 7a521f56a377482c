// The page: tabs, the stage, work and its progress, undo, files that are dropped.

import { h } from "../dom";
import type { Hit } from "../layer";
import { type Panel, STANDARD } from "../panel";
import { Stage } from "../stage";
import * as theme from "../theme";
import { add, sub, type V3 } from "../vector";
import type { Viewer } from "../viewer";
import type { Request, SceneRequest, Answer } from "./backend";
import * as backend from "./backend";
import { endingOf, SOLIDS } from "./endings";
import { CompareSpace } from "./compare";
import { History, type Tab, TABS } from "./history";
import { closeMenu, type Entry, openMenu } from "./menu";
import { button, choice } from "./parts";
import { ProgramSpace } from "./program";
import { ScanSpace } from "./scan";
import { SurfaceSpace } from "./surface";

/** Part of the page for one kind of work. */
export interface Space {
  readonly title: string;
  readonly element: HTMLElement;
  /** Shows the state of the project. */
  refresh(): void;
  /** Returns what the stage shows, and a subject whose camera is kept; null for nothing. */
  picture(): { request: SceneRequest; subject: string } | null;
  /** Takes the viewer of a new picture. */
  shown?(viewer: Viewer): void;
  /** Takes the failure of a picture. */
  failed?(error: Error | null): void;
  /** Takes a file; returns false if it is of no use here. */
  open(name: string): Promise<boolean>;
  /** Makes what is being typed a step of the project. */
  settle?(): void;
  /** Returns entries of the menu at a point of a layer. */
  menu?(layer: string, hit: Hit): Entry[];
  /** Leaves what the key Escape leaves; returns false if there is nothing. */
  leave?(): boolean;
}

/** Milliseconds after which a picture that is being made is said. */
const SLOW = 500;
const BUSY = "Other work is going on: wait for it, or cancel it.";
/** Number of command lines that are kept in view. */
const MOST_LINES = 100;

/** Keys of the page and what they do. */
const KEYS: [string, string][] = [
  ["Ctrl Z", "undo"],
  ["Ctrl Shift Z, Ctrl Y", "redo"],
  ["Ctrl O", "open files"],
  ["Ctrl Enter", "do the main work of the tab"],
  ["Esc", "cancel work, leave the selection of points"],
  ["Alt 1 to Alt 4", "tabs"],
  ["?", "this overview"],
  ["arrows, + and −", "turn and zoom the view, with the focus in it"],
  ["F, P, 1 to 4", "fit the view, parallel projection, standard views"],
  ["right button, Shift F10", "menu of what is there"],
];

export class App {
  readonly history = new History();
  readonly stage = new Stage();
  viewer: Viewer | null = null;
  private readonly spaces: Record<Tab, Space>;
  private readonly tabs = new Map<Tab, HTMLButtonElement>();
  private readonly sides = h("div", { class: "side", role: "region", "aria-label": "Work" });
  private readonly settings = h("div", {
    class: "settings",
    role: "region",
    "aria-label": "View and commands",
  });
  private readonly undoButton = button("Undo", () => this.undo());
  private readonly redoButton = button("Redo", () => this.redo());
  private readonly lost = h("p", { class: "lost", role: "alert", hidden: true });
  private readonly phase = h("span", {});
  private readonly bar = h("progress", { max: "1", "aria-label": "Progress" });
  private readonly cancelButton = button("Cancel", () => this.cancel());
  private readonly status = h("div", { class: "work", hidden: true }, this.phase, this.bar);
  private readonly slow = h(
    "div",
    { class: "work", hidden: true },
    "Computing the picture",
    button("Stop", () => this.stop()),
  );
  private readonly said = h("div", { class: "said", role: "status" });
  private readonly lines = h("ol", { class: "lines" });
  private readonly chooser = h("input", { type: "file", multiple: true, hidden: true });
  private readonly help = h("dialog", { "aria-label": "Keys" });
  private readonly title = h("bdi", {});
  private readonly hint = h("div", { class: "empty" });
  private job: AbortController | null = null;
  /** Files that are opened after the work. */
  private waiting: string[] = [];
  private drawing: AbortController | null = null;
  private drawn = "";
  private subject = "";
  /** Buttons that cannot be pressed while there is work. */
  private readonly busyButtons = new Set<HTMLButtonElement>();

  constructor(readonly root: HTMLElement) {
    this.spaces = {
      scan: new ScanSpace(this),
      program: new ProgramSpace(this),
      surface: new SurfaceSpace(this),
      compare: new CompareSpace(this),
    };
    this.build();
    this.listen();
    this.history.onChange = () => this.refresh();
    this.history.onDamage = (error) => this.fail(error);
    this.history.onLost = (why) => {
      this.lost.hidden = why === null;
      this.lost.textContent = why === null ? "" : `The last steps are not stored. ${why}`;
    };
  }

  async start(): Promise<void> {
    const opened = await this.history.load();
    this.title.textContent = this.history.name;
    document.title = `${this.history.name} · Isoform Studio`;
    this.refresh();
    for (const name of opened) await this.take(name);
  }

  private get tab(): Tab {
    return this.history.state.tab;
  }
  private get space(): Space {
    return this.spaces[this.tab];
  }
  get isBusy(): boolean {
    return this.job !== null;
  }

  /** Takes the last step back; work that goes on is one. */
  private undo(): void {
    if (this.isBusy) return this.cancel();
    this.space.settle?.();
    this.say("");
    this.history.undo();
  }
  private redo(): void {
    if (this.isBusy) return;
    this.space.settle?.();
    this.say("");
    this.history.redo();
  }

  /** Creates the elements of the page. */
  private build(): void {
    const list = h("div", { role: "tablist", "aria-label": "Kind of work", class: "tabs" });
    TABS.forEach((tab, i) => {
      const { title, element } = this.spaces[tab];
      const toggle = h(
        "button",
        {
          type: "button",
          role: "tab",
          id: `tab-${tab}`,
          "aria-controls": `space-${tab}`,
          title: `Alt ${i + 1}`,
          click: () => this.turnTo(tab),
          keydown: (e) => this.turn(e as KeyboardEvent, i),
        },
        title,
      );
      this.tabs.set(tab, toggle);
      list.append(toggle);
      element.id = `space-${tab}`;
      element.setAttribute("role", "tabpanel");
      element.setAttribute("aria-labelledby", `tab-${tab}`);
      this.sides.append(element);
    });
    const open = button("Open…", () => this.chooser.click());
    open.title = "Ctrl O, or drop files anywhere";
    const keys = button("?", () => this.help.showModal());
    keys.setAttribute("aria-label", "Keys");
    const colors = choice(
      "Theme",
      theme.THEMES.map((each) => [each, `Theme: ${each}`]),
      (value) => this.setTheme(value as theme.Theme),
    );
    colors.value = theme.chosen();
    const follow = () => {
      colors.value = theme.chosen();
      theme.apply(this.root, theme.chosen());
      this.stage.repaint();
    };
    theme.apply(this.root, theme.chosen());
    // Another window may have changed it.
    addEventListener("focus", follow);
    this.status.append(this.cancelButton);
    const close = button("Close", () => this.help.close());
    this.help.append(
      h("h2", {}, "Keys"),
      h("dl", {}, ...KEYS.flatMap(([key, does]) => [h("dt", {}, key), h("dd", {}, does)])),
      close,
    );
    const commands = h(
      "details",
      { class: "commands" },
      h("summary", {}, "Command line"),
      h("p", {}, "Each step as a command, to be run in the folder of the project:"),
      this.lines,
    );
    this.settings.append(commands);
    this.root.append(
      h(
        "header",
        {},
        h("h1", {}, "Isoform Studio ", h("small", {}, this.title)),
        list,
        h("div", { class: "tools" }, open, this.undoButton, this.redoButton, colors, keys),
      ),
      this.sides,
      h(
        "main",
        { class: "stage" },
        this.stage.panes,
        this.hint,
        this.lost,
        this.slow,
        this.status,
        this.said,
      ),
      this.settings,
      this.chooser,
      this.help,
    );
  }

  private setTheme(chosen: theme.Theme): void {
    theme.choose(this.root, chosen);
    this.stage.repaint();
  }

  private turnTo(tab: Tab): void {
    this.space.settle?.();
    if (!this.isBusy) this.say("");
    this.history.turnTo(tab);
  }

  /** Turns to the neighbour of a tab by arrow keys. */
  private turn(event: KeyboardEvent, i: number): void {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    const tab = TABS[(i + by + TABS.length) % TABS.length];
    this.turnTo(tab);
    this.tabs.get(tab)!.focus();
  }

  private listen(): void {
    this.chooser.addEventListener("change", () => {
      void this.import([...(this.chooser.files ?? [])]);
      this.chooser.value = "";
    });
    addEventListener("dragover", (e) => {
      e.preventDefault();
      this.root.classList.add("is-dragging");
    });
    addEventListener("dragleave", (e) => {
      if (!e.relatedTarget) this.root.classList.remove("is-dragging");
    });
    addEventListener("drop", (e) => {
      e.preventDefault();
      this.root.classList.remove("is-dragging");
      void this.import([...(e.dataTransfer?.files ?? [])]);
    });
    addEventListener("keydown", (e) => this.key(e));
    addEventListener("beforeunload", (e) => {
      if (this.isBusy) e.preventDefault();
    });
    this.stage.onPick = () => this.refresh();
    this.stage.onMenu = (x, y) => this.openMenu(x, y);
  }

  /** Opens the menu at a place of the stage. */
  private openMenu(x: number, y: number): void {
    const { viewer, stage } = this;
    const found = viewer?.hitAt(x, y) ?? null;
    const { camera } = stage.view;
    const atPoint = (point: V3): Entry[] => [
      {
        name: "Turn about this point",
        act: () => {
          const by = sub(point, camera.target);
          viewer?.setCamera({ target: point, position: add(camera.position, by) });
        },
      },
      {
        name: "Copy coordinates",
        act: () => void navigator.clipboard?.writeText(point.join(", ")).catch(() => {}),
      },
    ];
    const ofView: Entry[] = [
      { name: "Fit the view", act: () => stage.act("f") },
      ...STANDARD.map(([name], i) => ({ name: `View ${name}`, act: () => stage.act(`${i + 1}`) })),
      {
        name: camera.orthographic ? "Perspective" : "Parallel projection",
        act: () => stage.act("p"),
      },
    ];
    const own = found ? (this.space.menu?.(found[0].id, found[1]) ?? []) : [];
    const place = stage.space.getBoundingClientRect();
    openMenu(
      this.root,
      "View",
      [place.left + x, place.top + y],
      [...own, ...(found ? atPoint(found[1].point) : []), ...ofView],
    );
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    // Fields and the editor have an undo of their own.
    const isText =
      event.composedPath()[0] instanceof HTMLElement &&
      (event.composedPath()[0] as HTMLElement).closest("input, textarea, select, .cm-editor") !==
        null;
    const control = event.ctrlKey || event.metaKey;
    const key = event.key.toLowerCase();
    const does: [boolean, () => void][] = [
      [control && key === "z" && !event.shiftKey && !isText, () => this.undo()],
      [control && ((key === "z" && event.shiftKey) || key === "y") && !isText, () => this.redo()],
      [control && key === "o", () => this.chooser.click()],
      [
        control && key === "enter",
        () => this.space.element.querySelector<HTMLButtonElement>("button.primary")?.click(),
      ],
      [
        key === "escape" && !target.closest("dialog"),
        () => (this.isBusy ? this.cancel() : this.stop() || this.space.leave?.()),
      ],
      [event.key === "?" && !isText, () => this.help.showModal()],
      [event.altKey && /^[1-4]$/.test(event.key), () => this.turnTo(TABS[Number(event.key) - 1])],
    ];
    const found = does.find(([is]) => is);
    if (!found || target.closest("dialog")) return;
    event.preventDefault();
    found[1]();
  }

  /** Shows the state of the project. */
  refresh(): void {
    closeMenu();
    for (const [tab, toggle] of this.tabs) {
      const is = tab === this.tab;
      toggle.setAttribute("aria-selected", String(is));
      toggle.tabIndex = is ? 0 : -1;
      this.spaces[tab].element.hidden = !is;
    }
    const { undoable, redoable } = this.history;
    this.undoButton.disabled = undoable === null && !this.isBusy;
    this.redoButton.disabled = redoable === null || this.isBusy;
    this.undoButton.title = this.isBusy
      ? "Cancel the work"
      : undoable
        ? `Undo: ${undoable} (Ctrl Z)`
        : "Nothing to undo";
    this.redoButton.title = redoable ? `Redo: ${redoable} (Ctrl Shift Z)` : "Nothing to redo";
    this.space.refresh();
    for (const each of this.busyButtons) each.disabled ||= this.isBusy;
    this.draw();
  }

  /** Marks a button that cannot be pressed while there is work. */
  whileIdle(each: HTMLButtonElement): HTMLButtonElement {
    this.busyButtons.add(each);
    return each;
  }

  /** Draws what the tab shows, unless it is drawn already. */
  draw(): void {
    const { space } = this;
    const picture = space.picture();
    const wanted = JSON.stringify([this.tab, picture?.request ?? null]);
    if (wanted === this.drawn) return;
    this.drawn = wanted;
    this.drawing?.abort();
    const own = (this.drawing = new AbortController());
    const isKept = picture !== null && this.subject === `${this.tab} ${picture.subject}`;
    this.hint.hidden = picture !== null;
    this.hint.replaceChildren(
      h("p", {}, "Drop a file here: a scan, a mesh, a STEP file or a HyperFun program."),
    );
    // An empty picture takes the place of another one alone.
    if (!picture && !this.viewer) return;
    const slow = setTimeout(() => {
      space.failed?.(null);
      this.slow.hidden = false;
    }, SLOW);
    const ended = () => {
      clearTimeout(slow);
      this.slow.hidden = true;
    };
    own.signal.addEventListener("abort", ended);
    const drawn = picture
      ? backend.scene(picture.request, own.signal)
      : Promise.resolve({ version: 1, title: "", layers: [] });
    drawn
      .then(async (scene) => {
        if (own.signal.aborted) return;
        const [viewer, panel] = await this.stage.show(scene, isKept);
        if (own.signal.aborted) return;
        ended();
        this.stage.panes.classList.remove("is-old");
        this.viewer = viewer;
        this.subject = picture ? `${this.tab} ${picture.subject}` : "";
        this.place(panel, picture !== null);
        space.failed?.(null);
        space.shown?.(viewer);
      })
      .catch((error) => {
        if (own.signal.aborted) return;
        ended();
        this.stage.panes.classList.add("is-old");
        if (space.failed) space.failed(error);
        else this.fail(error);
      });
  }

  /** Stops a picture that takes long; returns false if there is none. */
  private stop(): boolean {
    if (this.slow.hidden) return false;
    this.drawing?.abort();
    this.stage.panes.classList.add("is-old");
    return true;
  }

  /** Shows the panel of a picture in place of the last one. */
  private place(panel: Panel, isUsed: boolean): void {
    this.settings.querySelector("aside")?.remove();
    panel.element.setAttribute("aria-label", "View");
    if (isUsed) this.settings.prepend(panel.element);
  }

  /** Does some work with a progress bar; failures are shown. Returns false if there was none. */
  async work(label: string, does: (run: (r: Request) => Promise<Answer>) => Promise<void>) {
    if (this.job) {
      this.fail(new Error(BUSY));
      return false;
    }
    const own = (this.job = new AbortController());
    this.say("");
    this.status.hidden = false;
    this.phase.textContent = label;
    this.bar.removeAttribute("value");
    // A button that is disabled loses the focus, which returns after the work.
    const focused = document.activeElement as HTMLElement | null;
    let isDone = false;
    try {
      this.refresh();
      if (document.activeElement === document.body) this.cancelButton.focus();
      await does((request) =>
        backend.run(request, {
          signal: own.signal,
          onCommand: (line) => this.log(line),
          onProgress: (phase, done) => {
            this.phase.textContent = `${label}: ${phase}`;
            if (done > 0) this.bar.value = done;
            else this.bar.removeAttribute("value");
          },
        }),
      );
      isDone = true;
    } catch (error) {
      if (own.signal.aborted) this.say("Cancelled. Nothing was changed.");
      else this.fail(error as Error);
    } finally {
      this.job = null;
      this.status.hidden = true;
      this.refresh();
      if (document.activeElement === document.body && focused?.isConnected) focused.focus();
      for (const name of this.waiting.splice(0)) void this.take(name);
    }
    return isDone;
  }

  cancel(): void {
    this.job?.abort();
  }

  /** Adds a command line to the list. */
  private log(line: string): void {
    const copy = button("Copy", () => void navigator.clipboard?.writeText(line).catch(() => {}));
    copy.setAttribute("aria-label", `Copy ${line}`);
    this.lines.append(h("li", {}, h("code", {}, line), copy));
    while (this.lines.children.length > MOST_LINES) this.lines.firstChild!.remove();
  }

  /** Says something that is no failure. */
  say(text: string): void {
    this.said.className = "said";
    this.said.replaceChildren(...(text ? [h("span", {}, text), this.closeButton()] : []));
    this.said.hidden = text === "";
  }

  /** Shows a failure with its reason and its remedy. */
  fail(error: Error): void {
    const { why, hint } = error as Partial<backend.Failure>;
    this.said.hidden = false;
    this.said.className = "said is-failure";
    this.said.replaceChildren(
      h("p", {}, h("strong", {}, error.message)),
      ...(why ? [h("p", {}, `Because ${why}.`)] : []),
      ...(hint ? [h("p", {}, `Try: ${hint}`)] : []),
      this.closeButton(),
    );
  }

  private closeButton(): HTMLButtonElement {
    return button("Close", () => this.say(""));
  }

  /** Copies files into the project and opens them. */
  async import(files: File[]): Promise<void> {
    for (const file of files) {
      const name = file.name.replace(/[/\\:*?"<>|\p{Cc}]/gu, "_").replace(/^\.+|[. ]+$/g, "");
      const kept = name.length > 100 ? name.slice(-100) : name || "file";
      try {
        const known = (await backend.files()).map((each) => each.name);
        const target = known.includes(kept)
          ? this.history.fresh(kept.replace(/\.[^.]*$/, ""), endingOf(kept))
          : kept;
        await backend.put(target, file);
        await this.take(target);
      } catch (error) {
        this.fail(error as Error);
      }
    }
  }

  /** Opens a file of the project in the tab that it is for. */
  async take(name: string): Promise<void> {
    if (this.isBusy) {
      this.waiting.push(name);
      return this.say(`${name} is opened when the work is done.`);
    }
    const ending = endingOf(name);
    const tab: Tab =
      ending === "hf"
        ? "program"
        : SOLIDS.includes(ending)
          ? "compare"
          : ending === "json"
            ? "surface"
            : "scan";
    const own = this.tab === "compare" ? "compare" : tab;
    const isTaken = await this.spaces[own].open(name);
    if (!isTaken) {
      this.fail(new Error(`${name} is neither a scan, a mesh, a solid nor a program`));
      return;
    }
    if (own !== this.tab) this.turnTo(own);
  }
}
