// Tests of Isoform Studio in a browser: node --test test/studio.mjs
//
// They drive the page as a person would, by accessible names, and compare its results with those of
// the command line. They need the program (ISOFORM, else what cargo has built) and Chromium
// (CHROMIUM).
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { after, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, opener } from "./windows.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const isoform = process.env.ISOFORM ?? join(root, "target/release/isoform");
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const folder = mkdtempSync(join(tmpdir(), "isoform-studio-"));
const browser = await launch();
// Nothing here compares pictures: a quarter of their pixels suffices.
const options = { viewport: { width: 1360, height: 860 }, deviceScaleFactor: 0.5 };
const inWindow = opener(browser, options, 60_000);
after(() => rmSync(folder, { recursive: true }));

const path = (name) => join(folder, name);
/** Runs the program in a folder; returns its document. */
function run(words, cwd = folder, ends = [0]) {
  const { status, stdout, stderr } = spawnSync(isoform, ["--json", ...words], {
    cwd,
    encoding: "utf8",
  });
  assert.ok(ends.includes(status), stderr + stdout);
  return JSON.parse(stdout);
}

/** Numbers from 0 to 1 that are the same in each run (mulberry32). */
function generator(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** Sizes of the plate that is scanned: length, width, height, and the radius of its bore. */
const [L, W, H, R] = [40, 30, 8, 7];
/** A scan of a plate with a bore through its middle, with noise, turned and moved. */
function scan(noise = 0.01) {
  const random = generator(7);
  const normal = () =>
    Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random()) * noise;
  const points = [];
  const add = (p, n) => points.push(p.map((v, k) => v + n[k] * normal()));
  const plane = (count, at) => {
    for (let i = 0; i < count; i++) at(random(), random());
  };
  for (const z of [0, H])
    plane(800, (u, v) => {
      if (Math.hypot((u - 0.5) * L, (v - 0.5) * W) > R) add([u * L, v * W, z], [0, 0, 1]);
    });
  for (const x of [0, L]) plane(175, (u, v) => add([x, u * W, v * H], [1, 0, 0]));
  for (const y of [0, W]) plane(225, (u, v) => add([u * L, y, v * H], [0, 1, 0]));
  plane(350, (u, v) => {
    const n = [Math.cos(2 * Math.PI * u), Math.sin(2 * Math.PI * u), 0];
    add([L / 2 + R * n[0], W / 2 + R * n[1], v * H], n);
  });
  const [c, s] = [Math.cos(0.7), Math.sin(0.7)];
  const moved = points.map(([x, y, z]) => [c * x - s * z + 12, y - 5, s * x + c * z + 3]);
  return moved.map((p) => p.map((v) => v.toFixed(5)).join(" ")).join("\n") + "\n";
}
const VOLUME = L * W * H - Math.PI * R * R * H;

/** Starts a studio; returns its address, its process, and its end. */
async function serve(words) {
  const server = spawn(isoform, ["studio", "--no-open", ...words], {
    cwd: folder,
    stdio: ["ignore", "pipe", "pipe"],
  });
  const lines = createInterface({ input: server.stdout });
  const [address] = await once(lines, "line");
  return { address, server };
}

/** Refused work is told by status 422; the browser itself styles text that is inserted in an editor,
 *  which the policy forbids. */
const USUAL = /status of 422|Applying inline style/;
/** Opens a page; what it complains of is an error at its end. */
function open(address, use, allowed = USUAL) {
  const saved = async (page) => {
    await use(page);
    await page.evaluate("isoform.saved()").catch(() => {});
  };
  return inWindow(address, saved, allowed);
}
/** Starts a studio and opens its page. */
async function studio(words, use, allowed) {
  const { address, server } = await serve(words);
  try {
    return await open(address, (page) => use(page, address), allowed);
  } finally {
    server.kill();
  }
}
const press = (page, name) => page.getByRole("button", { name, exact: true }).click();
const tab = (page, name) => page.getByRole("tab", { name, exact: true }).click();
/** Replaces the program in the editor by typing. */
async function type(page, text) {
  await page.getByRole("textbox", { name: "HyperFun program" }).click();
  await page.keyboard.press("ControlOrMeta+A");
  await page.keyboard.insertText(text);
}
/** Presses a button that saves a file; returns its bytes. */
async function saved(page, name) {
  const [download] = await Promise.all([page.waitForEvent("download"), press(page, name)]);
  return readFileSync(await download.path());
}

