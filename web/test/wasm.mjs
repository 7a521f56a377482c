// Compares the module of scripts/wasm.sh with the native program: node --test test/wasm.mjs
//
// Every command gives the same exit code, the same document but for its times, the same messages and
// the same files, byte by byte. Where the results are others, functions such as `sin` may be why: the
// native program has those of the system's C library, the module musl's, and they round the last bit
// otherwise here and there. Such a command is run again by the native program with musl's functions
// (Debian's musl-dev), and then nothing may differ. A table shows times, and what has differed.
import { build } from "esbuild";
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { cpSync, existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, dirname, join, relative } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const web = join(dirname(fileURLToPath(import.meta.url)), "..");
const repository = join(web, "..");
const target = process.env.CARGO_TARGET_DIR ?? join(repository, "target");
const module = join(target, "wasm/isoform.wasm");
const native = join(target, "release/isoform");
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** Files that commands read, from these folders of the repository. */
const INPUTS = [
  "tests/data/fitting/testpart_clean.xyz",
  "tests/data/fitting/testpart_noise0.01.xyz",
  "tests/data/fitting/testpart_noise0.05.xyz",
  "tests/data/formats/cube-e57-1.0-unmodified-valid.e57",
  "tests/data/formats/pynt_simple.las",
  "tests/data/formats/pynt_simple.laz",
  "tests/data/formats/tm_P_XPM_0331_01.3mf",
  "tests/data/formats/tm_multibody.stl",
  "tests/data/hyperfun/comp_gyroid_sheet.hf",
  "tests/data/hyperfun/lib_hfSuperell.hf",
  "tests/data/step/mixed-ap242-inch.step",
  "tests/data/step/torus-void.step",
  "examples/fe/lug.hf",
  "examples/surfaces/cross-cap.json",
  "examples/surfaces/stereographic-sphere.json",
  "examples/surfaces/torus.json",
  "examples/surfaces/whitney-umbrella.json",
  "examples/templates/block-holes.hf",
  "examples/templates/flange.hf",
];
/** Commands; a word in quotes is one word. */
const COMMANDS = `
recognize testpart_clean.xyz -o entities.json -o labels.ply --json
recognize testpart_noise0.05.xyz --snap -o part.hf --json
fit testpart_noise0.01.xyz testpart -o fitted.hf -o deviation.ply --json
recover --json
recover testpart_clean.xyz testpart -o rec.step --json
mesh cup -o cup.msh -o cup.inp --json
mesh lug.hf --size 4 --order 2 -o lug.vtu --json
mesh flange.hf --surface-only -o flange.obj --json
mesh comp_gyroid_sheet.hf --params 3,0.5 --box=-1,-1,-1,1,1,1 --size 0.15 -o gyroid.vtu --json
mesh "x^2 + y^2 + z^4 = 1" --size 0.2 -o print.stl --json
convert tm_multibody.stl -o print.stl --json
mesh "sin(3*x) + sin(3*y) + sin(3*z) = 0" --box=-1,-1,-1,1,1,1 --surface-only -o waves.ply --json
mesh mixed-ap242-inch.step -o mixed.stl --json
brep block-holes.hf -o block.step -o block.brep.json --json
brep flange.hf -o flange.step --json
triangulate stereographic-sphere.json --box 2 -o sphere.obj --json
triangulate torus.json --box 4 -o torus.ply --domain domain.svg --json
triangulate whitney-umbrella.json --box 2 -o whitney.obj --json
triangulate cross-cap.json --box 2 -o cross.obj --report report.json --json
parameterize "x^2 + y^2 + z^2 = 1" --degree 2,2 --paper -o patch.json --json
parameterize "(x^2 + y^2 + z^2 + 3/4)^2 = 4*(x^2 + y^2)" --degree 2,2 --cover --tol 1e-2 -o torus.step --json
implicitize testpart_clean.xyz -o surface.json --json
implicitize testpart_clean.xyz --global 4 -o global.json --json
eval lib_hfSuperell.hf --points points.csv --params 1,1,1,0.5,0.7
eval "x^2 + exp(y) - sin(z) = 0" --points points.csv -o values.csv --json
inspect pynt_simple.laz --json
inspect cube-e57-1.0-unmodified-valid.e57 --json
inspect torus-void.step --json
convert pynt_simple.las -o cloud.ply --json
convert tm_P_XPM_0331_01.3mf -o part.stl --json
compare testpart_clean.xyz flange.hf -o away.csv --json
compare tm_multibody.stl torus-void.step --json
view torus.json --box 4 -o torus.html --json
render block-holes.hf -o block.png --json
functions
functions hfBlock --json
schema
run request.json --json
inspect - --from xyz --json
mesh missing.hf -o missing.msh --json
mesh ünder.hf -o ünder.msh --json
recognize testpart_clean.xyz -o testpart_clean.xyz --json
`
  .trim()
  .split("\n");
