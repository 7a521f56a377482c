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
/** The text of a bundle: a script, or a style. A script begins with the licences of the packages
 *  that it holds. */
async function bundled(entry, title) {
  const isStyle = entry.endsWith(".css");
  const { outputFiles, metafile } = await build({
    ...common,
    entryPoints: [entry],
    format: isStyle ? undefined : "iife",
    target: "es2022",
    legalComments: "none",
    metafile: true,
  });
  const packages = Object.keys(metafile.inputs)
    .map((path) => /^node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1])
    .filter((name) => name);
  const notices = new Map();
  for (const name of new Set(packages.sort())) {
    const licence = readFileSync(join(here, "node_modules", name, "LICENSE"), "utf8").trim();
    notices.set(licence, [...(notices.get(licence) ?? []), name]);
  }
  const texts = [...notices].map(([licence, names]) => `${names.join(", ")}:\n${licence}`);
  const head = texts.length
    ? `/*! ${title} of Isoform, MIT OR Apache-2.0. Holds\n${texts.join("\n\n")}\n*/\n`
    : "";
  return head + outputFiles[0].text.trim();
}
const texts = {
  "viewer.js": await bundled("src/main.ts", "The viewer"),
  "viewer.css": await bundled("src/style.css"),
  "served.js": await bundled("src/served.ts"),
  "served.css": await bundled("src/served.css"),
  "studio.js": await bundled("src/studio/main.ts", "The studio"),
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
