// Bundles of the scripts and style sheets of src.
import { build } from "esbuild";
import { readdirSync, readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

export const here = dirname(fileURLToPath(import.meta.url));
const common = { bundle: true, minify: true, write: false, absWorkingDir: here, charset: "ascii" };
/** The text of a bundle: a script, or a style. A script begins with the licences of the packages
 *  that it holds. */
export async function bundled(entry, title, more = {}) {
  const isStyle = entry.endsWith(".css");
  const { outputFiles, metafile } = await build({
    ...common,
    entryPoints: [entry],
    format: isStyle ? undefined : "iife",
    target: "es2022",
    legalComments: "none",
    metafile: true,
    ...more,
  });
  const packages = Object.keys(metafile.inputs)
    .map((path) => /^node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1])
    .filter((name) => name);
  const notices = new Map();
  for (const name of new Set(packages.sort())) {
    const folder = join(here, "node_modules", name);
    const file = readdirSync(folder).find((name) => /^licen[cs]e(-mit)?(\.\w+)?$/i.test(name));
    if (!file) throw new Error(`${name} has no licence`);
    const licence = readFileSync(join(folder, file), "utf8").trim();
    notices.set(licence, [...(notices.get(licence) ?? []), name]);
  }
  const texts = [...notices].map(([licence, names]) => `${names.join(", ")}:\n${licence}`);
  const head = texts.length
    ? `/*! ${title} of Isoform, MIT OR Apache-2.0. Holds\n${texts.join("\n\n")}\n*/\n`
    : "";
  const text = head + outputFiles[0].text.trim();
  if (/<\/(script|style)/i.test(text)) throw new Error(`${entry} would end its own element`);
  return text;
}
