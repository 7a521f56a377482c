// Tests of pages in a browser: node --test test/browser.mjs
//
// They need the program (ISOFORM, else what cargo has built) and Chromium (CHROMIUM).
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { after, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { launch, opener } from "./windows.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const isoform = process.env.ISOFORM ?? join(root, "target/release/isoform");
const folder = mkdtempSync(join(tmpdir(), "isoform-browser-"));
const browser = await launch();
const open = opener(browser, { viewport: { width: 800, height: 500 } }, 30_000);
after(() => rmSync(folder, { recursive: true }));

const path = (name) => join(folder, name);
function file(name, text) {
  writeFileSync(path(name), text);
  return path(name);
}
/** Runs the program, to one of these ends. */
function run(args, ends = [0], env = process.env) {
  const { status, stderr } = spawnSync(isoform, args, { cwd: folder, encoding: "utf8", env });
  assert.ok(ends.includes(status), stderr);
}

/** Opens the page of some files. */
function view(args, use) {
  const name = `${args.map((a) => a.replace(/\W/g, "")).join("_")}.html`;
  run(["view", "-q", ...args, "-o", name]);
  return open(pathToFileURL(path(name)).href, use);
}

/** A picture as bytes of red, green, blue and opacity. */
async function pixels(page, address) {
  const bytes = await page.evaluate(async (address) => {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    let text = "";
    for (let i = 0; i < data.length; i += 8192)
      text += String.fromCharCode(...data.subarray(i, i + 8192));
    return btoa(text);
  }, address);
  return Buffer.from(bytes, "base64");
}
/** The picture of the pane of space. */
const picture = async (page) => pixels(page, await page.evaluate("isoform.screenshot()"));
/** The share of pixels that differ by more than this. */
function differing(a, b, by = 24) {
  assert.equal(a.length, b.length);
  let count = 0;
  for (let i = 0; i < a.length; i += 4) {
    if ([0, 1, 2].some((k) => Math.abs(a[i + k] - b[i + k]) > by)) count += 1;
  }
  return count / (a.length / 4);
}

/** A place far from the origin in proportion to the size of what is there. */
const FAR = 1e6;

/** A ball with a dent, about a place on the diagonal. */
const dented = (c) => `-- @param a[1] radius length min=0.5 max=2 typical=1
my_model(x[3], a[1]) {
  array c[3], d[3];
  c = [${c}, ${c}, ${c}]; d = [${c + 0.5}, ${c}, ${c}];
  my_model = hfSphere(x, c, a[1]) \\ hfSphere(x, d, 0.8);
}
`;
/** Triangles of a bowl, about a place on the diagonal. */
function bowl(c) {
  const n = 16;
  let text = "";
  for (let i = 0; i <= n; i++)
    for (let j = 0; j <= n; j++) {
      const [u, v] = [(2 * i) / n - 1, (2 * j) / n - 1];
      text += `v ${c + u} ${c + v} ${c + 0.5 * (u * u + v * v)}\n`;
    }
  for (let i = 0; i < n; i++)
    for (let j = 0; j < n; j++) {
      const a = i * (n + 1) + j + 1;
      text += `f ${a} ${a + n + 1} ${a + n + 2}\nf ${a} ${a + n + 2} ${a + 1}\n`;
    }
  return text;
}
const points = (text) => text.replace(/^f.*\n/gm, "").replace(/^v /gm, "");

/** The same view of what is about a place on the diagonal. */
const look = (page, c) =>
  page.evaluate(
    (c) =>
      window.isoform.camera({
        position: [c + 2.1, c - 2.9, c + 1.7],
        target: [c, c, c],
        up: [0, 0, 1],
      }),
    c,
  );

test("what is far from the origin looks like what is near it", async () => {
  const kinds = ["model", "mesh", "points"];
  // One page for all kinds, each of which is shown alone.
  const [near, far] = await Promise.all(
    [0, FAR].map((c) => {
      const [lo, hi] = [c - 1.1, c + 1.1];
      const files = [
        file(`${c}.hf`, dented(c)),
        `--box=${lo},${lo},${lo},${hi},${hi},${hi}`,
        file(`${c}.obj`, bowl(c)),
        file(`${c}.xyz`, points(bowl(c))),
      ];
      return view(files, async (page) => {
        const layers = await page.evaluate("isoform.layers()");
        assert.deepEqual(
          layers.map(({ kind }) => kind),
          kinds,
        );
        await look(page, c);
        await page.evaluate(
          (c) => window.isoform.section({ normal: [0, 0, 1], offset: c + 0.4 }),
          c,
        );
        const shown = [];
        for (const { id } of layers) {
          for (const other of layers)
            await page.evaluate(
              ([id, visible]) => window.isoform.set(id, { visible }),
              [other.id, other.id === id],
            );
          const hit = await page.evaluate(() => window.isoform.pick(260, 260));
          shown.push({ image: await picture(page), hit: hit?.point.map((v) => v - c) });
        }
        return shown;
      });
    }),
  );
  kinds.forEach((kind, i) => {
    const share = differing(near[i].image, far[i].image);
    assert.ok(share < 0.004, `${kind}: ${share} of the pixels differ`);
    near[i].hit?.forEach((v, k) =>
      assert.ok(
        Math.abs(v - far[i].hit[k]) < 1e-3,
        `${kind}: picked at ${far[i].hit} of ${near[i].hit}`,
      ),
    );
  });
});

test("layers far from one another are drawn as each of them alone", async () => {
  const files = [0, FAR].map((c) => file(`bowl-${c}.obj`, bowl(c)));
  const alone = await view([files[1]], async (page) => {
    await look(page, FAR);
    return picture(page);
  });
  await view(files, async (page) => {
    await look(page, FAR);
    const share = differing(alone, await picture(page));
    assert.ok(share < 0.004, `${share} of the pixels differ`);
  });
});

test("many points are drawn one part after the other, to the picture of all of them", async () => {
  const count = 520_000;
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n`;
  const values = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) {
    const [turn, z] = [2.4 * i, i / count];
    values.set([Math.cos(turn) * (1 + z), Math.sin(turn) * (1 + z), 2 * z], 3 * i);
  }
  const properties = ["x", "y", "z"].map((name) => `property float ${name}\n`).join("");
  const bytes = Buffer.from(values.buffer);
  file("many.ply", Buffer.concat([Buffer.from(`${header}${properties}end_header\n`), bytes]));
  await view(["many.ply"], async (page) => {
    const shown = () => page.locator("[data-pane=space] canvas").evaluate((c) => c.toDataURL());
    const moving = await page.evaluate(async () => {
      await window.isoform.camera({});
      return document.querySelector("[data-pane=space] canvas").toDataURL();
    });
    let last = "";
    for (let still = 0; still < 3;) {
      await page.waitForTimeout(1200);
      const now = await shown();
      still = now === last ? still + 1 : 0;
      last = now;
    }
    assert.notEqual(last, moving);
    assert.equal(await page.evaluate("isoform.screenshot()"), last);
    // A picked point is one of the file.
    const { point } = await page.evaluate("isoform.pick(400, 250)");
    const away = Math.hypot(point[0], point[1]) - 1 - point[2] / 2;
    assert.ok(Math.abs(away) < 1e-3, `${point}`);
  });
});

test("what is picked of a solid is on its face, not on a triangle", async () => {
  run(["brep", "sphere", "--params", "0,0,0,2", "-q", "-o", "ball.step"]);
  await view(["ball.step"], async (page) => {
    const [x, y, width, height] = await page.evaluate(() => {
      const box = document.querySelector("[data-pane=space]").getBoundingClientRect();
      return [box.x, box.y, box.width, box.height];
    });
    for (let k = 0; k < 40; k++) {
      const [u, v] = [0.4 + 0.005 * k, 0.6 - 0.004 * k];
      const at = [x + u * width, y + v * height];
      const hit = await page.evaluate((at) => window.isoform.pick(...at), at);
      assert.ok(Math.abs(Math.hypot(...hit.point) - 2) < 1e-9, `${hit.point}`);
    }
  });
});

test("drawings of render cover what its pictures cover, and parts have colours", async () => {
  const page = await browser.newPage();
  const size = [320, 240];
  const made = async (ending, words) => {
    const how = ["--camera", "3.2,-0.9,1.1,0,0,0", "--size", size.join("x"), "-q"];
    // Neither a screen nor other programs are needed.
    run(["render", ...words, ...how, "-o", `drawn.${ending}`], [0], { PATH: "/nonexistent" });
    const text = readFileSync(path(`drawn.${ending}`)).toString("base64");
    return pixels(page, `data:image/${ending === "svg" ? "svg+xml" : ending};base64,${text}`);
  };
  const covered = (image) =>
    Array.from({ length: image.length / 4 }, (_, i) =>
      [0, 1, 2].some((k) => Math.abs(image[4 * i + k] - image[k]) > 12),
    );
  const program = `my_model(x[3], a[1]) {
    array c[3], d[3];
    c = [0, 0, 0]; d = [0.5, 0, 0];
    ball = hfSphere(x, c, 1); dent = hfSphere(x, d, 0.8);
    my_model = ball \\ dent;
  }`;
  const model = file("drawn.hf", program);
  const scan = file("drawn.xyz", points(bowl(0)));
  const share = (mask) => mask.filter((is) => is).length / mask.length;
  for (const files of [[model], [file("drawn.obj", bowl(0))]]) {
    const [a, b] = [covered(await made("png", files)), covered(await made("svg", files))];
    assert.equal(a.length, size[0] * size[1]);
    const both = share(a.map((is, i) => is && b[i]));
    const any = share(a.map((is, i) => is || b[i]));
    assert.ok(any > 0.1 && both > 0.96 * any, `${files}: ${both} of ${any}`);
  }
  const cloud = share(covered(await made("png", [scan])));
  assert.ok(cloud > 0.02 && cloud < 0.2, `${cloud}`);
  const layers = share(covered(await made("png", [scan, model])));
  assert.ok(layers > 0.4 && layers < 0.95, `${layers}`);
  const image = await made("png", [model, "--color-by", "part"]);
  const tint = (x, y) => {
    const rgb = [...image.subarray(4 * (y * size[0] + x)).subarray(0, 3)];
    const least = Math.min(...rgb);
    return rgb.map((v) => (v - least) / (Math.max(...rgb) - least));
  };
  const apart = (p, q) => Math.hypot(...tint(...p).map((v, k) => v - tint(...q)[k]));
  // The dent is in the middle, the ball is seen beside it.
  const [dent, ball] = [
    [160, 120],
    [60, 120],
  ];
  assert.ok(apart(dent, [148, 160]) < 0.1 && apart(ball, [80, 60]) < 0.1);
  assert.ok(apart(dent, ball) > 0.5);
  await page.close();
});

/** Points of a tube without its ends, which leave the height of a cylinder open. */
function tube() {
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const row = () => {
    const [turn, r] = [2 * Math.PI * random(), 30 + 0.04 * (random() - 0.5)];
    return `${r * Math.cos(turn)} ${r * Math.sin(turn)} ${40 * random() - 20}`;
  };
  return Array.from({ length: 4000 }, row).join("\n");
}
/** Pixels of the colour of stripes. */
function striped(image) {
  let count = 0;
  for (let i = 0; i < image.length; i += 4)
    if (image[i] > 90 && image[i + 1] < 0.45 * image[i] && image[i + 2] > 1.2 * image[i + 1])
      count += 1;
  return count;
}

/** Saves a table and a drawing of a report: they hold what the page shows. */
async function saves(page) {
  const saved = async (section, name) => {
    const [download] = await Promise.all([
      page.waitForEvent("download"),
      page.locator(section).getByRole("button", { name }).click(),
    ]);
    return readFileSync(await download.path(), "utf8");
  };
  const rows = (await saved('[data-save="parameters.csv"]', "Save CSV")).trimEnd().split("\r\n");
  const names = await page.locator('[data-save="parameters.csv"] table').first().locator("tr b");
  const shown = await names.allInnerTexts();
  assert.deepEqual(
    rows.slice(1, 1 + shown.length).map((row) => row.split(",")[0]),
    shown,
  );
  for (const row of rows.slice(1)) {
    assert.equal(row.split(",").length, 6);
    assert.ok(Number.isFinite(Number(row.split(",")[1])), row);
  }
  const svg = await saved('[data-save="drawing.svg"]', "Save SVG");
  const parsed = await page.evaluate((text) => {
    const root = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    return [root.localName, root.querySelector("style").textContent.includes(".sheet .paper")];
  }, svg);
  assert.deepEqual(parsed, ["svg", true]);
}

test("what moves with undetermined parameters is striped, and they are named", async () => {
  // 3: the ends are without data, and the fit is not accepted.
  run(["fit", file("tube.xyz", tube()), "-t", "cylinder", "-o", "report.html", "-q"], [0, 3]);
  const address = pathToFileURL(path("report.html")).href;
  await open(address, async (page) => {
    await page.evaluate(() => window.isoform.set("layer-1", { visible: false }));
    const list = await page.locator(".parameter.is-open").allInnerTexts();
    assert.deepEqual(
      list.map((t) => t.split(/\s/)[0]),
      ["height", "lid_depth", "pose_z"],
    );
    const row = page.locator("tr.undetermined td:first-child b");
    assert.deepEqual(await row.allInnerTexts(), ["height", "lid_depth", "pose_z"]);
    assert.ok(striped(await picture(page)) > 500);
    const from = (...way) =>
      page.evaluate(async (way) => {
        const { target } = await window.isoform.camera();
        await window.isoform.camera({ position: target.map((v, k) => v + way[k]) });
        await window.isoform.fitView();
      }, way);
    // From beside, the wall is all that is seen: it does not move.
    await from(0, -100, 0);
    assert.ok(striped(await picture(page)) < 300);
    await from(100, -130, 90);
    assert.ok(striped(await picture(page)) > 500);
    await page.getByLabel("Stripes: undetermined").uncheck();
    await page.evaluate(() => window.isoform.fitView());
    assert.equal(striped(await picture(page)), 0);
    await saves(page);
  });
});

/** A server, with its address. */
async function serve(...files) {
  const child = spawn(isoform, ["view", "--serve", ...files], { stdio: "pipe" });
  const [line] = await once(createInterface(child.stdout), "line", {
    signal: AbortSignal.timeout(20_000),
  });
  return { child, address: line };
}

/** Waits until a page is another one than that which was marked as old. */
async function reloaded(page) {
  for (let k = 0; k < 200; k++) {
    // While it loads there is nothing to be asked.
    const isNew = await page.evaluate("!window.isOld && !!window.isoform").catch(() => false);
    if (isNew) return page.evaluate("isoform.ready");
    await new Promise((f) => setTimeout(f, 100));
  }
  assert.fail("the page was not loaded again");
}

test("a served page follows its file, and keeps what was chosen", async () => {
  const ball = file("ball.hf", dented(0));
  const { child, address } = await serve(ball);
  try {
    await open(address, async (page) => {
      const parameter = () => page.evaluate("isoform.ready.then(() => isoform.parameters())");
      await page.evaluate(async () => {
        await window.isoform.camera({ position: [5, 5, 5], target: [0.1, 0, 0] });
        await window.isoform.section({ normal: [0, 1, 0], offset: 0.25 });
        await window.isoform.set("layer-1", { opacity: 0.5, colorBy: "part" });
        window.isOld = true;
      });
      file("ball.hf", dented(0).replace("typical=1", "typical=1.25"));
      await reloaded(page);
      assert.equal((await parameter())[0].value, 1.25, "what was not moved is as the file says");
      const { camera, layers } = await page.evaluate(async () => ({
        camera: await window.isoform.camera(),
        layers: await window.isoform.layers(),
      }));
      assert.deepEqual(
        [camera.position, camera.target],
        [
          [5, 5, 5],
          [0.1, 0, 0],
        ],
      );
      assert.equal(layers[0].opacity, 0.5);
      assert.ok(await page.getByLabel("Cut by a plane").isChecked());

      await page.evaluate(async () => {
        await window.isoform.setParameter("radius", 0.75);
        window.isOld = true;
      });
      file("ball.hf", dented(0).replace("typical=1", "typical=1.5"));
      await reloaded(page);
      assert.equal((await parameter())[0].value, 0.75, "what was moved stays");

      file("ball.hf", "my_model(x[3], a[1]) { my_model = <b>; }");
      const told = page.getByRole("status").filter({ hasText: "Shown as it was before" });
      await told.waitFor();
      assert.match(await told.innerText(), /ball\.hf:1:35/);
      assert.equal(await page.evaluate("isoform.ready.then(() => isoform.layers().length)"), 1);
      file("ball.hf", dented(0));
      await told.waitFor({ state: "hidden" });
      await page.evaluate("isoform.ready");
    });
  } finally {
    child.kill("SIGINT");
  }
});

test("a served page says when its server has ended", async () => {
  const { child, address } = await serve(file("four.xyz", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"));
  const page = await browser.newPage();
  await page.goto(address);
  await page.evaluate("isoform.ready");
  child.kill("SIGINT");
  await page.getByText("has ended").waitFor();
  assert.equal(await page.evaluate("isoform.ready.then(() => isoform.layers()[0].count)"), 4);
  await page.close();
});
