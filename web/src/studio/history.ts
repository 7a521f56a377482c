// State of a project, and the steps by which it came about.

import type { Document, Stored } from "./backend";
import * as backend from "./backend";

export const TABS = ["scan", "program", "surface", "compare"] as const;
export type Tab = (typeof TABS)[number];

/** Result of a fit: its document and its files, by their endings. */
export interface FitState {
  document: string;
  files: Record<string, string>;
}
/** State of the work on a scan. */
export interface ScanState {
  /** File of the points; empty if there is none. */
  file: string;
  /** Unit of length that the user chose; empty to guess. */
  unit: string;
  /** Points with the numbers of their faces; empty if nothing was recognised. */
  labels: string;
  /** Document of the faces. */
  faces: string;
  /** True if a person corrected the faces. */
  isCorrected: boolean;
  /** Kinds that a person chose, by the number of the face. */
  kinds: Record<string, string>;
  /** Relations of faces that a person stated, such as "parallel=0,3", separated by spaces. */
  relations: string;
  /** Values at which dimensions are held. */
  fixed: Record<string, number>;
  /** Template that a person gave or changed; empty to propose one. */
  template: string;
  fit: FitState | null;
}
export interface ProgramState {
  name: string;
  text: string;
}
export interface SurfaceState {
  kind: "implicit" | "map";
  /** Formulas: F alone, or X, Y, Z and W. */
  F: string;
  X: string;
  Y: string;
  Z: string;
  W: string;
  /** Half the width of the box; empty to choose it. */
  box: string;
}
export interface CompareState {
  first: string;
  second: string;
  /** Largest deviation that passes; empty for none. */
  tolerance: string;
  isAligned: boolean;
  /** Document of the comparison, and the points with their deviations. */
  document: string;
  points: string;
}
export interface State {
  tab: Tab;
  scan: ScanState;
  program: ProgramState;
  surface: SurfaceState;
  compare: CompareState;
}

interface Step {
  label: string;
  state: State;
}

/** Program of a new project. */
export const FIRST_PROGRAM = `-- A plate with a hole. Move the sliders, or change the text.
-- @param a[1] length length typical=40 min=10 max=80
-- @param a[2] radius length typical=6 min=1 max=12
my_model(x[3], a[2])
{
  array corner[3], center[3];
  corner = [0, 0, 0];
  center[1] = a[1]/2; center[2] = 15; center[3] = 0;
  plate = hfBlock(x, corner, a[1], 30, 6);
  hole = hfCylinderZ(x, center, a[2]);
  my_model = plate \\ hole;
}
`;

/** State of a new project. */
export const EMPTY: State = {
  tab: "scan",
  scan: {
    file: "",
    unit: "",
    labels: "",
    faces: "",
    isCorrected: false,
    kinds: {},
    relations: "",
    fixed: {},
    template: "",
    fit: null,
  },
  program: { name: "model.hf", text: FIRST_PROGRAM },
  surface: {
    kind: "implicit",
    F: "x^2 + y^2 + z^4 = 1",
    X: "2*s",
    Y: "2*t",
    Z: "s^2 + t^2 - 1",
    W: "s^2 + t^2 + 1",
    box: "",
  },
  compare: { first: "", second: "", tolerance: "", isAligned: false, document: "", points: "" },
};

/** Maximum number of steps that can be undone. */
const MOST_STEPS = 200;
/** Milliseconds before the next request if the server did not answer. */
const AGAIN = 2000;

/** Version of the documents of states. */
const SCHEMA = 1;

/** Returns a part of a state with the keys of a new one; values of other types are those of a new
 *  one, too. */
function completed<T extends object>(part: unknown, fresh: T): T {
  const given = (part ?? {}) as Record<string, unknown>;
  const kept = Object.entries(fresh).map(([key, value]) => {
    const own = given[key];
    const isSame = typeof own === typeof value && own !== null && !Array.isArray(own);
    return [key, isSame ? own : value];
  });
  return Object.fromEntries(kept) as T;
}

/** Returns the state of a document. */
function stateOf(document: unknown): State {
  const state = (document ?? {}) as Record<string, unknown>;
  const scan = completed(state.scan, EMPTY.scan);
  const { fit } = (state.scan ?? {}) as { fit?: FitState };
  const files = Object.entries(fit?.files ?? {});
  const isFit =
    typeof fit?.document === "string" &&
    ["hf", "ply"].every((ending) => files.some(([key]) => key === ending)) &&
    files.every(([, name]) => typeof name === "string");
  const numbers = Object.entries(scan.fixed).filter(([, v]) => typeof v === "number");
  const kinds = Object.entries(scan.kinds).filter(([, v]) => typeof v === "string");
  return {
    tab: TABS.find((name) => name === state.tab) ?? EMPTY.tab,
    scan: {
      ...scan,
      fixed: Object.fromEntries(numbers),
      kinds: Object.fromEntries(kinds),
      fit: isFit ? fit! : null,
    },
    program: completed(state.program, EMPTY.program),
    surface: completed(state.surface, EMPTY.surface),
    compare: completed(state.compare, EMPTY.compare),
  };
}

