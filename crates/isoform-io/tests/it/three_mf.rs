//! 3MF packages of other programs and malicious ones: the content that is read, and the errors.

use crate::common::damage::{apply, damage};
use crate::common::package::{Packing, RELATIONS, model, package, packed, tetrahedron};
use isoform_geom::{Mesh, Point3, cross, dot, sub};
use isoform_io::{
    MeshPoints, MeshReadOptions, ReadError, ReadOptions, ReadReport, Source, read, read_mesh,
};
use isoform_testdata::data;
use proptest::prelude::*;
use std::time::{Duration, Instant};

fn try_mesh(bytes: &[u8]) -> Result<(Mesh, ReadReport), ReadError> {
    let name = "part.3mf";
    read_mesh(
        Source::Bytes { name, bytes },
        None,
        &MeshReadOptions::default(),
    )
}

fn mesh(bytes: &[u8]) -> (Mesh, ReadReport) {
    try_mesh(bytes).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(bytes: &[u8]) -> ReadError {
    try_mesh(bytes).expect_err("it must be refused")
}

/// Returns six times the signed volume inside the triangles of a part.
fn six_volumes(mesh: &Mesh, part: u32) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c]: [Point3; 3] = t.map(|n| mesh.points[n as usize]);
        dot(a, cross(b, c))
    };
    let labelled = mesh.triangles.iter().zip(&mesh.triangle_parts);
    labelled.filter(|l| *l.1 == part).map(|l| of(l.0)).sum()
}

#[test]
fn pythons_zipfile_and_every_packing() {
    for name in ["pyzip_parts.3mf", "pyzip_stored_zip64.3mf"] {
        let bytes = std::fs::read(data("formats").join(name)).expect("a file");
        let (mesh, report) = mesh(&bytes);
        assert_eq!(report.warnings, Vec::<String>::new());
        assert_eq!(report.units.as_deref(), Some("in"));
        // Two copies of one object, one of them mirrored, and one of another part, twice as large.
        let names = [
            "foot.steel",
            "foot.brass",
            "foot (2).steel",
            "foot (2).brass",
            "top",
        ];
        assert_eq!(mesh.parts, names);
        assert_eq!(mesh.points[1], [1.0, 0.0, 5.0]);
        assert_eq!(mesh.points[5], [9.0, 0.0, 5.0]);
        assert_eq!(mesh.points[9], [2.0, 0.0, 5.0]);
        let counts: Vec<usize> = (0..5)
            .map(|p| mesh.triangle_parts.iter().filter(|&&q| q == p).count())
            .collect();
        assert_eq!(counts, [3, 1, 3, 1, 4]);
        // All normals point outwards, also those of the mirrored copy.
        let volumes: [f64; 5] = std::array::from_fn(|p| six_volumes(&mesh, p as u32));
        let whole = [volumes[0] + volumes[1], volumes[2] + volumes[3], volumes[4]];
        assert_eq!(whole, [1.0, 1.0, 8.0], "{volumes:?}");
    }
    let text = model(&tetrahedron(3), "<item objectid=\"3\"/>");
    let members = [
        ("_rels/.rels", RELATIONS),
        ("3D/3dmodel.model", text.as_str()),
    ];
    for (is_deflated, is_zip64) in [(false, false), (false, true), (true, false), (true, true)] {
        let packing = Packing {
            is_deflated,
            is_zip64,
        };
        let (mesh, _) = mesh(&packed(&members, packing));
        assert_eq!((mesh.points.len(), mesh.triangles.len()), (4, 4));
        assert!(mesh.parts.is_empty() && mesh.points[3] == [0.0, 0.0, 1.0]);
    }
}

/// A rotation about z, then one about x with a shift, in the order of row vectors.
#[test]
fn maps_are_nested_from_inside_out() {
    let turn_z = "0 1 0 -1 0 0 0 0 1 0 0 0";
    let turn_x = "1 0 0 0 0 1 0 -1 0 0 0 7";
    let inner = format!(
        "<object id=\"2\"><components><component objectid=\"1\" transform=\"{turn_z}\"/>\
         </components></object>"
    );
    let item = format!("<item objectid=\"2\" transform=\"{turn_x}\"/>");
    let (mesh, _) = mesh(&package(&model(&(tetrahedron(1) + &inner), &item)));
    // x goes to y and then to z, y to −x, z to −y.
    let want = [
        [0.0, 0.0, 7.0],
        [0.0, 0.0, 8.0],
        [-1.0, 0.0, 7.0],
        [0.0, -1.0, 7.0],
    ];
    assert_eq!(mesh.points, want);
    let edges: [Point3; 3] = [1, 2, 3].map(|k| sub(mesh.points[k], mesh.points[0]));
    assert_eq!(dot(edges[0], cross(edges[1], edges[2])), 1.0);
}

