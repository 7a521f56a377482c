//! Level sets of 3MF: values of their programs against closed forms, and programs written and read
//! back.

use isoform::field::hyperfun::{Mode, Model};
use isoform::field::{Graph, parameter_values};
use isoform::geom::{Aabb, Point3};
use isoform::io::{ImplicitProgram, Source, read_implicit};
use isoform::{Control, LevelSetFileError, level_set_file};
use isoform_testdata::{cases, files, files_in, shared_data, stem};
use std::path::{Path, PathBuf};

/// Returns the checksum of a member (CRC-32 of ISO 3309), bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = !0_u32;
    for &b in bytes {
        sum ^= u32::from(b);
        for _ in 0..8 {
            sum = sum >> 1 ^ (0xEDB8_8320 * (sum & 1));
        }
    }
    !sum
}

/// Returns a package of one stored model.
fn package(model: &str) -> Vec<u8> {
    let name = b"3D/3dmodel.model";
    let length = (model.len() as u32).to_le_bytes();
    let common = [
        &[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..],
        &checksum(model.as_bytes()).to_le_bytes(),
        &length,
        &length,
        &[name.len() as u8, 0, 0, 0],
    ]
    .concat();
    let member = [b"PK\x03\x04", &common[..], name, model.as_bytes()].concat();
    let directory = [b"PK\x01\x02\x14\0", &common[..], &[0; 14], name].concat();
    let size = (directory.len() as u32).to_le_bytes();
    let start = (member.len() as u32).to_le_bytes();
    let end = [
        b"PK\x05\x06\0\0\0\0\x01\0\x01\0",
        &size[..],
        &start,
        &[0; 2],
    ]
    .concat();
    [member, directory, end].concat()
}

/// A cube from −2 to 2 in single triangles, as object 7.
fn cube() -> String {
    let mut text = "<object id=\"7\"><mesh><vertices>".to_owned();
    for i in 0..8 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| [-2.0, 2.0][i >> k & 1]);
        text += &format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    }
    text += "</vertices><triangles>";
    for t in [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ] {
        text += &format!(
            "<triangle v1=\"{}\" v2=\"{}\" v3=\"{}\"/>",
            t[0], t[1], t[2]
        );
    }
    text + "</triangles></mesh></object>"
}

/// Returns a node with inputs of a type and one output of a type.
fn node(kind: &str, name: &str, of: &str, inputs: &[(&str, &str)], result: &str) -> String {
    let inputs: String = inputs
        .iter()
        .map(|(key, from)| format!("<i:{of}ref identifier=\"{key}\" ref=\"{from}\"/>"))
        .collect();
    format!(
        "<i:{kind} identifier=\"{name}\"><i:in>{inputs}</i:in><i:out><i:{result} \
         identifier=\"result\"/></i:out></i:{kind}>"
    )
}

/// Returns a constant.
fn constant(name: &str, value: &str) -> String {
    format!(
        "<i:constant identifier=\"{name}\" value=\"{value}\"><i:out><i:scalar \
         identifier=\"value\"/></i:out></i:constant>"
    )
}

/// Coordinates as scalars, and vectors and matrices of them.
fn inputs() -> String {
    let parts = "<i:decomposevector identifier=\"p\"><i:in><i:vectorref identifier=\"A\" \
        ref=\"inputs.pos\"/></i:in><i:out><i:scalar identifier=\"x\"/><i:scalar \
        identifier=\"y\"/><i:scalar identifier=\"z\"/></i:out></i:decomposevector>";
    let vector = "<i:constvec identifier=\"c\" x=\"0.5\" y=\"-1.25\" z=\"2\"><i:out><i:vector \
        identifier=\"vector\"/></i:out></i:constvec>";
    let matrix = "<i:constmat identifier=\"m\" matrix=\"2 0 1 0  0 3 0 0  1 1 -1 0  4 5 6 1\">\
        <i:out><i:matrix identifier=\"matrix\"/></i:out></i:constmat>";
    let more = [
        ("half", "0.5"),
        ("two", "2"),
        ("three", "3"),
        ("minus", "-1.5"),
    ];
    let constants: String = more.iter().map(|(name, v)| constant(name, v)).collect();
    [parts, vector, matrix, &constants].concat()
}