/** Returns the steps of a document of the project; null if it has another form. */
function stepsOf(document: Document): { steps: Step[]; at: number; next: number } | null {
  const { steps, at, next } = document;
  const isStep = (step: Document): boolean =>
    typeof step?.label === "string" && typeof step.state === "object" && step.state !== null;
  if (!Array.isArray(steps) || !steps.length || !steps.every(isStep)) return null;
  const last = steps.length - 1;
  return {
    steps: steps.map(({ label, state }) => ({ label, state: stateOf(state) })),
    at: Math.max(0, Math.min(last, Math.floor(Number(at)) || 0)),
    next: Math.max(1, Math.floor(Number(next)) || 1),
  };
}

export class History {
  private steps: Step[] = [{ label: "New project", state: EMPTY }];
  private at = 0;
  private version = 0;
  /** Number of the next file that work writes. */
  private next = 1;
  private saving: Promise<void> = Promise.resolve();
  private isUnsaved = false;
  /** True if the project is that of a newer version, which is not changed. */
  private isFrozen = false;
  name = "";
  /** Callback after each change of the state. */
  onChange: (isOfAnotherWindow: boolean) => void = () => {};
  /** Callback when the document of the project is not that of a state. */
  onDamage: (error: Error) => void = () => {};
  /** Callback when the state could not be stored; null when it could again. */
  onLost: (why: string | null) => void = () => {};

  /** Reads the state from the server; returns files that are to be opened. */
  async load(): Promise<string[]> {
    const stored = await backend.stored();
    try {
      this.take(stored);
    } catch (error) {
      this.onDamage(error as Error);
    }
    void this.follow();
    return this.isFrozen ? [] : stored.opened;
  }

  private take({ version, name, document }: Stored): void {
    this.version = version;
    this.name = name;
    if (document === null) return;
    const { schema } = document as { schema?: number };
    if (typeof schema === "number" && schema > SCHEMA) {
      this.isFrozen = true;
      throw new Error("A newer version made this project. It is not opened, and not changed.");
    }
    const kept = stepsOf(document);
    if (!kept) {
      const copy = "project.damaged.copy.json";
      void backend.put(copy, JSON.stringify(document));
      throw new Error(`The project is damaged. It begins anew, and ${copy} has what it was.`);
    }
    this.steps = kept.steps;
    this.at = kept.at;
    this.next = Math.max(this.next, kept.next);
  }

  get state(): State {
    return this.steps[this.at].state;
  }
  /** Label of the step that undo takes back; null if there is none. */
  get undoable(): string | null {
    return this.at > 0 ? this.steps[this.at].label : null;
  }
  get redoable(): string | null {
    return this.steps[this.at + 1]?.label ?? null;
  }

  /** Returns a name for a new file: a stem, a number that no file has, and an ending. */
  fresh(stem: string, ending: string): string {
    return `${stem.slice(0, 80)}-${this.next++}.${ending}`;
  }

  /** Adds a step. A step of the same label replaces the last one if it `joins` it. */
  commit(label: string, change: Partial<State>, joins = false): void {
    const state = { ...this.state, ...change };
    const last = this.steps[this.at];
    if (joins && last.label === label && this.at === this.steps.length - 1 && this.at > 0) {
      this.steps[this.at] = { label, state };
    } else {
      this.steps = [...this.steps.slice(0, this.at + 1), { label, state }].slice(-MOST_STEPS);
      this.at = this.steps.length - 1;
    }
    this.changed();
  }

  /** Shows another tab, which is not a step of the work. */
  turnTo(tab: Tab): void {
    const last = this.steps[this.at];
    this.steps[this.at] = { ...last, state: { ...last.state, tab } };
    this.changed();
  }

  undo(): void {
    if (this.at > 0) this.move(this.at - 1);
  }
  redo(): void {
    if (this.at + 1 < this.steps.length) this.move(this.at + 1);
  }
  private move(at: number): void {
    const tab = this.steps[Math.max(at, this.at)].state.tab;
    this.at = at;
    const step = this.steps[at];
    this.steps[at] = { ...step, state: { ...step.state, tab } };
    this.changed();
  }

  private changed(): void {
    this.onChange(false);
    this.save();
  }

  private save(): void {
    if (this.isUnsaved || this.isFrozen) return;
    this.isUnsaved = true;
    this.saving = this.saving.then(async () => {
      this.isUnsaved = false;
      const { steps, at, next } = this;
      try {
        const result = await backend.store(this.version, { schema: SCHEMA, steps, at, next });
        if (typeof result === "number") this.version = result;
        else {
          this.take(result);
          this.onChange(true);
        }
        this.onLost(null);
      } catch (error) {
        this.onLost((error as Error).message);
        await new Promise((f) => setTimeout(f, AGAIN));
        this.save();
      }
    });
  }

  /** Resolves when all steps are stored. */
  async saved(): Promise<void> {
    while (this.isUnsaved) await this.saving;
    await this.saving;
  }

  /** Follows the changes of other windows. */
  private async follow(): Promise<void> {
    for (;;) {
      try {
        if (document.hidden) await new Promise((f) => setTimeout(f, AGAIN));
        const version = await backend.news(this.version);
        await this.saving;
        if (version <= this.version) continue;
        this.take(await backend.stored());
        this.onChange(true);
      } catch {
        await new Promise((f) => setTimeout(f, AGAIN));
      }
    }
  }
}