/** Files that tests write, and the standard input of all commands. */
const POINTS = Array.from({ length: 400 }, (_, k) =>
  [k, k * k, k * k * k].map((n) => ((n * 0.618034) % 2) - 1).join(","),
).join("\n");
const REQUEST = { verb: "mesh", model: "sphere", size: 0.3, output: ["ball.msh"], json: true };
const STDIN = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n";
const words = (command) => command.match(/"[^"]*"|\S+/g).map((word) => word.replace(/^"|"$/g, ""));

/** Returns all files below a folder, by their names. */
function files(folder) {
  const names = readdirSync(folder, { recursive: true, withFileTypes: true });
  return new Map(
    names
      .filter((entry) => entry.isFile())
      .map((entry) => join(entry.parentPath, entry.name))
      .map((path) => [relative(folder, path), readFileSync(path)]),
  );
}

/** Functions of the C library that the native program calls and that round the last bit. */
const FUNCTIONS =
  "acos asin atan atan2 cos cosh exp exp2 hypot log log10 log1p log2 pow sin sincos sinh tan tanh";
/** Makes a library of musl's functions, to be loaded before the system's; `null` if it cannot. */
function muslFunctions(folder) {
  const [library, exported] = [join(folder, "libm.so"), join(folder, "exported")];
  const names = FUNCTIONS.split(" ");
  writeFileSync(exported, `{ global: ${names.join("; ")}; local: *; };`);
  const musl = "/usr/lib/x86_64-linux-musl/libc.a";
  const asked = names.map((name) => `-Wl,-u,${name}`);
  const args = ["-shared", "-nostdlib", "-o", library, `-Wl,--version-script=${exported}`];
  const made = spawnSync("gcc", [...args, ...asked, musl]);
  return made.status === 0 ? library : null;
}

/** Runs the native program in a folder; the time is that of its processor, in seconds. */
function runNative(command, cwd, library = "") {
  const script = 'TIMEFORMAT="time %U %S"; export LD_PRELOAD=$0; time "$@"';
  const args = ["--norc", "-c", script, library, "isoform", ...words(command), "--threads", "1"];
  // Reports tell the command as it was called.
  const env = { ...process.env, LC_ALL: "C", PATH: `${dirname(native)}:${process.env.PATH}` };
  const options = { cwd, input: STDIN, maxBuffer: 1 << 28, env };
  const { status, stdout, stderr } = spawnSync("bash", args, options);
  const [, messages, user, system] = stderr.toString().match(/^(.*)time (\S+) (\S+)\n$/s);
  const seconds = Number(user) + Number(system);
  return { code: status, stdout, stderr: messages, files: files(cwd), seconds };
}

/** Runs the module on files. */
function runModule(program, command) {
  const start = process.cpuUsage();
  const stdin = new TextEncoder().encode(STDIN);
  const outcome = program.run([...words(command), "--threads", "1"], { stdin });
  const { user, system } = process.cpuUsage(start);
  return { ...outcome, files: new Map(program.files()), seconds: (user + system) / 1e6 };
}