/// Returns a model of one function, given its nodes and the reference to its value.
fn model(nodes: &str, value: &str, level_set: &str, item: &str) -> String {
    let cube = cube();
    let inputs = inputs();
    format!(
        "<model unit=\"millimeter\" \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" \
         xmlns:v=\"http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01\" \
         xmlns:i=\"http://schemas.3mf.io/3dmanufacturing/implicit/2023/12\" \
         requiredextensions=\"v i\"><resources><i:implicitfunction id=\"1\"><i:in><i:vector \
         identifier=\"pos\"/></i:in>{inputs}{nodes}<i:out><i:scalarref identifier=\"f\" \
         ref=\"{value}\"/></i:out></i:implicitfunction>{cube}<object id=\"8\" name=\"test\">\
         <v:levelset functionid=\"1\" channel=\"f\" meshid=\"7\" {level_set}/></object>\
         </resources><build><item objectid=\"8\" {item}/></build></model>"
    )
}

/// Reads the program of a model.
fn program(model: &str) -> ImplicitProgram {
    let bytes = package(model);
    let source = Source::Bytes {
        name: "test.3mf",
        bytes: &bytes,
    };
    let found = read_implicit(source).unwrap_or_else(|e| panic!("{e}\n{model}"));
    found.expect("a level set")
}

/// A program as an expression and as it is run.
struct Evaluator {
    model: Model,
    graph: Graph,
    root: isoform::field::NodeId,
    text: String,
}

impl Evaluator {
    fn new(text: &str) -> Self {
        let model = Model::parse(text, Mode::Default);
        let model = model.unwrap_or_else(|e| panic!("{}:{}: {e}\n{text}", e.line, e.column));
        assert!(
            model.warnings().is_empty(),
            "{:?}\n{text}",
            model.warnings()
        );
        let mut graph = Graph::new();
        let root = model.compile(&mut graph).expect("an expression");
        let text = text.to_owned();
        Self {
            model,
            graph,
            root,
            text,
        }
    }

    /// Evaluates both ways, which must agree.
    fn value(&self, p: Point3) -> f64 {
        let a = [0.0];
        let value = self.graph.eval(self.root, &p, &a);
        let run = self.model.eval(&p, &a, &[]).map(|e| e.f);
        assert_eq!(run, Ok(value), "at {p:?} of\n{}", self.text);
        value
    }
}

fn random_points(count: usize, half: f64) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(7);
    let mut point = || std::array::from_fn(|_| half * (2.0 * random.f64() - 1.0));
    (0..count).map(|_| point()).collect()
}

/// Returns the level set's value at a point: the negated function in the cube from −2 to 2.
fn expected(f: f64, [x, y, z]: Point3) -> f64 {
    let sides = [x, y, z].map(|c| (2.0 - c).min(c + 2.0));
    sides.into_iter().fold(-f, f64::min)
}

fn assert_close(got: f64, want: f64, what: &str) {
    let error = (got - want).abs() / want.abs().max(1.0);
    assert!(error <= 1e-13, "{what}: {got} instead of {want}");
}

type Formula = fn(f64, f64, f64) -> f64;

/// Element, its inputs, and its value in closed form.
type NodeCase = (
    &'static str,
    &'static [(&'static str, &'static str)],
    Formula,
);
/// Map of space.
type PointMap = Box<dyn Fn(Point3) -> Point3>;

