// Buttons of reports: tables and drawings are copied and saved.

import { h } from "./dom";

/** Adds buttons to the elements of a document with `data-save`, the name of a file. */
export function addSaving(document: Document): void {
  for (const part of document.querySelectorAll<HTMLElement>("[data-save]")) {
    const name = part.dataset.save ?? "";
    const table = part.querySelector("table");
    const drawing = part.querySelector("svg");
    const buttons: HTMLButtonElement[] = [];
    if (name.endsWith(".csv") && table) {
      buttons.push(
        button("Copy table", () => copy(table)),
        // With all digits, where the page has them.
        button("Save CSV", () =>
          save(name, "text/csv", part.dataset.csv?.replaceAll("\n", "\r\n") ?? csv(table)),
        ),
      );
    } else if (name.endsWith(".svg") && drawing) {
      buttons.push(button("Save SVG", () => save(name, "image/svg+xml", standalone(drawing))));
    }
    if (buttons.length) part.prepend(h("div", { class: "save" }, ...buttons));
  }
}

function button(label: string, click: () => void): HTMLButtonElement {
  return h("button", { type: "button", click }, label);
}

/** Copies an element as it is selected, so that spreadsheets and texts get a table. */
function copy(part: Element): void {
  const selection = getSelection();
  if (!selection) return;
  selection.removeAllRanges();
  selection.selectAllChildren(part);
  document.execCommand("copy");
  selection.removeAllRanges();
}

/** Returns the cells of a table between commas. */
function csv(table: HTMLTableElement): string {
  const rows = [...table.rows].map((row) => [...row.cells].map(text).map(quoted).join(","));
  return `${rows.join("\r\n")}\r\n`;
}

/** Text of a cell without the remark below it. */
function text(cell: Element): string {
  const name = cell.querySelector("b");
  return ((name ?? cell).textContent ?? "").trim();
}

function quoted(text: string): string {
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Returns a drawing of the page as a file, with the style that the page gives it. */
function standalone(drawing: SVGElement): string {
  const copy = drawing.cloneNode(true) as SVGElement;
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  const rules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]);
  const own = rules.filter((rule) => /(^|[\s,])(\.sheet|svg text)\b/.test(rule.cssText));
  const style = document.createElementNS("http://www.w3.org/2000/svg", "style");
  style.textContent = own.map((rule) => rule.cssText).join("\n");
  copy.prepend(style);
  return new XMLSerializer().serializeToString(copy);
}

function save(name: string, type: string, content: string): void {
  const address = URL.createObjectURL(new Blob([content], { type }));
  h("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
