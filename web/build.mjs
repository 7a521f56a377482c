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
/** The text of a bundle: a script, or a style. */
async function bundled(entry, more = {}) {
  const made = await build({
    ...common,
    entryPoints: [entry],
    format: entry.endsWith(".css") ? undefined : "iife",
    target: "es2022",
    legalComments: "none",
    ...more,
  });
  return made.outputFiles[0].text.trim();
}
const banner = `/*! The viewer of Isoform, MIT OR Apache-2.0. Holds three.js:\n${licence}\n*/`;
const texts = {
  "viewer.js": await bundled("src/main.ts", { banner: { js: banner } }),
  "viewer.css": await bundled("src/style.css"),
  "served.js": await bundled("src/served.ts"),
  "served.css": await bundled("src/served.css"),
  "studio.js": await bundled("src/studio/main.ts", { banner: { js: banner } }),
  "studio.css": await bundled("src/studio/studio.css"),
};
if (/<\/(script|style)/i.test(Object.values(texts).join())) {
  throw new Error("the bundle would end its own element");
}
const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'\n`;
texts["hashes.txt"] = Object.values(texts).map(hash).join("");

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