/** Returns a document or a report without the times in it; other files as they are. */
function timeless(name, bytes) {
  if (name.endsWith(".html")) {
    const times = /width:[\d.]+%|\d+\.\d+ s(?=<)/g;
    return Buffer.from(Buffer.from(bytes).toString().replace(times, ""));
  }
  if (!name.endsWith(".json") || bytes.length === 0) return Buffer.from(bytes);
  const text = JSON.stringify(JSON.parse(Buffer.from(bytes)), (key, value) =>
    key === "seconds" ? undefined : value,
  );
  return Buffer.from(text);
}

/** Returns the names of the outputs of two runs that differ. */
function differing(command, one, other) {
  const kind = command.includes("--json") ? "stdout.json" : "stdout";
  const outputs = ({ files, stdout, stderr }) =>
    new Map([...files, [kind, stdout], ["stderr", Buffer.from(stderr)]]);
  const [first, second] = [outputs(one), outputs(other)];
  const names = [...new Set([...first.keys(), ...second.keys()])];
  const isSame = (name) =>
    first.has(name) &&
    second.has(name) &&
    timeless(name, first.get(name)).equals(timeless(name, second.get(name)));
  return names.filter((name) => !isSame(name));
}

/** Bundles a file of src/wasm. */
async function bundled(name, format, platform) {
  const entryPoints = [join(web, "src/wasm", name)];
  const made = await build({ entryPoints, bundle: true, write: false, format, platform });
  return made.outputFiles[0].text;
}

const text = await bundled("program.ts", "esm", "node");
const { Program } = await import(
  `data:text/javascript;base64,${Buffer.from(text).toString("base64")}`
);

test("files lie in folders", () => {
  const program = new Program(null);
  program.put("a/b/part.hf", new Uint8Array([1, 2]));
  program.put("/a/scan.xyz", new Uint8Array([3]));
  assert.deepEqual(program.list().sort(), ["a/b/part.hf", "a/scan.xyz"]);
  assert.deepEqual(program.take("a/b/part.hf"), new Uint8Array([1, 2]));
  assert.equal(program.take("a/b"), null);
  assert.throws(() => program.put("a/scan.xyz/deeper", new Uint8Array()), /is a file/);
  assert.throws(() => program.put("./", new Uint8Array()), /not the name of a file/);
});

test("a program that breaks off says so", async () => {
  // Sections: a type, a function of it, a memory, both exported, and the code `unreachable`.
  const broken = [
    [0, 97, 115, 109, 1, 0, 0, 0],
    [1, 4, 1, 96, 0, 0],
    [3, 2, 1, 0],
    [5, 3, 1, 0, 1],
    [7, 19, 2, 6, ...Buffer.from("memory"), 2, 0, 6, ...Buffer.from("_start"), 0, 0],
    [10, 5, 1, 3, 0, 0, 11],
  ];
  const program = await Program.load(new Uint8Array(broken.flat()).buffer);
  const outcome = program.run([]);
  assert.equal(outcome.code, 5);
  assert.match(outcome.stderr, /^error: the program broke off: RuntimeError: unreachable\n$/);
});

const isBuilt = existsSync(module) && existsSync(native);
const skip = isBuilt ? false : "scripts/wasm.sh and cargo build --release make the two programs";

