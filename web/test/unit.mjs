// Tests of what the viewer computes: node test/unit.mjs
import { build } from "esbuild";
import assert from "node:assert/strict";
import { dirname, join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

const source = join(dirname(fileURLToPath(import.meta.url)), "../src");
const entry = [
  "tape",
  "interval",
  "solid",
  "bvh",
  "caps",
  "measure",
  "glsl",
  "patches",
  "native",
  "exact",
  "dom",
  "scene",
  "bearing",
  "studio/ply",
  "studio/parts",
  "studio/faces",
]
  .map((m) => `export * as ${m.replace("studio/", "")} from "./${m}";`)
  .join("\n");
const bundle = await build({
  stdin: { contents: entry, resolveDir: source, loader: "ts" },
  bundle: true,
  write: false,
  format: "esm",
  platform: "node",
});
const {
  tape,
  interval,
  solid,
  bvh,
  caps,
  bearing,
  measure,
  glsl,
  patches,
  native,
  exact,
  dom,
  scene,
  ply,
  parts,
  faces,
} = await import(
  `data:text/javascript;base64,${Buffer.from(bundle.outputFiles[0].text).toString("base64")}`
);

/** Numbers between 0 and 1, the same in every run. */
let seed = 1;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
const between = (a, b) => a + (b - a) * random();

const UNARY = [
  "neg",
  "abs",
  "square",
  "sqrt",
  "exp",
  "ln",
  "sin",
  "cos",
  "tan",
  "asin",
  "acos",
  "atan",
  "sinh",
  "cosh",
  "tanh",
  "floor",
  "ceil",
  "trunc",
  "sign",
];
const BINARY = [
  "add",
  "sub",
  "mul",
  "div",
  "pow",
  "atan2",
  "less",
  "lesseq",
  "runion",
  "rintersection",
  "max",
  "min",
];
const STEPS = [
  ...UNARY.map((op) => [op, 0]),
  ...BINARY.map((op) => [op, 0, 1]),
  ["select", 0, 1, 2],
  ["powi", 0, 3],
  ["powi", 0, 2],
  ["powi", 0, -1],
  ["powi", 0, -2],
  ["fmod", 0, 1],
];

/** A tape of one step on x, y and z. */
const single = (step) =>
  tape.Tape.of({
    inputs: 3,
    parameters: 0,
    constants: [],
    steps: [step],
    uniform: 0,
    results: [3],
  });

test("ranges contain the values, of every operation", () => {
  for (const step of STEPS) {
    const t = single(step);
    const ranges = new interval.Ranges(t);
    const evaluator = new tape.Evaluator(t);
    for (let k = 0; k < 400; k++) {
      const [wide, shift] = [random() < 0.5 ? 4 : 0.3, between(-2, 2)];
      const ends = [0, 1, 2].map(() =>
        [between(-wide, wide) + shift, between(-wide, wide) + shift].sort((a, b) => a - b),
      );
      ranges.run(
        ends.map((e) => e[0]),
        ends.map((e) => e[1]),
      );
      for (let i = 0; i < 20; i++)
        for (let c = 0; c < 3; c++)
          evaluator.coordinate(c)[i] = i < 2 ? ends[c][i] : between(...ends[c]);
      evaluator.run(20);
      for (const v of evaluator.result(0).slice(0, 20)) {
        const room = 1e-12 * (1 + Math.abs(v));
        assert.ok(
          Number.isNaN(v) || (ranges.lo[3] <= v + room && ranges.hi[3] >= v - room),
          `${step}: ${v} in ${ranges.lo[3]} .. ${ranges.hi[3]}`,
        );
      }
    }
  }
});

test("every operation has a meaning in the shader", () => {
  for (const step of [...STEPS, ["ellipsoid", 0, 1, 2, 0, 1, 2]]) {
    const text = new glsl.SolidShader(single(step), [0]).text("solid", "u");
    assert.ok(!text.includes("undefined") && text.includes("return f0"), `${step}`);
  }
  assert.throws(() => single(["unheard", 0]), /unheard/);
});

/** A ball of radius a1 less the half space x > 1/4, as a document. Slot 0 is 1/4, 1 to 3 are x, y
 *  and z, 4 is a1, 11 the function of the ball, 12 that of the cut, 13 both, 14 the part. */
const DOC = {
  kind: "model",
  name: "ball",
  title: null,
  parts: ["ball", "cut"],
  tree: [0, 1, "min"],
  values: [1],
  parameters: [],
  bounds: [
    [-1, -1, -1],
    [0.25, 1, 1],
  ],
  isCut: false,
  isLoose: true,
  origin: [0, 0, 0],
  tape: {
    inputs: 3,
    parameters: 1,
    constants: [0.25],
    uniform: 1,
    results: [11, 12, 13, 14],
    steps: [
      ["square", 4],
      ["square", 1],
      ["square", 2],
      ["square", 3],
      ["add", 6, 7],
      ["add", 9, 8],
      ["sub", 5, 10],
      ["sub", 0, 1],
      ["min", 11, 12],
      ["less", 12, 11],
    ],
  },
};
test("a ray meets a solid where it should, after its parameters moved, too", () => {
  const ball = new solid.Solid(DOC);
  const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-9, `${a} of ${b}`);
  near(ball.meet([-5, 0, 0], [1, 0, 0], 0, 10), 4);
  near(ball.meet([5, 0, 0], [-1, 0, 0], 0, 10), 4.75);
  assert.equal(ball.meet([-5, 1.01, 0], [1, 0, 0], 0, 10), null);
  // A ray that grazes the sphere by a millionth.
  assert.notEqual(ball.meet([-5, 1 - 1e-6, 0], [1, 0, 0], 0, 10), null);
  assert.equal(ball.partAt([0.25, 0, 0]), "cut");
  ball.values[0] = 3;
  ball.changed();
  near(ball.meet([-5, 0, 0], [1, 0, 0], 0, 10), 2);
});