/// Operations on numbers with their inputs and formulas.
const OPERATIONS: [NodeCase; 44] = [
    ("addition", &[("A", "p.x"), ("B", "p.y")], |x, y, _| x + y),
    ("subtraction", &[("B", "p.x"), ("A", "p.y")], |x, y, _| {
        y - x
    }),
    (
        "multiplication",
        &[("A", "p.x"), ("B", "p.y")],
        |x, y, _| x * y,
    ),
    (
        "division",
        &[("A", "p.x"), ("B", "two.value")],
        |x, _, _| x / 2.0,
    ),
    ("division", &[("A", "p.x"), ("B", "p.z")], |x, _, z| x / z),
    ("sin", &[("A", "p.x")], |x, _, _| x.sin()),
    ("cos", &[("A", "p.y")], |_, y, _| y.cos()),
    ("tan", &[("A", "half.value")], |_, _, _| 0.5_f64.tan()),
    ("tan", &[("A", "p.x")], |x, _, _| x.tan()),
    ("arcsin", &[("A", "half.value")], |_, _, _| 0.5_f64.asin()),
    ("asin", &[("A", "p.x")], |x, _, _| x.asin()),
    ("arccos", &[("A", "p.x")], |x, _, _| x.acos()),
    ("acos", &[("A", "p.z")], |_, _, z| z.acos()),
    ("arctan", &[("A", "p.x")], |x, _, _| x.atan()),
    ("atan", &[("A", "p.x")], |x, _, _| x.atan()),
    ("arctan2", &[("A", "p.x"), ("B", "p.y")], |x, y, _| {
        x.atan2(y)
    }),
    ("atan2", &[("A", "p.z"), ("B", "p.y")], |_, y, z| z.atan2(y)),
    ("sinh", &[("A", "p.x")], |x, _, _| x.sinh()),
    ("cosh", &[("A", "p.x")], |x, _, _| x.cosh()),
    ("tanh", &[("A", "p.x")], |x, _, _| x.tanh()),
    ("min", &[("A", "p.x"), ("B", "p.y")], |x, y, _| x.min(y)),
    ("max", &[("A", "p.x"), ("B", "p.y")], |x, y, _| x.max(y)),
    ("abs", &[("A", "p.x")], |x, _, _| x.abs()),
    ("sqrt", &[("A", "p.x")], |x, _, _| x.sqrt()),
    ("exp", &[("A", "p.x")], |x, _, _| x.exp()),
    ("log", &[("A", "p.x")], |x, _, _| x.ln()),
    ("log2", &[("A", "p.x")], |x, _, _| x.log2()),
    ("log10", &[("A", "p.x")], |x, _, _| x.log10()),
    ("floor", &[("A", "p.x")], |x, _, _| x.floor()),
    ("ceil", &[("A", "p.x")], |x, _, _| x.ceil()),
    ("round", &[("A", "p.x")], |x, _, _| x.round()),
    ("round", &[("A", "minus.value")], |_, _, _| -2.0),
    ("sign", &[("A", "p.x")], |x, _, _| x.signum()),
    ("fract", &[("A", "p.x")], |x, _, _| x - x.floor()),
    ("fmod", &[("A", "p.x"), ("B", "half.value")], |x, _, _| {
        x % 0.5
    }),
    ("mod", &[("A", "p.x"), ("B", "half.value")], |x, _, _| {
        x.rem_euclid(0.5)
    }),
    ("mod", &[("A", "p.x"), ("B", "minus.value")], |x, _, _| {
        x + 1.5 * (x / -1.5).floor()
    }),
    ("pow", &[("A", "p.x"), ("B", "three.value")], |x, _, _| {
        x * x * x
    }),
    ("pow", &[("A", "p.x"), ("B", "half.value")], |x, _, _| {
        x.powf(0.5)
    }),
    ("pow", &[("A", "p.x"), ("B", "minus.value")], |x, _, _| {
        x.powf(-1.5)
    }),
    ("pow", &[("A", "two.value"), ("B", "p.y")], |_, y, _| {
        2_f64.powf(y)
    }),
    (
        "clamp",
        &[("A", "p.x"), ("min", "half.value"), ("max", "p.y")],
        |x, y, _| x.min(y).max(0.5),
    ),
    (
        "select",
        &[("A", "p.x"), ("B", "p.y"), ("C", "p.z"), ("D", "two.value")],
        |x, y, z| if x < y { z } else { 2.0 },
    ),
    (
        "select",
        &[
            ("A", "half.value"),
            ("B", "half.value"),
            ("C", "p.z"),
            ("D", "p.x"),
        ],
        |x, _, _| x,
    ),
];

/// Where a formula is no number, 3MF takes the fallback value, here 3.
#[test]
fn operations_have_their_formulas() {
    for (kind, inputs, formula) in OPERATIONS {
        let nodes = node(kind, "n", "scalar", inputs, "scalar");
        let read = program(&model(&nodes, "n.result", "fallbackvalue=\"3\"", ""));
        let evaluator = Evaluator::new(&read.text);
        for p in random_points(500, 2.5) {
            let f = formula(p[0], p[1], p[2]);
            let f = if f.is_nan() { 3.0 } else { f };
            assert_close(evaluator.value(p), expected(f, p), kind);
        }
    }
}