test("a scan becomes a STEP file in three clicks, as on the command line", async () => {
  writeFileSync(path("plate.xyz"), scan());
  await studio(["plate.xyz", "--project", "one"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Make a CAD model");
    const verdict = page.getByText("The model explains the scan.");
    await verdict.waitFor();
    const step = await saved(page, "STEP");
    assert.match(step.toString("latin1"), /^ISO-10303-21/);
    writeFileSync(path("page.step"), step);
    const { volume } = run(["inspect", "page.step"]);
    assert.ok(Math.abs(volume / VOLUME - 1) < 2e-3, `${volume} for ${VOLUME}`);
    // The command line that the page names gives the same file.
    await page.getByText("Command line").click();
    const lines = await page.locator("code").allTextContents();
    const line = lines.find((l) => l.startsWith("isoform recover"));
    const words = line
      .split(" ")
      .slice(1)
      .map((w) => w.replace(/-model-\d+\./, "-again."));
    run(words, path("one"), [0]);
    const again = readdirSync(path("one")).find((n) => /-again\.step$/.test(n));
    const plain = (bytes) => bytes.toString("latin1").replace(/FILE_NAME[^;]*;/, "");
    assert.equal(plain(readFileSync(join(path("one"), again))), plain(step));
    // Undo takes it back, redo brings it again.
    await press(page, "Undo");
    await verdict.waitFor({ state: "hidden" });
    await press(page, "Redo");
    await verdict.waitFor();
  });
});

test("a program is typed from nothing to a certified mesh, and each mistake is told", async () => {
  await studio(["--project", "two"], async (page) => {
    await tab(page, "Program");
    await type(page, "my_model(x[3], a[1])\n{\n  my_model = hfSpere(x, [0, 0, 0], 1);\n}\n");
    await page.getByText(/did you mean hfSphere/).waitFor();
    await type(
      page,
      "-- @param a[1] radius typical=2 min=1 max=3\nmy_model(x[3], a[1])\n{\n" +
        "  array c[3];\n  c = [0, 0, 0];\n  my_model = hfSphere(x, c, a[1]);\n}\n",
    );
    const slider = page.getByRole("spinbutton", { name: "radius, as a number" });
    await slider.waitFor();
    await page.getByText(/did you mean/).waitFor({ state: "hidden" });
    await slider.fill("3");
    await slider.press("Enter");
    await press(page, "Mesh and certify");
    await page.getByText("The certificate holds.").waitFor();
    const told = await page.locator("dl.figures").textContent();
    const volume = Number(/volume([\d.]+)/.exec(told)[1]);
    assert.ok(Math.abs(volume / (36 * Math.PI) - 1) < 0.02, told);
    const stl = await saved(page, "STL");
    assert.ok(stl.length > 10_000);
    await press(page, "Undo");
    await page.getByText(/did you mean hfSphere|A plate with a hole/).waitFor();
  });
});

test("a template is edited and fitted", async () => {
  writeFileSync(path("plate.xyz"), scan());
  await studio(["plate.xyz", "--project", "three"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Propose a program");
    const editor = page.getByRole("textbox", { name: "HyperFun program" });
    await editor.getByText(/@title/).waitFor();
    const text = await editor.innerText();
    assert.match(text, /_radius/);
    await editor.getByText(/@title/).click();
    await page.keyboard.press("End");
    await page.keyboard.type(" and edited by hand");
    await press(page, "Fit to the scan");
    await page.getByText("The model explains the scan.").waitFor();
    const names = readdirSync(path("three")).filter((n) => /-model-\d+\.hf$/.test(n));
    const fitted = readFileSync(join(path("three"), names.pop()), "utf8");
    assert.match(fitted, /and edited by hand/);
    // A dimension is held at a value.
    const row = page.getByRole("row", { name: /_radius/ }).first();
    await row.getByRole("spinbutton").fill("7");
    await row.getByRole("checkbox").check();
    await press(page, "Make the CAD model again");
    await row.getByText(/fixed/).waitFor();
  });
});