test("the grid holds all of the surface", () => {
  const ball = new solid.Solid(DOC);
  for (const radius of [1, 0.3, 30]) {
    ball.values[0] = radius;
    ball.changed();
    const { box, n, cells } = ball.brick();
    const size = [0, 1, 2].map((k) => box.hi[k] - box.lo[k]);
    assert.ok(Math.max(...size) < 2.3 * radius, `a box of ${size} for the radius ${radius}`);
    for (let k = 0; k < 2000; k++) {
      const [z, turn] = [between(-1, 1), between(0, 2 * Math.PI)];
      const p = [
        Math.sqrt(1 - z * z) * Math.cos(turn),
        Math.sqrt(1 - z * z) * Math.sin(turn),
        z,
      ].map((v) => v * radius);
      if (p[0] > 0.25) continue;
      const i = p.map((v, c) => Math.min(n[c] - 1, Math.floor(((v - box.lo[c]) / size[c]) * n[c])));
      assert.equal(cells[i[0] + n[0] * (i[1] + n[1] * i[2])], 1, `${p}`);
    }
  }
});

test("gaps of cells are those to the nearest that may contain surface", () => {
  for (const [n, share] of [
    [[9, 7, 5], 0.02],
    [[1, 6, 11], 0.1],
    [[4, 4, 4], 0],
  ]) {
    const cells = Uint8Array.from({ length: n[0] * n[1] * n[2] }, () => Number(random() < share));
    const places = [...cells.keys()].map((i) => [
      i % n[0],
      Math.floor(i / n[0]) % n[1],
      Math.floor(i / n[0] / n[1]),
    ]);
    const full = places.filter((_, i) => cells[i]);
    const found = solid.gaps({ box: { lo: [0, 0, 0], hi: n }, n, cells });
    places.forEach((p, i) => {
      const away = full.map((q) => Math.max(...p.map((v, k) => Math.abs(v - q[k]))));
      assert.equal(found[i], Math.min(255, ...away), `${p} of ${n}`);
    });
  }
});

test("the tree finds the triangle that trying all of them finds", () => {
  const points = Float64Array.from({ length: 900 }, () => between(-1, 1));
  const triangles = Uint32Array.from({ length: 900 }, () => Math.floor(300 * random()));
  const tree = new bvh.Bvh(points, triangles);
  const all = Array.from(
    { length: 300 },
    (_, i) => new bvh.Bvh(points, triangles.slice(3 * i, 3 * i + 3)),
  );
  for (let k = 0; k < 300; k++) {
    const o = [between(-3, 3), between(-3, 3), -3];
    const d = k % 3 ? [between(-1, 1), between(-1, 1), 1] : [0, 0, 1];
    const found = tree.meet(o, d, 0, () => true);
    const least = Math.min(...all.map((t) => t.meet(o, d, 0, () => true)?.t ?? Infinity));
    assert.equal(found ? found.t : Infinity, least);
  }
});

/** The area of triangles, three numbers for each corner. */
const area = (cap) => {
  let sum = 0;
  for (let i = 0; i < cap.length; i += 9) {
    const [u, v] = [
      [0, 1, 2].map((k) => cap[i + 3 + k] - cap[i + k]),
      [0, 1, 2].map((k) => cap[i + 6 + k] - cap[i + k]),
    ];
    sum +=
      0.5 *
      Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  }
  return sum;
};