/// Products of vectors and matrices, and operations on their components.
#[test]
fn vectors_and_matrices_have_their_formulas() {
    let vector = |kind, name, inputs: &[_]| node(kind, name, "vector", inputs, "vector");
    let matrix = |kind, name, inputs: &[_]| node(kind, name, "matrix", inputs, "matrix");
    let image = |m: &str| {
        format!(
            "<i:matvecmultiplication identifier=\"v\"><i:in><i:matrixref identifier=\"A\" \
             ref=\"{m}\"/><i:vectorref identifier=\"B\" ref=\"inputs.pos\"/></i:in><i:out>\
             <i:vector identifier=\"result\"/></i:out></i:matvecmultiplication>"
        )
    };
    // The sum of the components with the weights 1, 2 and 3.
    let weigh = "<i:constvec identifier=\"w\" x=\"1\" y=\"2\" z=\"3\"><i:out><i:vector \
        identifier=\"vector\"/></i:out></i:constvec>"
        .to_owned()
        + &node(
            "dot",
            "n",
            "vector",
            &[("A", "v.result"), ("B", "w.vector")],
            "scalar",
        );
    let m = [
        [2.0, 0.0, 1.0],
        [0.0, 3.0, 0.0],
        [1.0, 1.0, -1.0],
        [4.0, 5.0, 6.0],
    ];
    let row_times = |p: Point3, m: &[Point3; 4]| -> Point3 {
        std::array::from_fn(|k| (0..3).map(|i| p[i] * m[i][k]).sum::<f64>() + m[3][k])
    };
    let c = [0.5, -1.25, 2.0];
    let four = [
        ("A", "inputs.pos"),
        ("B", "c.vector"),
        ("C", "c.vector"),
        ("D", "c.vector"),
    ];
    let cases: [(String, PointMap); 9] = [
        (
            vector(
                "multiplication",
                "v",
                &[("A", "inputs.pos"), ("B", "c.vector")],
            ),
            Box::new(move |p| std::array::from_fn(|k| p[k] * c[k])),
        ),
        (
            vector("cross", "v", &[("A", "inputs.pos"), ("B", "c.vector")]),
            Box::new(move |p| isoform::geom::cross(p, c)),
        ),
        (vector("select", "v", &four), Box::new(move |_| c)),
        (
            node(
                "composevector",
                "v",
                "scalar",
                &[("z", "p.x"), ("x", "p.y"), ("y", "p.z")],
                "vector",
            ),
            Box::new(|p| [p[1], p[2], p[0]]),
        ),
        (
            node("vectorfromscalar", "v", "scalar", &[("A", "p.y")], "vector"),
            Box::new(|p| [p[1]; 3]),
        ),
        (image("m.matrix"), Box::new(move |p| row_times(p, &m))),
        (
            matrix("transpose", "t", &[("A", "m.matrix")]) + &image("t.result"),
            Box::new(move |p| std::array::from_fn(|k| (0..3).map(|i| p[i] * m[k][i]).sum())),
        ),
        (
            // M M⁻¹ is the identity.
            matrix("inverse", "t", &[("A", "m.matrix")])
                + &image("m.matrix").replace("\"v\"", "\"u\"")
                + &image("t.result").replace("inputs.pos", "u.result"),
            Box::new(|p| p),
        ),
        (
            node("matrixfromrows", "t", "vector", &four, "matrix") + &image("t.result"),
            Box::new(move |p| row_times(p, &[p, c, c, c])),
        ),
    ];
    for (i, (nodes, formula)) in cases.iter().enumerate() {
        let read = program(&model(&(nodes.clone() + &weigh), "n.result", "", ""));
        let evaluator = Evaluator::new(&read.text);
        for p in random_points(200, 2.5) {
            let v = formula(p);
            let f = v[0] + 2.0 * v[1] + 3.0 * v[2];
            assert_close(evaluator.value(p), expected(f, p), &format!("case {i}"));
        }
        let is_product = nodes.contains("matvec");
        assert_eq!(!read.warnings.is_empty(), is_product, "{:?}", read.warnings);
    }
}