#[test]
fn odd_packages_are_read_with_a_word() {
    // A prefix for everything, single quotes, comments, missing relationships, and an unusual name.
    let odd = "<?xml version='1.0'?><!-- <model> --><c:model unit='foot' xmlns:c='core' \
        requiredextensions='s' \
        xmlns:s='http://schemas.microsoft.com/3dmanufacturing/slice/2015/07'>\
        <c:resources><s:slicestack id='9'><s:vertex x='1' y='2'/></s:slicestack>\
        <c:object id='4' name='a &amp; b'><c:mesh><c:vertices><c:vertex x='1e-1' y=' 2' z='-3'/>\
        </c:vertices></c:mesh></c:object></c:resources><c:build/></c:model>";
    let (one, report) = mesh(&packed(&[("x/Odd.MODEL", odd)], Packing::default()));
    assert_eq!(one.points, [[0.1, 2.0, -3.0]]);
    assert_eq!(report.units.as_deref(), Some("ft"));
    let said = |words: &str| report.warnings.iter().any(|w| w.contains(words));
    assert!(
        said("slice/2015/07") && said("nothing is to be built"),
        "{report:?}"
    );

    // A vertex that is not a number, read as points and as samples.
    let text = model(
        &tetrahedron(1).replace("x=\"1\"", "x=\"nan\""),
        "<item objectid=\"1\"/>",
    );
    let bytes = package(&text);
    let source = Source::Bytes {
        name: "part.3mf",
        bytes: &bytes,
    };
    let (cloud, report) = read(source, None, &ReadOptions::default()).expect("points");
    assert_eq!((cloud.points.len(), cloud.triangles.len()), (3, 1));
    assert_eq!((report.format, report.dropped_points), ("3mf", 1));
    let options = ReadOptions {
        mesh: MeshPoints::Samples(100),
        ..ReadOptions::default()
    };
    let (samples, _) = read(source, None, &options).expect("samples");
    assert_eq!(samples.points.len(), 100);
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let wrong = |resources: &str, build: &str| refused(&package(&model(resources, build)));
    let all = tetrahedron(1);
    for (resources, build, code, words) in [
        (
            all.replace("v3=\"3\"", "v3=\"4\""),
            "",
            "bad-index",
            "of 4 vertices",
        ),
        (
            all.replace("v3=\"3\"", "v3=\"-1\""),
            "",
            "bad-number",
            "\"-1\" is not a number",
        ),
        (
            all.replace("x=\"1\"", "x=\"one\""),
            "",
            "bad-number",
            "line 3: x=\"one\"",
        ),
        (
            all.clone(),
            "<item objectid=\"2\"/>",
            "bad-index",
            "no object 2",
        ),
        (all.clone(), "<item/>", "bad-number", "objectid"),
        (
            all.clone(),
            "<item objectid=\"1\" transform=\"1 2\"/>",
            "bad-number",
            "12 numbers",
        ),
        (all.clone() + &all, "", "file-corrupt", "twice"),
        (
            "<object id=\"1\"".to_owned(),
            "",
            "file-corrupt",
            "line 2: object 1 does not end",
        ),
    ] {
        let e = wrong(&resources, build);
        assert_eq!(e.code(), code, "{e}");
        assert!(e.why.contains(words), "{words}: {e}");
    }
    let e = refused(&package("<html></html>"));
    assert!(e.code() == "bad-header" && e.why.contains("html"), "{e}");
    let e = refused(&package("<model>"));
    assert_eq!(e.code(), "file-truncated", "{e}");
    let e = refused(&packed(
        &[("word/document.xml", "<a/>")],
        Packing::default(),
    ));
    assert!(
        e.code() == "bad-header" && e.why.contains("no 3MF package"),
        "{e}"
    );
    let entities = "<!DOCTYPE m [<!ENTITY a \"bb\">]><model/>";
    let e = refused(&package(entities));
    assert!(e.why.contains("declaration"), "{e}");
}

/// Time limit for the packages below, which are small and refused before they are expanded.
const SOON: Duration = Duration::from_secs(5);

