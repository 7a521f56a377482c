// Bundles the viewer into the assets of the crate isoform-view: script, style, and their hashes.
//
//   node build.mjs            writes them
//   node build.mjs --check    says whether they are up to date, by exit code
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { bundled, here } from "./bundle.mjs";

const assets = join(here, "../crates/isoform-view/assets");
const texts = {
  "viewer.js": await bundled("src/main.ts", "The viewer"),
  "viewer.css": await bundled("src/style.css"),
  "served.js": await bundled("src/served.ts"),
  "served.css": await bundled("src/served.css"),
  "studio.js": await bundled("src/studio/main.ts", "The studio"),
  "studio.css": await bundled("src/studio/studio.css"),
};
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