test("caps of a cube with a hollow leave the hollow open", () => {
  const cube = (half, isInward, first) => {
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) =>
      [0, 1, 2].map((k) => ((i >> k) & 1 ? half : -half)),
    );
    const quads = [
      [0, 2, 3, 1],
      [4, 5, 7, 6],
      [0, 1, 5, 4],
      [2, 6, 7, 3],
      [0, 4, 6, 2],
      [1, 3, 7, 5],
    ];
    const faces = quads
      .flatMap(([a, b, c, d]) => (isInward ? [a, c, b, a, d, c] : [a, b, c, a, c, d]))
      .map((i) => i + first);
    return { corners, faces };
  };
  const [outer, inner] = [cube(1, false, 0), cube(0.5, true, 8)];
  const points = Float64Array.from([...outer.corners, ...inner.corners]);
  const triangles = Uint32Array.from([...outer.faces, ...inner.faces]);
  const cut = (normal, offset) => area(caps.ofSurface(points, triangles, { normal, offset }));
  assert.ok(Math.abs(cut([0, 0, 1], 0.1) - 3) < 1e-12);
  assert.ok(Math.abs(cut([0, 0, 1], 0.7) - 4) < 1e-12);
  assert.equal(cut([0, 0, 1], 1.5), 0);
  const s = Math.SQRT1_2;
  assert.ok(
    Math.abs(cut([s, s, 0], 0.1) - ((2 * Math.SQRT2 - 0.2) * 2 - (Math.SQRT2 - 0.2) * 1)) < 1e-12,
  );
});

test("caps of a tetrahedron", () => {
  const points = Float64Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
  const cut = (offset) =>
    area(caps.ofTetrahedra(points, Uint32Array.from([0, 1, 2, 3]), { normal: [0, 0, 1], offset }));
  assert.ok(Math.abs(cut(0.5) - 0.125) < 1e-15 && cut(2) === 0);
});

test("a place of a patch moves onto the ray", () => {
  const paraboloid = (u, v) => ({
    point: [u, v, u * u + v * v],
    u: [1, 0, 2 * u],
    v: [0, 1, 2 * v],
  });
  const [u, v, there] = patches.ontoRay(paraboloid, [0.3, 0.4, 5], [0, 0, -1], [0.25, 0.5]);
  assert.ok(Math.hypot(u - 0.3, v - 0.4) < 1e-12 && Math.abs(there.point[2] - 0.25) < 1e-12);
});

test("angles, circles, ellipsoids", () => {
  const { angle, radius } = measure.angleAndRadius([
    [1, 0, 0],
    [0, 0, 0],
    [0, 1, 0],
  ]);
  assert.ok(Math.abs(angle - 90) < 1e-12 && Math.abs(radius - Math.SQRT1_2) < 1e-12);
  assert.ok(Math.abs(native.ellipsoidDistance([5, 0, 0, 3, 2, 1]) + 2) < 1e-12);
  assert.ok(Math.abs(native.ellipsoidDistance([0, 0, 0, 3, 2, 1]) - 1) < 1e-12);
});

test("a ray meets the surface of a face near its triangle", () => {
  const meet = (kind, measures, o, d, near, reach = 0.1) => {
    const frame = { origin: [1e3, 0, 0], z: [0, 0.6, 0.8], x: [1, 0, 0] };
    const y = [0, 0.8, -0.6];
    const turned = (v) => [0, 1, 2].map((k) => v[0] * frame.x[k] + v[1] * y[k] + v[2] * frame.z[k]);
    const from = turned(o).map((v, k) => v + frame.origin[k]);
    return exact.meetSurface({ kind, measures, ...frame }, from, turned(d), near, reach);
  };
  const cases = [
    ["plane", [], [0, 0, 3], [0.6, 0, -0.8], 3.75],
    ["cylinder", [2], [5, 0, 7], [-1, 0, 0], 3],
    ["cone", [2, Math.PI / 4], [9, 0, 1], [-1, 0, 0], 6],
    ["sphere", [2], [0, 1.2, -5], [0, 0, 1], 3.4],
    ["torus", [3, 1], [3, 0, 5], [0, 0, -1], 4],
    ["ellipsoid", [1, 2, 3], [0, 0, 5], [0, 0, -1], 2],
  ];
  for (const [kind, measures, o, d, want] of cases) {
    const t = meet(kind, measures, o, d, want + 0.03);
    assert.ok(Math.abs(t - want) < 1e-11, `${kind}: ${t} of ${want}`);
    assert.equal(meet(kind, measures, o, d, want + 0.5), null, `${kind}: too far`);
  }
  assert.equal(meet("sphere", [2], [2.001, 0, -5], [0, 0, 1], 5), null, "it passes by");
});