test("two faces in one are split by hand, and the model explains the scan again", async () => {
  writeFileSync(path("plate.xyz"), scan());
  await studio(["plate.xyz", "--project", "hand"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Recognize faces");
    const face = (kind) => page.getByRole("checkbox", { name: new RegExp(`^Face \\d+, ${kind}`) });
    await face("cylinder").waitFor();
    assert.equal(await face("plane").count(), 6);
    // The bore and the end of the plate become one face, which no surface explains.
    await face("cylinder").check();
    const end = page.getByRole("listitem").filter({ hasText: /normal .?0\.76\S*, \S+, .?0\.64/ });
    await end.first().getByRole("checkbox").check();
    await press(page, "Merge");
    const told = await page.getByText(/no kind explains them/).innerText();
    const [, merged] = /label (\d+):/.exec(told);
    await press(page, "Make a CAD model");
    await page.getByText(/^The model is /).waitFor();
    // Of its points those in the middle are the bore.
    await page.getByRole("combobox", { name: "Show" }).selectOption("faces");
    await page.getByRole("checkbox", { name: new RegExp(`^Face ${merged},`) }).check();
    await press(page, "Front");
    await press(page, "Select points by a box");
    await page.waitForTimeout(500);
    const box = await page.locator("[data-pane=space]").boundingBox();
    const at = (u, v) => [box.x + u * box.width, box.y + v * box.height];
    await page.mouse.move(...at(0.3, 0.1));
    await page.mouse.down();
    await page.mouse.move(...at(0.72, 0.9), { steps: 3 });
    await page.mouse.up();
    await page.getByText(/3\d\d points selected of the chosen faces/).waitFor();
    await press(page, "Make a face");
    await face("cylinder").waitFor();
    assert.equal(await face("plane").count(), 6);
    await press(page, "Make a CAD model");
    await page.getByText("The model explains the scan.").waitFor();
    const radius = await page
      .getByRole("row", { name: /_radius/ })
      .first()
      .innerText();
    assert.ok(Math.abs(parseFloat(radius.split(/\s+/)[1]) - R) < 0.01, radius);
    const undo = page.getByRole("button", { name: "Undo", exact: true });
    while (await undo.isEnabled()) await undo.click();
    await page.getByText(/Drop a scan/).waitFor();
  });
});

test("a relation of two faces is stated by hand, and taken back", async () => {
  writeFileSync(path("related.xyz"), scan());
  await studio(["related.xyz", "--project", "related"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Recognize faces");
    const face = (id) => page.getByRole("checkbox", { name: new RegExp(`^Face ${id}, `) });
    await face(0).waitFor();
    const relation = page.getByRole("combobox", { name: "Relation of the two chosen faces" });
    await face(0).check();
    assert.ok(await relation.isDisabled());
    await face(1).check();
    await relation.selectOption("parallel");
    const related = page.getByRole("list", { name: "Relations" });
    await related.getByText("0 and 1: parallel").waitFor();
    const documents = readdirSync(path("related")).filter((n) => /-faces-\d+\.json$/.test(n));
    const read = (name) => JSON.parse(readFileSync(join(path("related"), name), "utf8"));
    const found = documents.map(read).filter((d) => d.entities.every((e) => "label" in e));
    assert.equal(found.length, 1);
    const { deviation } = found[0].relations.find(
      (r) => r.kind === "parallel" && r.entities.join() === "0,1",
    );
    assert.ok(deviation < 1e-12, String(deviation));
    // What cannot hold is said, and changes nothing.
    await face(0).check();
    await face(1).check();
    await relation.selectOption("perpendicular");
    await page.getByText(/too far from being perpendicular/).waitFor();
    await press(page, "Remove the relation 0 and 1: parallel");
    await related.waitFor({ state: "hidden" });
    await press(page, "Undo");
    await related.getByText("0 and 1: parallel").waitFor();
    await press(page, "Make a CAD model");
    await page.getByText("The model explains the scan.").waitFor();
  });
});

