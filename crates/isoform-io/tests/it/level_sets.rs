//! Level sets in 3MF packages: what is refused, with the place and in time, and what is written.

use crate::common::damage::{apply, damage};
use crate::common::package::{package, tetrahedron};
use isoform_geom::Aabb;
use isoform_io::{
    ImplicitModel, ImplicitProgram, MeshReadOptions, ReadError, ReadOptions, ScalarFunction,
    ScalarGraph, ScalarOperation, Source, is_implicit, read, read_implicit, read_mesh,
    write_implicit,
};
use proptest::prelude::*;
use std::time::{Duration, Instant};

/// Time limit for the small files below.
const SOON: Duration = Duration::from_secs(5);

/// Returns a model with these functions, and a level set of function 1 in a tetrahedron.
fn model(functions: &str) -> String {
    let mesh = tetrahedron(7);
    format!(
        "<model unit=\"millimeter\" \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" \
         xmlns:v=\"http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01\" \
         xmlns:i=\"http://schemas.3mf.io/3dmanufacturing/implicit/2023/12\" \
         requiredextensions=\"v i\"><resources>{functions}{mesh}<object id=\"8\" name=\"it\">\
         <v:levelset functionid=\"1\" channel=\"f\" meshid=\"7\"/></object></resources><build>\
         <item objectid=\"8\"/></build></model>"
    )
}

/// Returns a function of the position with these nodes.
fn function(id: u32, nodes: &str, value: &str) -> String {
    format!(
        "<i:implicitfunction id=\"{id}\" displayname=\"F{id}\"><i:in><i:vector \
         identifier=\"pos\"/></i:in>{nodes}<i:out><i:scalarref identifier=\"f\" ref=\"{value}\"/>\
         </i:out></i:implicitfunction>"
    )
}

/// Returns a node of scalars.
fn node(kind: &str, name: &str, inputs: &[(&str, &str)]) -> String {
    let inputs: String = inputs
        .iter()
        .map(|(key, from)| format!("<i:scalarref identifier=\"{key}\" ref=\"{from}\"/>"))
        .collect();
    format!(
        "<i:{kind} identifier=\"{name}\"><i:in>{inputs}</i:in><i:out><i:scalar \
         identifier=\"result\"/></i:out></i:{kind}>"
    )
}

/// Returns the node with the coordinates.
fn point() -> String {
    "<i:decomposevector identifier=\"p\"><i:in><i:vectorref identifier=\"A\" ref=\"inputs.pos\"/>\
     </i:in><i:out><i:scalar identifier=\"x\"/><i:scalar identifier=\"y\"/><i:scalar \
     identifier=\"z\"/></i:out></i:decomposevector>"
        .to_owned()
}

/// Returns the nodes of a call of a function at a point.
fn call(name: &str, id: &str, at: &str) -> String {
    format!(
        "<i:constresourceid identifier=\"{name}id\" value=\"{id}\"><i:out><i:resourceid \
         identifier=\"value\"/></i:out></i:constresourceid><i:functioncall identifier=\"{name}\">\
         <i:in><i:resourceref identifier=\"functionID\" ref=\"{name}id.value\"/><i:vectorref \
         identifier=\"pos\" ref=\"{at}\"/></i:in><i:out><i:scalar identifier=\"f\"/></i:out>\
         </i:functioncall>"
    )
}

fn try_program(text: &str) -> Result<Option<ImplicitProgram>, ReadError> {
    let bytes = package(text);
    read_implicit(Source::Bytes {
        name: "part.3mf",
        bytes: &bytes,
    })
}

fn program(text: &str) -> ImplicitProgram {
    let found = try_program(text).unwrap_or_else(|e| panic!("{e}"));
    found.expect("a level set")
}

fn refused(text: &str) -> ReadError {
    try_program(text).expect_err("it must be refused")
}