/// The nodes of |p| − 1.
fn ball() -> String {
    node("length", "l", "vector", &[("A", "inputs.pos")], "scalar")
        + &node(
            "subtraction",
            "n",
            "scalar",
            &[("A", "l.result"), ("B", "two.value")],
            "scalar",
        )
        .replace("two.value", "one.value")
        + &constant("one", "1")
}

/// A ball that the function's map makes half as large, and the build turns, shifts and mirrors.
#[test]
fn maps_lead_to_the_build() {
    let level_set = "transform=\"2 0 0 0 2 0 0 0 2 1 0 0\" meshbboxonly=\"true\"";
    let item = "transform=\"0 1 0 -1 0 0 0 0 -1 10 20 30\"";
    let evaluator = Evaluator::new(&program(&model(&ball(), "n.result", level_set, item)).text);
    for q in random_points(500, 2.5) {
        // The item maps x to y, y to −x and z to −z.
        let p = [10.0 - q[1], 20.0 + q[0], 30.0 - q[2]];
        let f = 2.0 * ((q[0] + 0.5).hypot(q[1]).hypot(q[2])) - 1.0;
        assert_close(evaluator.value(p), expected(f, q), "placed");
    }
}

/// An operation that is not taken does not matter, and one that is taken counts with the fallback.
#[test]
fn undefined_values_take_the_fallback() {
    let root = node("sqrt", "r", "scalar", &[("A", "p.x")], "scalar");
    let choice = node(
        "select",
        "n",
        "scalar",
        &[
            ("A", "p.x"),
            ("B", "half.value"),
            ("C", "p.y"),
            ("D", "r.result"),
        ],
        "scalar",
    );
    let whole =
        Evaluator::new(&program(&model(&(root.clone() + &choice), "n.result", "", "")).text);
    let part = |set: &str| Evaluator::new(&program(&model(&root, "r.result", set, "")).text);
    let (inside, outside) = (part("fallbackvalue=\"-0.25\""), part(""));
    for p in random_points(500, 2.0) {
        let [x, y, _] = p;
        let f = if x < 0.5 { y } else { x.sqrt() };
        assert_close(whole.value(p), expected(f, p), "choice");
        let f = if x < 0.0 { -0.25 } else { x.sqrt() };
        assert_close(inside.value(p), expected(f, p), "inside");
        // 0 would be inside for a program.
        assert!(x >= 0.0 || outside.value(p) < 0.0, "{p:?}");
    }
}