test("the right button opens a menu of faces and of the view, and the theme can be chosen", async () => {
  writeFileSync(path("menu.xyz"), scan());
  await studio(["menu.xyz", "--project", "menu"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Recognize faces");
    const face = (id) => page.getByRole("checkbox", { name: new RegExp(`^Face ${id}, `) });
    await face(1).waitFor();
    const count = await page.getByRole("checkbox", { name: /^Face \d/ }).count();
    const bore = page.getByRole("list", { name: "Features" }).getByText(/through/);
    assert.match(
      await bore.textContent(),
      /^radius (7|7\.0\d+|6\.99\d), through (8|8\.0\d+|7\.99\d)$/,
    );
    const menu = page.getByRole("menu");
    const entry = (name) => page.getByRole("menuitem", { name, exact: true });
    // In the list, by keys: the first entry deletes the face.
    await face(1).click({ button: "right" });
    await entry("Delete face 1").waitFor();
    await page.keyboard.press("End");
    assert.equal(await page.locator(":focus").textContent(), "Fit a torus to face 1");
    await page.keyboard.press("ArrowDown");
    assert.equal(await page.locator(":focus").textContent(), "Delete face 1");
    await page.keyboard.press("Enter");
    await page.waitForFunction(
      (n) => document.querySelectorAll("[data-face]").length === n,
      count - 1,
    );
    await press(page, "Undo");
    await face(count - 1).waitFor();
    // In the view: a press outside and Escape close it.
    const box = await page.locator("[data-pane=space]").boundingBox();
    const at = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.click(...at, { button: "right" });
    await menu.waitFor();
    await page.keyboard.press("Escape");
    await menu.waitFor({ state: "detached" });
    await page.locator("[data-pane=space]").focus();
    await page.keyboard.press("Shift+F10");
    await entry("Parallel projection").click();
    await menu.waitFor({ state: "detached" });
    assert.ok(await page.getByRole("checkbox", { name: "Parallel projection" }).isChecked());
    // A drag by the right button moves the view, and opens nothing.
    await page.mouse.move(...at);
    await page.mouse.down({ button: "right" });
    await page.mouse.move(at[0] + 40, at[1]);
    await page.mouse.up({ button: "right" });
    assert.equal(await menu.count(), 0);
    const light = () =>
      page.evaluate(() => {
        const pane = document.querySelector("[data-pane=space]");
        return Number(getComputedStyle(pane).backgroundColor.match(/\d+/)[0]) > 128;
      });
    const theme = page.getByRole("combobox", { name: "Theme" });
    await theme.selectOption("dark");
    assert.equal(await light(), false);
    await page.reload();
    await page.evaluate("isoform.ready");
    assert.deepEqual([await theme.inputValue(), await light()], ["dark", false]);
    await theme.selectOption("light");
    await page.emulateMedia({ colorScheme: "dark" });
    assert.equal(await light(), true);
    await theme.selectOption("system");
    assert.equal(await light(), false);
  });
});

test("a rational map is typed to a certificate", async () => {
  await studio(["--project", "four"], async (page) => {
    await tab(page, "Surface");
    await page.getByRole("combobox", { name: "Kind of the surface" }).selectOption("map");
    const fill = async (name, text) => {
      const field = page.getByRole("textbox", { name, exact: true });
      await field.fill(text);
      await field.press("Tab");
    };
    await fill("X", "2*s*t +");
    await page.getByText(/X: /).waitFor();
    for (const [name, text] of Object.entries({ X: "2*s*t", Y: "2*t", Z: "2*s" }))
      await fill(name, text);
    await fill("W", "s^2 + t^2 + 1");
    await fill("Half the width of the box", "1.2");
    await page.getByRole("group", { name: "The plane of parameters s and t" }).waitFor();
    await press(page, "Triangulate and certify");
    await page.getByText("The certificate holds.").waitFor();
    await page.getByText(/\d+ claims/).click();
    const claims = await page.getByText("proved:").count();
    const map = { X: "2*s*t", Y: "2*t", Z: "2*s", W: "s^2 + t^2 + 1" };
    writeFileSync(path("roman.json"), JSON.stringify(map));
    const document = run(["triangulate", "roman.json", "--box", "1.2", "-o", "roman.ply"]);
    assert.equal(claims, document.claims.filter((c) => c.holds).length);
    // Every step of it is taken back.
    const undo = page.getByRole("button", { name: "Undo", exact: true });
    while (await undo.isEnabled()) await undo.click();
    await page.getByRole("textbox", { name: "F", exact: true }).waitFor();
  });
});