#[test]
fn functions_become_statements() {
    let nodes = point() + &node("addition", "n", &[("A", "p.x"), ("B", "p.y")]);
    let read = program(&model(&function(1, &nodes, "n.result")));
    assert_eq!((read.units.as_str(), read.warnings.len()), ("mm", 0));
    assert!(
        read.text
            .starts_with("-- @title it\n-- @unit mm\nmy_model(x[3], a[1])")
    );
    assert!(read.text.contains("-(x[1] + x[2])"), "{}", read.text);
    // The name is what a call gives to its value; a number keeps it apart from words of HyperFun.
    let inner = point() + &node("sin", "n", &[("A", "p.x")]);
    let outer = call("c", "2", "inputs.pos") + &node("abs", "n", &[("A", "c.f")]);
    let text = model(&(function(1, &outer, "n.result") + &function(2, &inner, "n.result")));
    let read = program(&text.replace("F2", "while 3"));
    assert!(read.text.contains("  while_3_"), "{}", read.text);
}

/// Asserts that a model is refused with a code and with words.
fn assert_refused(text: &str, code: &str, words: &str) {
    let e = refused(text);
    let is_said = e.code() == code && e.why.contains(words) && !e.hint.is_empty();
    assert!(is_said, "{code} {words}: {e} [{}]", e.code());
}

