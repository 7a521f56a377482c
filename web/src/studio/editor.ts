// Editor of HyperFun programs: colours, completion and help from the table of functions, errors at
// their places.

import {
  autocompletion,
  closeBrackets,
  closeBracketsKeymap,
  type Completion,
  completionKeymap,
  type CompletionContext,
} from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap, indentWithTab } from "@codemirror/commands";
import {
  bracketMatching,
  HighlightStyle,
  StreamLanguage,
  syntaxHighlighting,
} from "@codemirror/language";
import { type Diagnostic, lintGutter, setDiagnostics } from "@codemirror/lint";
import { highlightSelectionMatches, searchKeymap } from "@codemirror/search";
import { EditorState } from "@codemirror/state";
import {
  drawSelection,
  EditorView,
  highlightActiveLine,
  hoverTooltip,
  keymap,
  lineNumbers,
} from "@codemirror/view";
import { tags } from "@lezer/highlight";
import { h } from "../dom";
import type { Document } from "./backend";

/** Function of HyperFun as `isoform functions` describes it. */
export interface FunctionDoc {
  names: string[];
  section: string;
  signature: string;
  help: string;
  example: string;
}

const WORDS = ["array", "if", "then", "else", "endif", "while", "loop", "endloop"];

/** Returns the colours of a program. */
function language(functions: FunctionDoc[]): StreamLanguage<unknown> {
  const known = new Set(functions.flatMap((f) => f.names.map((n) => n.toLowerCase())));
  return StreamLanguage.define({
    token(stream) {
      if (stream.match(/--\s*@.*/)) return "meta";
      if (stream.match(/--.*/)) return "comment";
      if (stream.match(/"[^"]*"?/)) return "string";
      if (stream.match(/\d+(\.\d*)?([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?/)) return "number";
      const word = stream.match(/[A-Za-z_]\w*/) as RegExpMatchArray | null;
      if (word) {
        const name = word[0].toLowerCase();
        if (WORDS.includes(name)) return "keyword";
        return known.has(name) ? "variableName.function" : "variableName";
      }
      if (stream.match(/[-+*/^&|\\~@=<>]/)) return "operator";
      stream.next();
      return null;
    },
    languageData: { commentTokens: { line: "--" } },
  });
}

const COLORS = HighlightStyle.define([
  { tag: tags.comment, color: "var(--code-quiet)" },
  { tag: tags.meta, color: "var(--code-note)" },
  { tag: tags.number, color: "var(--code-number)" },
  { tag: tags.keyword, color: "var(--code-word)", fontWeight: "600" },
  { tag: tags.function(tags.variableName), color: "var(--code-function)" },
  { tag: tags.string, color: "var(--code-number)" },
]);

const LOOK = EditorView.theme({
  "&": { height: "100%", fontSize: "13px", color: "var(--ink)", backgroundColor: "var(--field)" },
  ".cm-content": { caretColor: "var(--ink)", fontFamily: "ui-monospace, monospace" },
  ".cm-gutters": {
    color: "var(--quiet)",
    backgroundColor: "var(--field)",
    borderRight: "1px solid var(--line)",
  },
  ".cm-activeLine, .cm-activeLineGutter": { backgroundColor: "var(--code-line)" },
  "&.cm-focused .cm-selectionBackground, .cm-selectionBackground": {
    backgroundColor: "var(--code-selection) !important",
  },
  ".cm-tooltip": {
    color: "var(--ink)",
    backgroundColor: "var(--page)",
    border: "1px solid var(--line)",
    maxWidth: "420px",
    padding: "2px 6px",
  },
  ".cm-tooltip-autocomplete": { padding: "0" },
  ".cm-scroller": { overflow: "auto" },
});

export class Editor {
  readonly element = h("div", { class: "editor" });
  private readonly view: EditorView;
  /** Callback after the text changed by typing. */
  onType: (text: string) => void = () => {};
  private isSetting = false;

  constructor(label: string, functions: FunctionDoc[]) {
    // Style sheets of a shadow tree are objects, which the policy of the page permits.
    const root = this.element.attachShadow({ mode: "open" });
    const frame = h("div");
    frame.style.height = "100%";
    root.append(frame);
    this.view = new EditorView({
      parent: frame,
      root,
      state: EditorState.create({
        extensions: [
          lineNumbers(),
          history(),
          drawSelection(),
          bracketMatching(),
          closeBrackets(),
          highlightActiveLine(),
          highlightSelectionMatches(),
          language(functions),
          syntaxHighlighting(COLORS),
          autocompletion({ override: [(context) => complete(context, functions)] }),
          hoverTooltip((view, at) => hovered(view, at, functions)),
          lintGutter(),
          LOOK,
          EditorView.contentAttributes.of({ "aria-label": label, tabindex: "0" }),
          EditorView.updateListener.of((update) => {
            if (update.docChanged && !this.isSetting) this.onType(this.text);
          }),
          keymap.of([
            ...closeBracketsKeymap,
            ...defaultKeymap,
            ...searchKeymap,
            ...historyKeymap,
            ...completionKeymap,
            indentWithTab,
          ]),
        ],
      }),
    });
  }

  get text(): string {
    return this.view.state.doc.toString();
  }

  /** Shows another text. */
  set(text: string): void {
    if (text === this.text) return;
    this.isSetting = true;
    this.view.dispatch({ changes: { from: 0, to: this.view.state.doc.length, insert: text } });
    this.isSetting = false;
  }

  /** Inserts a text at the cursor. */
  insert(text: string): void {
    this.view.dispatch(this.view.state.replaceSelection(text));
    this.view.focus();
  }

  /** Underlines an error at a line and column, both from 1; null underlines nothing. */
  mark(error: { message: string; line: number; column: number } | null): void {
    const { doc } = this.view.state;
    const marks: Diagnostic[] = [];
    if (error) {
      const line = doc.line(Math.max(1, Math.min(doc.lines, error.line)));
      const letters = [...line.text].slice(0, error.column - 1).join("").length;
      const from = Math.min(line.to, line.from + letters);
      const word = /^(\w+|.)/u.exec(doc.sliceString(from, line.to))?.[0].length ?? 1;
      const to = Math.min(Math.max(from, line.to), from + word);
      marks.push({ from, to, severity: "error", message: error.message });
    }
    this.view.dispatch(setDiagnostics(this.view.state, marks));
  }
}

function complete(context: CompletionContext, functions: FunctionDoc[]) {
  const word = context.matchBefore(/[A-Za-z_]\w*/);
  if (!word && !context.explicit) return null;
  const own = [...new Set(context.state.doc.toString().match(/[A-Za-z_]\w*/g) ?? [])];
  const known = new Set(functions.flatMap((f) => f.names));
  const options: Completion[] = [
    ...functions.flatMap((f) =>
      f.names.map((name) => ({
        label: name,
        type: "function",
        detail: f.signature.slice(f.signature.indexOf("(")),
        info: f.help,
        apply: `${name}(`,
      })),
    ),
    ...WORDS.map((label) => ({ label, type: "keyword" })),
    ...own.filter((name) => !known.has(name)).map((label) => ({ label, type: "variable" })),
  ];
  return { from: word ? word.from : context.pos, options, validFor: /^\w*$/ };
}

function hovered(view: EditorView, at: number, functions: FunctionDoc[]) {
  const line = view.state.doc.lineAt(at);
  const before = /\w*$/.exec(line.text.slice(0, at - line.from))![0];
  const after = /^\w*/.exec(line.text.slice(at - line.from))![0];
  const name = (before + after).toLowerCase();
  const found = functions.find((f) => f.names.some((n) => n.toLowerCase() === name));
  if (!found) return null;
  return {
    pos: at - before.length,
    end: at + after.length,
    above: true,
    create: () => ({
      dom: h("div", {}, h("code", {}, found.signature), h("p", {}, found.help)),
    }),
  };
}

/** Returns the functions of a document of `isoform functions`. */
export const functionsOf = (document: Document): FunctionDoc[] => document.functions;
