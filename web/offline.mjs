// Writes Isoform Studio as one file that needs no server: the page with the program as WebAssembly.
//
//   node offline.mjs ../target/wasm/isoform.wasm ../target/wasm/studio.html
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";
import { bundled } from "./bundle.mjs";

const [source, target] = process.argv.slice(2);
/** Notices of the C library in the module. */
const notices = readFileSync("/usr/share/doc/wasi-libc/copyright", "utf8").replaceAll("--", "- -");
const module = gzipSync(readFileSync(source), { level: 9 }).toString("base64");
const worker = await bundled("src/wasm/worker.ts", "The worker");
const script = await bundled("src/studio/offline-main.ts", "The studio", {
  format: "esm",
  define: { WORKER: JSON.stringify(worker) },
});
const style = await bundled("src/studio/studio.css");
const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
const policy =
  `default-src 'none'; script-src ${hash(script)} 'wasm-unsafe-eval'; style-src ${hash(style)}; ` +
  "img-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'";
const page = `<!DOCTYPE html>
<!-- The program in this page holds wasi-libc:
${notices}
-->
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="${policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Isoform Studio</title>
<style>${style}</style>
</head>
<body>
<noscript><p>This page works by a script of its own, which the browser does not run.</p></noscript>
<div data-isoform-studio></div>
<script type="application/octet-stream" data-isoform-module>${module}</script>
<script type="module">${script}</script>
</body>
</html>
`;
writeFileSync(target, page);
console.log(`${target}: ${page.length} bytes`);