/// Changes of a sound model, each with the words of its refusal.
const WRONG: [(&str, &str, &str); 17] = [
    (r#""A" ref="p.x""#, r#""B" ref="p.x""#, "no input A"),
    (r#"ref="p.x""#, r#"ref="""#, "A is not connected"),
    ("p.x", "q.x", "q.x, which is not there"),
    ("p.x", "p.w", "p.w, which is not there"),
    (
        "p.x",
        "inputs.pos",
        "A is a scalar, and is connected to a vector",
    ),
    ("p.x", "n.result", "depends on itself"),
    (r#"channel="f""#, r#"channel="g""#, "no output g"),
    (r#"meshid="7""#, r#"meshid="8""#, "no mesh 8"),
    (
        r#"meshid="7""#,
        r#"meshid="7" fallbackvalue="nan""#,
        "fallbackvalue",
    ),
    (
        r#"meshid="7""#,
        r#"meshid="7" transform="1 0""#,
        "is no transform",
    ),
    (
        r#"functionid="1""#,
        r#"functionid="4294967296""#,
        "is not a number",
    ),
    (
        "objectid=\"8\"",
        "objectid=\"8\" transform=\"1 0 0 0 1 0 0 0 0 1 1 1\"",
        "no inverse",
    ),
    (r#"z="1""#, r#"z="0""#, "no volume"),
    (
        "</i:in><i:decompose",
        "<i:scalar identifier=\"r\"/></i:in><i:decompose",
        "the input r besides",
    ),
    (
        r#"<i:scalar identifier="result"/>"#,
        r#"<i:vector identifier="result"/>"#,
        "called a vector",
    ),
    (
        r#"<i:scalar identifier="y"/>"#,
        r#"<i:scalar identifier="x"/>"#,
        "two outputs x of nodes",
    ),
    (
        "<i:scalarref identifier=\"A\" ref=\"p.x\"/>",
        "",
        "no input A",
    ),
];

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let good = point() + &node("sin", "n", &[("A", "p.x")]);
    let text = model(&function(1, &good, "n.result"));
    program(&text);
    for (from, to, words) in WRONG {
        assert!(text.contains(from), "{from}");
        assert_refused(&text.replacen(from, to, 1), "file-corrupt", words);
    }
    let lacks = |name: &str, words: &str| {
        assert_refused(&text.replace("i:sin", name), "format-unsupported", words);
    };
    lacks("i:warp", "a warp, which is not known");
    lacks("i:mesh", "distance to a mesh");
    let mixed = text.replace("<build>", "<build><item objectid=\"7\"/>");
    assert_refused(&mixed, "format-unsupported", "object 7 is a mesh");
    let open = text.replace("<triangle v1=\"0\" v2=\"2\" v3=\"1\"/>", "");
    assert_refused(&open, "format-unsupported", "is not closed");
    let other = text.replace("functionid=\"1\"", "functionid=\"4294967295\"");
    assert_refused(&other, "bad-index", "no function 4294967295");
    let image = model("<v:functionfromimage3d id=\"1\" image3did=\"9\"/>");
    assert_refused(&image, "format-unsupported", "functionfromimage3d");
    let one = function(1, &good, "n.result");
    assert_refused(
        &model(&(one.clone() + &one)),
        "file-corrupt",
        "function 1 is there twice",
    );
}

#[test]
fn circles_are_refused() {
    let calls = |id: u32, to: &str| function(id, &call("c", to, "inputs.pos"), "c.f");
    assert_refused(&model(&calls(1, "1")), "file-corrupt", "in a circle: 1");
    let two = model(&(calls(1, "2") + &calls(2, "1")));
    assert_refused(&two, "file-corrupt", "in a circle: 1, 2");
    assert_refused(&model(&calls(1, "5")), "bad-index", "no function 5");
    let nodes = node("sin", "n", &[("A", "m.result")]) + &node("cos", "m", &[("A", "n.result")]);
    let nodes = model(&function(1, &nodes, "n.result"));
    assert_refused(&nodes, "file-corrupt", "depends on itself");
}

#[test]
fn constants_are_finite_numbers() {
    for (node, words) in [
        (
            "constant identifier=\"n\" value=\"nan\"",
            "value=\"nan\" is no finite number",
        ),
        (
            "constant identifier=\"n\" value=\"1e999\"",
            "is no finite number",
        ),
        (
            "constvec identifier=\"n\" x=\"1\" y=\"2\"",
            "z=\"\" is no finite number",
        ),
        (
            "constmat identifier=\"n\" matrix=\"1 2 3\"",
            "no matrix of 16 numbers",
        ),
        (
            "constresourceid identifier=\"n\" value=\"-1\"",
            "not the number of a resource",
        ),
    ] {
        let kind = node.split(' ').next().unwrap_or_default();
        let output = "<i:out><i:scalar identifier=\"result\"/></i:out>";
        let nodes = format!("<i:{node}>{output}</i:{kind}>");
        assert_refused(
            &model(&function(1, &nodes, "n.result")),
            "file-corrupt",
            words,
        );
    }
}

/// A mesh that is not convex cannot be the bounds as a formula; its box can.
#[test]
fn a_bounding_mesh_is_convex_or_a_box() {
    // A corner of the tetrahedron is pushed in: five points, six triangles.
    let dented = "<object id=\"7\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" \
        y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"1\"/><vertex \
        x=\"0.2\" y=\"0.2\" z=\"0.2\"/></vertices><triangles><triangle v1=\"0\" v2=\"2\" v3=\"1\"/>\
        <triangle v1=\"0\" v2=\"1\" v3=\"3\"/><triangle v1=\"0\" v2=\"3\" v3=\"2\"/><triangle \
        v1=\"1\" v2=\"2\" v3=\"4\"/><triangle v1=\"2\" v2=\"3\" v3=\"4\"/><triangle v1=\"3\" \
        v2=\"1\" v3=\"4\"/></triangles></mesh></object>";
    let nodes = point() + &node("sin", "n", &[("A", "p.x")]);
    let text = model(&function(1, &nodes, "n.result"));
    let dented = text.replace(tetrahedron(7).trim_end(), dented);
    let e = refused(&dented);
    assert!(
        e.why.contains("not convex") && e.hint.contains("meshbboxonly"),
        "{e}"
    );
    program(&dented.replace("meshid=", "meshbboxonly=\"true\" meshid="));
}

/// Verbs of points and meshes say what the file is.
#[test]
fn readers_of_points_name_level_sets() {
    let nodes = point() + &node("sin", "n", &[("A", "p.x")]);
    let bytes = package(&model(&function(1, &nodes, "n.result")));
    let source = Source::Bytes {
        name: "part.3mf",
        bytes: &bytes,
    };
    assert!(is_implicit(source));
    let e = read(source, None, &ReadOptions::default()).expect_err("a function");
    assert!(
        e.why.contains("level sets") && e.hint.contains("isoform mesh"),
        "{e}"
    );
    let e = read_mesh(source, None, &MeshReadOptions::default()).expect_err("a function");
    assert_eq!(e.code(), "format-unsupported");
    // Functions next to a mesh do not matter to it, wrong ones included.
    let colours = model(&function(1, "", "nothing")).replace("\"8\"/></build>", "\"7\"/></build>");
    let bytes = package(&colours);
    let source = Source::Bytes {
        name: "part.3mf",
        bytes: &bytes,
    };
    assert!(!is_implicit(source) && read_implicit(source).is_ok_and(|p| p.is_none()));
    let (mesh, report) = read_mesh(source, None, &MeshReadOptions::default()).expect("a mesh");
    assert_eq!((mesh.triangles.len(), report.warnings.len()), (4, 1));
}

/// Small files whose work or depth would grow without end.
#[test]
fn multitudes_are_refused_or_shared() {
    let start = Instant::now();
    // Forty levels of two calls with one argument: shared.
    let same = |id: u32| {
        let inner = (id + 1).to_string();
        let nodes = call("a", &inner, "inputs.pos")
            + &call("b", &inner, "inputs.pos")
            + &node("addition", "n", &[("A", "a.f"), ("B", "b.f")]);
        function(id, &nodes, "n.result")
    };
    let last = |id: u32| {
        function(
            id,
            &(point() + &node("sin", "n", &[("A", "p.x")])),
            "n.result",
        )
    };
    let functions: String = (1..41).map(same).collect();
    let text = program(&model(&(functions + &last(41)))).text;
    assert!(text.len() < 10_000, "{}", text.len());
    // The same with two arguments, which double with every level.
    let two = |id: u32| {
        let inner = (id + 1).to_string();
        let shift = |name: &str, x: &str| {
            format!(
                "<i:constvec identifier=\"{name}c\" x=\"{x}\" y=\"{id}\" z=\"0\"><i:out><i:vector \
                 identifier=\"vector\"/></i:out></i:constvec><i:addition identifier=\"{name}p\">\
                 <i:in><i:vectorref identifier=\"A\" ref=\"inputs.pos\"/><i:vectorref \
                 identifier=\"B\" ref=\"{name}c.vector\"/></i:in><i:out><i:vector \
                 identifier=\"result\"/></i:out></i:addition>"
            )
        };
        let nodes = shift("a", "0.3")
            + &shift("b", "0.7")
            + &call("a", &inner, "ap.result")
            + &call("b", &inner, "bp.result")
            + &node("addition", "n", &[("A", "a.f"), ("B", "b.f")]);
        function(id, &nodes, "n.result")
    };
    let functions: String = (1..41).map(two).collect();
    let e = refused(&model(&(functions + &last(41))));
    assert!(e.code() == "too-large" && e.why.contains("500000"), "{e}");
    // Calls that are nested deeper than the stack allows.
    let one = |id: u32| function(id, &call("a", &(id + 1).to_string(), "inputs.pos"), "a.f");
    let functions: String = (1..5000).map(one).collect();
    let e = refused(&model(&(functions + &last(5000))));
    assert!(
        e.code() == "too-large" && e.why.contains("64 levels"),
        "{e}"
    );
    // A chain of a hundred thousand nodes is read; so are as many outputs of one node.
    let mut chain = point() + &node("sin", "n0", &[("A", "p.x")]);
    for i in 1..100_000 {
        let before = format!("n{}.result", i - 1);
        chain += &node("sin", &format!("n{i}"), &[("A", &before)]);
    }
    program(&model(&function(1, &chain, "n99999.result")));
    let mut wide = String::from("<i:warp identifier=\"w\"><i:out>");
    for i in 0..100_000 {
        wide += &format!("<i:scalar identifier=\"o{i}\"/>");
    }
    wide += "</i:out></i:warp>";
    let e = refused(&model(&function(1, &wide, "w.o99999")));
    assert!(e.why.contains("warp"), "{e}");
    assert!(start.elapsed() < 2 * SOON, "{:?}", start.elapsed());
}

/// Ten thousand copies of a level set are read, more are not.
#[test]
fn copies_have_a_limit() {
    let start = Instant::now();
    let nodes = point() + &node("sin", "n", &[("A", "p.x")]);
    let text = model(&function(1, &nodes, "n.result"));
    let items = |count: usize| "<item objectid=\"8\"/>".repeat(count);
    let with = |count| text.replace("<item objectid=\"8\"/>", &items(count));
    assert!(program(&with(10_000)).text.len() < 10_000);
    assert_eq!(refused(&with(10_001)).code(), "too-large");
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
}

/// Writes √(x + 1) − 2 in a box and reads it.
#[test]
fn written_models_are_read() {
    let mut graph = ScalarGraph::new();
    let (x, one, two) = (
        graph.coordinate(0),
        graph.constant(1.0),
        graph.constant(2.0),
    );
    let sum = graph.binary(ScalarOperation::Add, x, one);
    let root = graph.unary(ScalarFunction::Sqrt, sum);
    let root = graph.binary(ScalarOperation::Sub, root, two);
    let endless = graph.constant(f64::INFINITY);
    let model = ImplicitModel {
        graph: &graph,
        root,
        bounds: Aabb {
            lo: [-3.0, 0.0, 0.5],
            hi: [4.0, 1e-3, 1e6],
        },
        name: "a <root> & more",
        units: Some("in"),
    };
    let mut bytes = Vec::new();
    write_implicit(&model, &mut bytes).expect("memory");
    let source = Source::Bytes {
        name: "root.3mf",
        bytes: &bytes,
    };
    let read = read_implicit(source).expect("sound").expect("a level set");
    assert_eq!((read.units.as_str(), read.warnings.len()), ("in", 0));
    assert!(
        read.text
            .starts_with("-- @title a <root> & more\n-- @unit in\n")
    );
    for part in [
        "sqrt(",
        "if t_",
        "1000000 - x[3]",
        "0.001 - x[2]",
        "x[1] - (-3)",
    ] {
        let part = part.replace("x[1] - (-3)", "3 + x[1]");
        assert!(read.text.contains(&part), "{part}: {}", read.text);
    }
    // Numbers that 3MF cannot hold.
    let model = ImplicitModel {
        root: endless,
        ..model
    };
    let e = write_implicit(&model, &mut Vec::new()).expect_err("infinite");
    assert!(e.to_string().contains("inf"), "{e}");
}

/// Returns a model of calls and choices, some of them undefined, for damage and fuzzing.
pub(crate) fn seed() -> String {
    let inner = point() + &node("sqrt", "n", &[("A", "p.x")]);
    let outer = point()
        + &call("c", "2", "inputs.pos")
        + &node(
            "select",
            "n",
            &[("A", "c.f"), ("B", "p.y"), ("C", "p.z"), ("D", "c.f")],
        );
    model(&(function(1, &outer, "n.result") + &function(2, &inner, "n.result")))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn damaged_functions(damages in prop::collection::vec(damage(), 1..4)) {
        let text = seed();
        let mut bytes = text.into_bytes();
        damages.iter().for_each(|d| apply(&mut bytes, d));
        let start = Instant::now();
        match try_program(&String::from_utf8_lossy(&bytes)) {
            Ok(read) => prop_assert!(read.is_none_or(|r| r.text.contains("my_model = "))),
            Err(e) => prop_assert!(!e.why.is_empty() && !e.hint.is_empty()),
        }
        prop_assert!(start.elapsed() < SOON);
    }
}