#[test]
fn circles_and_multitudes_are_refused() {
    let start = Instant::now();
    let assembly = |id: u32, of: &[u32]| {
        let components: String = of
            .iter()
            .map(|o| format!("<component objectid=\"{o}\"/>"))
            .collect();
        format!("<object id=\"{id}\"><components>{components}</components></object>")
    };
    let circle = assembly(1, &[2, 2]) + &assembly(2, &[1, 1]);
    let e = refused(&package(&model(&circle, "<item objectid=\"1\"/>")));
    assert!(e.why.contains("circle"), "{e}");
    // Forty doublings, of a mesh and of nothing.
    for first in [tetrahedron(1), assembly(1, &[])] {
        let doublings = (2..42).map(|id| assembly(id, &[id - 1, id - 1]));
        let text = first + &doublings.collect::<String>();
        let e = refused(&package(&model(&text, "<item objectid=\"41\"/>")));
        assert_eq!(e.code(), "too-large", "{e}");
    }
    // A chain that no single object reveals, since each is built by itself.
    let chain: String = (2..5000).map(|id| assembly(id, &[id - 1])).collect();
    let items: String = (1..5000)
        .map(|id| format!("<item objectid=\"{id}\"/>"))
        .collect();
    let e = refused(&package(&model(&(tetrahedron(1) + &chain), &items)));
    assert!(e.why.contains("64 levels"), "{e}");
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
}

#[test]
fn bombs_are_refused() {
    let start = Instant::now();
    let packing = Packing {
        is_deflated: true,
        is_zip64: false,
    };
    // A text of 200 MB in 200 kB.
    let blank = " ".repeat(200 << 20);
    let bomb = format!("{}{blank}", model(&tetrahedron(1), ""));
    let members = [
        ("_rels/.rels", RELATIONS),
        ("3D/3dmodel.model", bomb.as_str()),
    ];
    let bytes = packed(&members, packing);
    assert!(bytes.len() < 1 << 20);
    let e = refused(&bytes);
    assert!(e.code() == "too-large" && e.why.contains("far more"), "{e}");
    // A member whose stated size is too small.
    let mut liar = bytes.clone();
    let directory = liar
        .windows(4)
        .rposition(|w| w == b"PK\x01\x02")
        .expect("an entry");
    liar[directory + 24..directory + 28].copy_from_slice(&1000_u32.to_le_bytes());
    let e = refused(&liar);
    assert!(
        e.code() == "file-corrupt" && e.why.contains("more than"),
        "{e}"
    );
    // A hundred members that share the bytes of one; the model needs all of them.
    let mut paths = String::new();
    for i in 0..100 {
        paths += &format!("<component objectid=\"1\" p:path=\"/m{i}.model\"/>");
    }
    let root = model(
        &format!("<object id=\"1\"><components>{paths}</components></object>"),
        "",
    );
    let part = model(&tetrahedron(1), "") + &" ".repeat(1 << 20);
    let names: Vec<String> = (0..100).map(|i| format!("m{i}.model")).collect();
    let mut members = vec![("3D/3dmodel.model", root.as_str())];
    members.extend(names.iter().map(|n| (n.as_str(), part.as_str())));
    let e = refused(&packed(&members, packing));
    assert_eq!(e.code(), "too-large", "{e}");
    assert!(start.elapsed() < 2 * SOON, "{:?}", start.elapsed());
}

#[test]
fn a_damaged_member_is_noticed() {
    let mut bytes = package(&model(&tetrahedron(1), "<item objectid=\"1\"/>"));
    let at = bytes
        .windows(5)
        .position(|w| w == b"x=\"1\"")
        .expect("a vertex");
    bytes[at + 3] = b'2';
    let e = refused(&bytes);
    assert!(
        e.code() == "file-corrupt" && e.why.contains("checksum"),
        "{e}"
    );
    let mut encrypted = package(&model(&tetrahedron(1), ""));
    for at in 0..encrypted.len() - 4 {
        if encrypted[at..].starts_with(b"PK\x01\x02") {
            encrypted[at + 8] |= 1;
        }
    }
    assert_eq!(refused(&encrypted).code(), "format-unsupported");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Damage that precedes the checksum, which therefore agrees.
    #[test]
    fn damaged_models(damages in prop::collection::vec(damage(), 1..4)) {
        let object = "<object id=\"2\"><components><component objectid=\"1\" \
            transform=\"1 0 0 0 1 0 0 0 1 1 2 3\"/><component objectid=\"1\"/></components>\
            </object>";
        let text = model(
            &(tetrahedron(1) + object),
            "<item objectid=\"2\"/><item objectid=\"1\"/>",
        );
        let mut bytes = text.into_bytes();
        damages.iter().for_each(|d| apply(&mut bytes, d));
        let start = Instant::now();
        match try_mesh(&package(&String::from_utf8_lossy(&bytes))) {
            Ok((mesh, _)) => {
                let count = mesh.points.len();
                prop_assert!(mesh.triangles.iter().flatten().all(|&n| (n as usize) < count));
                let parts = mesh.parts.len();
                prop_assert!(mesh.triangle_parts.iter().all(|&p| (p as usize) < parts));
            }
            Err(e) => prop_assert!(!e.why.is_empty() && !e.hint.is_empty()),
        }
        prop_assert!(start.elapsed() < SOON);
    }
}