/// A convex mesh bounds by its faces, here a tetrahedron, and a cube by its box.
#[test]
fn convex_meshes_bound_by_their_faces() {
    let vertices: String = [[-2, -2, -2], [2, -2, -2], [-2, 2, -2], [-2, -2, 2]]
        .iter()
        .map(|[x, y, z]| format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>"))
        .collect();
    let triangles: String = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
        .iter()
        .map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>"))
        .collect();
    let corner = format!(
        "<object id=\"7\"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles>\
         </mesh></object>"
    );
    let text = model(&ball(), "n.result", "", "");
    let cut = Evaluator::new(&program(&text.replace(&cube(), &corner)).text);
    let whole = Evaluator::new(&program(&text).text);
    let boxed = model(&ball(), "n.result", "meshbboxonly=\"true\"", "");
    let boxed = Evaluator::new(&program(&boxed).text);
    for p in random_points(500, 2.5) {
        let [x, y, z] = p;
        let f = x.hypot(y).hypot(z) - 1.0;
        let slope = (-2.0 - x - y - z) / 3_f64.sqrt();
        let want = [x + 2.0, y + 2.0, z + 2.0, slope];
        let want = want.into_iter().fold(-f, f64::min);
        assert_close(cut.value(p), want, "tetrahedron");
        assert_eq!(whole.value(p), boxed.value(p));
    }
}

/// Two level sets that one build places twice, one of them within an assembly.
#[test]
fn builds_are_unions() {
    let assembly = "<object id=\"9\"><components><component objectid=\"8\" \
        transform=\"1 0 0 0 1 0 0 0 1 5 0 0\"/></components></object></resources>";
    let text = model(&ball(), "n.result", "", "");
    let text = text.replace("</resources>", assembly).replace(
        "</build>",
        "<item objectid=\"9\" transform=\"1 0 0 0 1 0 0 0 1 0 1 0\"/></build>",
    );
    let evaluator = Evaluator::new(&program(&text).text);
    for p in random_points(500, 6.0) {
        let one = |q: Point3| expected(q[0].hypot(q[1]).hypot(q[2]) - 1.0, q);
        let want = one(p).max(one([p[0] - 5.0, p[1] - 1.0, p[2]]));
        assert_close(evaluator.value(p), want, "union");
    }
}

/// Writes a program as a level set in a box and compares values at random points of it; `None` if
/// it cannot be written, with the reason.
fn round_trip(path: &Path) -> Result<(), LevelSetFileError> {
    let text = std::fs::read(path).expect("readable");
    let text = String::from_utf8_lossy(&text);
    let original = Model::parse(&text, Mode::Default).expect("a program");
    // Different numbers: a quotient of two differences may otherwise be 0/0.
    let counted: Vec<f64> = (1..=original.n_params()).map(|i| i as f64).collect();
    let usual = parameter_values::<f64>(&original, &[]);
    let values = usual.or_else(|_| parameter_values(&original, &counted));
    let values = values.expect("as many values as parameters");
    let region = Aabb {
        lo: [-3.0; 3],
        hi: [4.0; 3],
    };
    let control = Control::default();
    let bytes = level_set_file(&original, &values, Some(region), "x", &control)?;
    let source = Source::Bytes {
        name: "x.3mf",
        bytes: &bytes,
    };
    let read = read_implicit(source).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let read = Evaluator::new(&read.expect("a level set").text);
    let mut graph = Graph::new();
    let root = original.compile(&mut graph).expect("an expression");
    for p in random_points(cases(2000, 200), 3.0) {
        let f = graph.eval(root, &p, &values);
        let got = read.graph.eval(read.root, &p, &[0.0]);
        let sides = p.map(|c| (4.0 - c).min(c + 3.0));
        let want = sides.into_iter().fold(f, f64::min);
        if f.is_finite() {
            let error = (got - want).abs() / want.abs().max(1.0);
            assert!(
                error <= 1e-13,
                "{} at {p:?}: {got} instead of {want}",
                path.display()
            );
        } else {
            assert!(got < 0.0, "{} at {p:?}: {got}, not outside", path.display());
        }
    }
    Ok(())
}

/// A difference of a ball and a rod stays one of two parts.
#[test]
fn set_operations_come_back() {
    let text = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; \
        my_model = hfSphere(x, c, 2) \\ hfCylinderZ(x, c, 0.5); }";
    let model = Model::parse(text, Mode::Default).expect("a program");
    let region = Aabb {
        lo: [-3.0; 3],
        hi: [3.0; 3],
    };
    let bytes = level_set_file(&model, &[0.0], Some(region), "x", &Control::default());
    let source = Source::Bytes {
        name: "x.3mf",
        bytes: &bytes.expect("written"),
    };
    let read = read_implicit(source).expect("sound").expect("a level set");
    assert!(read.text.contains(" & "), "{}", read.text);
}

/// Programs come back from 3MF as they were written; those of functions without formulas do not.
#[test]
fn programs_come_back() {
    let templates = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/templates");
    let mut all: Vec<PathBuf> = files_in(&templates, "hf");
    all.extend(files("hyperfun", "hf"));
    if let Some(folder) = shared_data("hyperfun/models") {
        all.extend(files_in(&folder, "hf"));
    }
    // Functions that are computed by iteration, and what is made of them.
    let has_none = [
        "DEllipsoid",
        "DUni",
        "DInt",
        "DSub",
        "Noise",
        "Turb",
        "Circles",
        "Crackles",
    ];
    let (mut written, mut refused) = (0, Vec::new());
    for path in &all {
        let name = stem(path);
        match round_trip(path) {
            Ok(()) => written += 1,
            Err(LevelSetFileError::Function(_)) => refused.push(name),
            Err(LevelSetFileError::Model(_) | LevelSetFileError::Expression(_)) => {}
            Err(e) => panic!("{name}: {e}"),
        }
    }
    refused.retain(|name| !has_none.iter().any(|f| name.contains(f)));
    assert_eq!(refused, Vec::<String>::new());
    assert!(10 * written > 7 * all.len(), "{written} of {}", all.len());
}
