// Bundles the viewer into the assets of the crate isoform-view: script, style, and their hashes.
//
//   node build.mjs            writes them
//   node build.mjs --check    says whether they are up to date, by exit code
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const assets = join(here, "../crates/isoform-view/assets");
const common = { bundle: true, minify: true, write: false, absWorkingDir: here, charset: "ascii" };
const licence = readFileSync(join(here, "node_modules/three/LICENSE"), "utf8").trim();
const script = await build({
  ...common,
  entryPoints: ["src/main.ts"],
  format: "iife",
  target: "es2022",
  legalComments: "none",
  banner: { js: `/*! The viewer of Isoform, MIT OR Apache-2.0. Holds three.js:\n${licence}\n*/` },
});
const style = await build({ ...common, entryPoints: ["src/style.css"], target: "es2022" });
const texts = {
  "viewer.js": script.outputFiles[0].text.trim(),
  "viewer.css": style.outputFiles[0].text.trim(),
};
if (/<\/(script|style)/i.test(Object.values(texts).join())) {
  throw new Error("the bundle would end its own element");
}
const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'\n`;
texts["hashes.txt"] = hash(texts["viewer.js"]) + hash(texts["viewer.css"]);

let isSame = true;
mkdirSync(assets, { recursive: true });
for (const [name, text] of Object.entries(texts)) {
  const path = join(assets, name);
  if (process.argv.includes("--check")) {
    isSame &&= readFileSync(path, "utf8") === text;
  } else {
    writeFileSync(path, text);
    console.log(name, text.length, "bytes");
  }
}
if (!isSame) {
  console.error("assets are not what the sources build: node build.mjs");
  process.exit(1);
}