test("two files are compared, with a tolerance", async () => {
  writeFileSync(
    path("ball.hf"),
    "my_model(x[3], a[1])\n{\n  array c[3];\n  c = [0, 0, 0];\n  my_model = hfSphere(x, c, 2);\n}\n",
  );
  run(["mesh", "ball.hf", "--surface-only", "--size", "0.5", "-o", "ball.stl"]);
  await studio(["--project", "five"], async (page) => {
    await tab(page, "Compare");
    const [chooser] = await Promise.all([page.waitForEvent("filechooser"), press(page, "Open…")]);
    await chooser.setFiles([path("ball.stl"), path("ball.hf")]);
    await page.getByRole("combobox", { name: "Nominal" }).getByText("ball.hf").waitFor({
      state: "attached",
    });
    await page.getByRole("spinbutton", { name: /passes/ }).fill("1e-6");
    await press(page, "Compare");
    await page.getByText(/Fails/).waitFor();
    const { first_to_second } = run(["compare", "ball.stl", "ball.hf"]);
    const table = await page.getByRole("table", { name: /Distances/ }).innerText();
    assert.ok(table.includes(String(Number(first_to_second.max.toPrecision(4)))), table);
    const faces = page.getByRole("table", { name: /nearest face/ });
    await faces.getByRole("row", { name: /fails/ }).waitFor();
    await page.getByRole("spinbutton", { name: /passes/ }).fill("1");
    await press(page, "Compare");
    await page.getByText(/Passes/).waitFor();
    await faces.getByRole("row", { name: /passes/ }).waitFor();
  });
});

test("work survives the end of the server, and two windows agree", async () => {
  writeFileSync(path("plate.xyz"), scan());
  const first = await serve(["plate.xyz", "--project", "six"]);
  await open(
    first.address,
    async (page) => {
      await page.getByText(/points, .* × .* × /).waitFor();
      await press(page, "Recognize faces");
      await page.getByRole("checkbox", { name: "Face 6" }).waitFor();
      // The other window follows.
      await open(first.address, async (other) => {
        await other.getByRole("checkbox", { name: "Face 6" }).waitFor();
        await tab(other, "Program");
        await type(other, "-- of the other window\n");
        await other.evaluate("isoform.saved()");
        await other.waitForTimeout(1500);
      });
      await tab(page, "Program");
      await page.getByText("of the other window").waitFor();
      await page.evaluate("isoform.saved()");
      first.server.kill("SIGKILL");
      await once(first.server, "exit");
      await tab(page, "Scan");
      await page
        .getByRole("alert")
        .getByText(/not stored/)
        .waitFor();
    },
    /ERR_|Failed to fetch|Applying inline style|status of 422/,
  );
  await studio(["--project", "six"], async (page) => {
    await tab(page, "Scan");
    await page.getByRole("checkbox", { name: "Face 6" }).waitFor();
    await press(page, "Undo");
    await page.getByRole("button", { name: "Redo" }).click();
  });
});