test("places far from the origin keep the digits of the scene", () => {
  const at = [1000001.25, 2e6, -3e6];
  assert.equal(dom.placeWithin(at, 5), "1000001.25000, 2000000.00000, \u22123000000.00000");
  assert.equal(dom.placeWithin([0.5, -1, 2e-5], 4), "0.5, \u22121, 2e\u22125");
  assert.equal(dom.placeWithin([1e300, 0, 0], 1e-300), "1e+300, 0, 0");
});

/** A binary PLY file of points with an entity each, and a face behind them. */
function plyFile(points, entities) {
  const header =
    `ply\nformat binary_little_endian 1.0\ncomment made here\nelement vertex ${points.length}\n` +
    "property double x\nproperty double y\nproperty double z\nproperty uchar red\n" +
    "property double entity\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const head = new TextEncoder().encode(header);
  const bytes = new Uint8Array(head.length + 33 * points.length + 13);
  bytes.set(head);
  const view = new DataView(bytes.buffer);
  points.forEach((p, i) => {
    const at = head.length + 33 * i;
    p.forEach((v, k) => view.setFloat64(at + 8 * k, v, true));
    view.setUint8(at + 24, 7);
    view.setFloat64(at + 25, entities[i], true);
  });
  return bytes.buffer;
}

test("points of a PLY file get other entities, are cropped and put in another frame", () => {
  const points = [
    [1, 2, 3],
    [4, 5, 6],
    [1, 3, 3],
  ];
  const file = new ply.Ply(plyFile(points, [0, -1, 2]));
  assert.equal(file.count, 3);
  assert.deepEqual([...file.column("entity")], [0, -1, 2]);
  const changed = new ply.Ply(file.withColumn("entity", (i) => 10 + i));
  assert.deepEqual([...changed.column("entity")], [10, 11, 12]);
  assert.deepEqual([...changed.column("x")], [1, 4, 1]);
  const some = file.filtered((i) => i !== 1);
  const cropped = new ply.Ply(some);
  assert.deepEqual([cropped.count, ...cropped.column("z")], [2, 3, 3]);
  assert.ok(!new TextDecoder("latin1").decode(some).includes("element face"));
  const z = [0, 0, 1];
  const moved = new ply.Ply(file.inFrame([1, 2, 3], [[0, 1, 0], [-1, 0, 0], z]));
  assert.deepEqual([...moved.column("x")], [0, 3, 1]);
  assert.deepEqual(
    [...moved.column("y")].map((v) => v + 0),
    [0, -3, 0],
  );
  assert.deepEqual([...moved.column("z")], [0, 3, 0]);
  for (const bad of [
    "",
    "ply\nend_header\n",
    "ply\nformat ascii 1.0\nelement vertex 1\nend_header\n",
  ])
    assert.throws(() => new ply.Ply(new TextEncoder().encode(bad).buffer), /PLY/);
  const cut = plyFile(points, [0, 0, 0]).slice(0, -40);
  assert.throws(() => new ply.Ply(cut), /cut off/);
});

test("a packed scene is a document with its arrays", () => {
  const text = new TextEncoder().encode(
    '{"layers":[{"a":{"blob":1,"deflated":false},"b":{"blob":0,"deflated":true}}],"arrays":[2,3]}',
  );
  const packed = new Uint8Array(4 + text.length + 5);
  new DataView(packed.buffer).setUint32(0, text.length, true);
  packed.set(text, 4);
  packed.set([1, 2, 3, 4, 5], 4 + text.length);
  const [layer] = scene.unpackScene(packed.buffer).layers;
  assert.deepEqual([...layer.a.bytes], [3, 4, 5]);
  assert.deepEqual([...layer.b.bytes], [1, 2]);
});

test("values have the digits that their deviations leave", () => {
  assert.equal(parts.withSd(12.345678, 0.0123), "12.346 \u00b1 0.012");
  assert.equal(parts.withSd(-1234.5, 20), "\u22121235 \u00b1 20");
  assert.equal(parts.withSd(5, 0), "5");
  assert.equal(parts.withSd(5, 1e-15), "5");
  const cone = { type: "cone", parameters: { half_angle: Math.PI / 6 }, sd: { half_angle: 0 } };
  assert.equal(faces.sizes(cone), "half angle 30\u00b0");
});

test("scales have round lengths", () => {
  for (const [length, round] of [
    [9.99, 5],
    [10, 10],
    [0.0499, 0.02],
    [5e-7, 5e-7],
    [2.3e8, 2e8],
  ])
    assert.ok(Math.abs(bearing.roundBelow(length) / round - 1) < 1e-9, `${length}`);
});