test("the module does what the native program does", { skip }, async (all) => {
  const compiled = await WebAssembly.compile(readFileSync(module));
  const folder = mkdtempSync(join(tmpdir(), "isoform-wasm-"));
  all.after(() => rmSync(folder, { recursive: true }));
  const library = muslFunctions(folder);
  const work = join(folder, "work");
  for (const path of INPUTS) cpSync(join(repository, path), join(work, basename(path)));
  writeFileSync(join(work, "points.csv"), POINTS);
  writeFileSync(join(work, "request.json"), JSON.stringify(REQUEST));
  const table = [];
  for (const [k, command] of COMMANDS.entries()) {
    await all.test(command, (one) => {
      const again = join(folder, `again-${k}`);
      cpSync(work, again, { recursive: true });
      const program = new Program(compiled);
      for (const [name, bytes] of files(work)) program.put(name, bytes);
      const expected = runNative(command, work);
      const found = runModule(program, command);
      const others = differing(command, expected, found);
      const ratio = (found.seconds / expected.seconds).toFixed(1);
      const note = others.length === 0 ? "" : `rounded otherwise: ${others.join(", ")}`;
      table.push([expected.seconds.toFixed(2), found.seconds.toFixed(2), ratio, command, note]);
      assert.equal(found.code, expected.code, found.stderr);
      if (others.length === 0) return;
      if (library === null) return one.skip("gcc and musl-dev can tell why results differ");
      const same = runNative(command, again, library);
      assert.equal(found.code, same.code, found.stderr);
      assert.deepEqual(differing(command, same, found), []);
    });
  }
  for (const [one, other, ratio, command, note] of table) {
    console.log(`${one.padStart(7)} s ${other.padStart(7)} s ${ratio.padStart(5)}  ${command}`);
    if (note !== "") console.log(`${" ".repeat(26)}${note}`);
  }
});

const isShown = existsSync(CHROMIUM);
test(
  "a page runs the module in a worker, and ends it",
  { skip: skip || (isShown ? false : "there is no Chromium") },
  async (one) => {
    const served = {
      "/": ["text/html", "<!doctype html>"],
      "/worker.js": ["text/javascript", await bundled("worker.ts", "iife", "browser")],
      "/session.js": ["text/javascript", await bundled("session.ts", "esm", "browser")],
      "/isoform.wasm": ["application/wasm", readFileSync(module)],
    };
    const browser = await chromium.launch({ executablePath: CHROMIUM });
    one.after(() => browser.close());
    const page = await browser.newPage();
    await page.route("**/*", (route) => {
      const [contentType, body] = served[new URL(route.request().url()).pathname] ?? [];
      return body === undefined ? route.abort() : route.fulfill({ contentType, body });
    });
    await page.goto("http://localhost/");
    const seen = await page.evaluate(async () => {
      const { Session } = await import("/session.js");
      const module = await WebAssembly.compileStreaming(fetch("/isoform.wasm"));
      const session = new Session(module, () => new Worker("/worker.js"));
      session.files.set(
        "ünder/ball.hf",
        new TextEncoder().encode("ball(x[3], a[1]) { ball = 1 - x[1]^2 - x[2]^2 - x[3]^2; }"),
      );
      const messages = [];
      const words = ["mesh", "ünder/ball.hf", "--size", "0.3", "-o", "ünder/ball.stl", "--json"];
      const onMessage = (text) => messages.push(text);
      const first = await session.run(words, { onMessage });
      const names = [...session.files.keys()];
      // The built-in scan takes long enough to be stopped at its first message.
      const stop = () => session.cancel();
      const stopped = await session.run(["recover"], { onMessage: stop });
      const after = [...session.files.keys()];
      const stdin = new TextEncoder().encode("0 0 0\n1 0 0\n0 1 0\n");
      const last = await session.run(["inspect", "-", "--from", "xyz", "--json"], { stdin });
      const document = (outcome) => JSON.parse(new TextDecoder().decode(outcome.stdout));
      return {
        codes: [first.code, last.code],
        messages: messages.join(""),
        names,
        after,
        stopped,
        documents: [document(first), document(last)],
      };
    });
    assert.deepEqual(seen.codes, [0, 0]);
    assert.deepEqual(seen.names, ["ünder/ball.hf", "ünder/ball.stl"]);
    assert.deepEqual(seen.after, seen.names);
    assert.equal(seen.stopped, null);
    assert.match(seen.messages, /lattice \.\.\./);
    assert.equal(seen.documents[0].verb, "mesh");
    assert.equal(seen.documents[1].verb, "inspect");
  },
);