test("hostile files and names are told, and nothing is lost", async () => {
  await studio(["--project", "seven"], async (page) => {
    const hostile = [
      { name: "../../evil.ply", buffer: Buffer.from("ply\nformat ascii 1.0\nend_header\n") },
      {
        name: "<img src=x onerror=alert(1)>.hf",
        buffer: Buffer.from("<script>alert(1)</script>"),
      },
      { name: "empty.stl", buffer: Buffer.alloc(0) },
      { name: "a.exe", buffer: Buffer.from("MZ") },
      { name: `${"long".repeat(60)}.xyz`, buffer: Buffer.from("0 0 0\n1 nan 0\n") },
      { name: "x.json", buffer: Buffer.from('{"F": ["x"]}') },
    ];
    for (const { name, buffer } of hostile) {
      const data = await page.evaluateHandle(
        ([name, bytes]) => {
          const transfer = new DataTransfer();
          transfer.items.add(new File([Uint8Array.from(bytes)], name));
          return transfer;
        },
        [name, [...buffer]],
      );
      await page.dispatchEvent("main", "drop", { dataTransfer: data });
      await page.waitForTimeout(600);
    }
    assert.equal(await page.evaluate("document.querySelector('img[src=x]')"), null);
    await tab(page, "Surface");
    await press(page, "Mesh and certify");
    await page.getByText("The certificate holds.").waitFor();
  });
  const names = readdirSync(path("seven"));
  assert.ok(names.every((n) => n.length < 130 && !n.includes("/")));
  assert.ok(!readdirSync(folder).includes("evil.ply"));
});

test("work is cancelled, and the project stays as it was", async () => {
  writeFileSync(path("plate.xyz"), scan());
  await studio(["plate.xyz", "--project", "eight"], async (page) => {
    await tab(page, "Program");
    await page.getByRole("spinbutton", { name: "Length of edges" }).fill("0.12");
    await press(page, "Mesh and certify");
    await page.getByRole("progressbar").waitFor();
    await press(page, "Cancel");
    await page.getByText("Cancelled.").waitFor();
    await page.getByRole("progressbar").waitFor({ state: "hidden" });
  });
});

test("a page of another origin cannot call the server", async () => {
  const { address, server } = await serve(["--project", "nine"]);
  const other = await serve(["--project", "ten"]);
  try {
    const page = await browser.newPage();
    await page.goto(other.address);
    const outcome = await page.evaluate(async (target) => {
      const tries = [
        [`${target}project`, {}],
        [`${target}run`, { method: "POST", body: '{"verb": "functions"}' }],
        [`${target}files/x.hf`, { method: "PUT", body: "x", mode: "no-cors" }],
      ];
      const ends = tries.map(([url, init]) =>
        fetch(url, init).then(
          (r) => r.status,
          () => "refused",
        ),
      );
      return Promise.all(ends);
    }, address);
    assert.deepEqual(outcome, ["refused", "refused", "refused"]);
    await page.close();
    assert.ok(!readdirSync(path("nine")).includes("x.hf"));
    // Nor does a program without the address get in.
    const origin = new URL(address).origin;
    const status = async (url, init) => (await fetch(url, init)).status;
    assert.equal(await status(`${origin}/`), 404);
    assert.equal(await status(`${address}run`, { method: "POST", body: "{}" }), 403);
    const headers = { origin: "http://evil.example" };
    assert.equal(await status(`${address}project`, { headers }), 403);
    for (const name of ["..%2Fx.hf", "%2Fetc%2Fpasswd", ".hidden", "project.json"])
      assert.equal(await status(`${address}files/${name}`), 404, name);
  } finally {
    server.kill();
    other.server.kill();
  }
});

test("axe finds no violations, in any tab, light and dark", async () => {
  writeFileSync(path("plate.xyz"), scan());
  await studio(["plate.xyz", "--project", "eleven"], async (page) => {
    await page.getByText(/points, .* × .* × /).waitFor();
    await press(page, "Make a CAD model");
    await page.getByText("The model explains the scan.").waitFor();
    await press(page, "Recognize faces");
    await page.getByRole("checkbox", { name: "Face 6" }).waitFor();
    await page.evaluate(axe);
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      for (const name of ["Scan", "Program", "Surface", "Compare"]) {
        await tab(page, name);
        await page.waitForTimeout(800);
        const violations = await page.evaluate(async () => {
          const { violations } = await window.axe.run();
          return violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.html).join(" | ")}`);
        });
        assert.deepEqual(violations, [], `${name}, ${colorScheme}`);
      }
    }
  });
});
