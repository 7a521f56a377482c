// Tests of Isoform Studio as one file, opened from disk: node --test test/offline.mjs
//
// They need Chromium (CHROMIUM) and target/wasm/studio.html, which scripts/wasm.sh makes.
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { after, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const file = join(root, "target/wasm/studio.html");
const skip = existsSync(file) ? false : `${file} is missing: scripts/wasm.sh makes it`;
const browser = skip
  ? null
  : await chromium.launch({
      executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
      args: ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    });
after(() => browser?.close());

test(
  "a file on disk meshes programs, certifies maps and makes STEP of a mesh",
  { skip },
  async () => {
    const page = await browser.newPage({ viewport: { width: 1360, height: 860 } });
    page.setDefaultTimeout(120_000);
    const errors = [];
    page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
    page.on("pageerror", (e) => errors.push(String(e)));
    const foreign = [];
    page.on("request", (r) => !/^(file|blob|data):/.test(r.url()) && foreign.push(r.url()));
    await page.goto(pathToFileURL(file).href);
    await page.getByRole("tab", { name: "Program" }).waitFor();
    await page.evaluate("isoform.ready");
    const told = (name, text) =>
      page.getByRole("tabpanel", { name, exact: true }).getByText(text).waitFor();
    const press = (name) => page.getByRole("button", { name, exact: true }).click();
    await page.getByRole("tab", { name: "Program" }).click();
    await press("Mesh and certify");
    await told("Program", "The certificate holds.");
    await page.getByRole("tab", { name: "Surface" }).click();
    await page.getByRole("combobox", { name: "Examples" }).selectOption("Roman surface");
    await press("Triangulate and certify");
    await told("Surface", "The certificate holds.");
    await page.getByRole("tab", { name: "Scan" }).click();
    await page.getByRole("combobox", { name: "Examples" }).selectOption("testpart");
    await page.getByText(/points, .* × .* × /).waitFor();
    await press("Make a CAD model");
    await page.getByText("The model explains the scan.").waitFor();
    const [download] = await Promise.all([page.waitForEvent("download"), press("STEP")]);
    assert.match(readFileSync(await download.path(), "latin1"), /^ISO-10303-21/);
    assert.deepEqual([errors, foreign], [[], []]);
  },
);
