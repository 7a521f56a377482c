//! Round trips of meshes through every format, up to what it stores, and refusal of damaged files.

use crate::common::cube::block;
use crate::common::damage::{apply, damage};
use crate::common::layers::layers;
use crate::common::meshes::{FOREIGN, mesh_fixtures};
use isoform_geom::{Column, Curve, Mesh, Point3, TET_EDGES, TRIANGLE_EDGES};
use isoform_io::{
    MeshReadOptions, MeshWriteOptions, ReadError, ReadOptions, ReadReport, Source,
    mesh_format_named, mesh_formats, read, read_mesh, write_mesh, write_mesh_path,
};
use proptest::prelude::*;
use std::time::{Duration, Instant};

/// Formats that keep everything except the names of parts of curves.
const EXACT: [&str; 5] = ["msh", "msh-binary", "msh2", "vtu", "vtu-ascii"];
/// Formats that keep triangles and parts.
const SURFACES: [&str; 4] = ["obj", "ply", "ply-ascii", "3mf"];

fn written(mesh: &Mesh, format: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh(mesh, &mut bytes, format, &MeshWriteOptions::default()).expect("memory takes all");
    bytes
}

fn read_as(bytes: &[u8], format: Option<&str>) -> Result<(Mesh, ReadReport), ReadError> {
    read_mesh(
        Source::Bytes { name: "t", bytes },
        format,
        &MeshReadOptions { boundary: false },
    )
}

fn through(mesh: &Mesh, format: &str) -> Mesh {
    let (again, report) =
        read_as(&written(mesh, format), Some(format)).expect("own files are valid");
    assert_eq!(report.warnings, Vec::<String>::new(), "{format}");
    again
}

/// Returns the block with names that every format can store.
fn plain_block(n: usize, order: u32) -> Mesh {
    let mut mesh = block(n, order);
    mesh.parts[1] = "rest & <--> of it".into();
    mesh
}

/// A block of size 1 at 1e8, where numbers of 32 bits are 8 apart, has no triangle left.
#[test]
fn triangles_that_32_bits_lose_are_counted() {
    let mut mesh = block(2, 1);
    let warnings = |mesh: &Mesh, format: &str| {
        let mut bytes = Vec::new();
        let options = MeshWriteOptions::default();
        write_mesh(mesh, &mut bytes, format, &options)
            .expect("memory takes all")
            .warnings
    };
    let is_loss = |warning: &String| warning.contains("collapse or turn over");
    assert!(!warnings(&mesh, "stl").iter().any(is_loss));
    mesh.points.iter_mut().for_each(|p| p[0] += 1e8);
    let lost = warnings(&mesh, "stl");
    assert!(lost.iter().any(is_loss), "{lost:?}");
    assert!(!warnings(&mesh, "ply").iter().any(is_loss));
}

#[test]
fn a_block_comes_back() {
    for order in [1, 2] {
        let mesh = plain_block(2, order);
        for format in EXACT {
            assert_eq!(through(&mesh, format), mesh, "{format}");
        }
    }
}

/// Returns the triangles by part and coordinates of their corners, in a canonical order.
fn soup(mesh: &Mesh) -> Vec<(u32, [[u64; 3]; 3])> {
    let mut soup: Vec<_> = (0..mesh.triangles.len())
        .map(|i| {
            let mut t = mesh.triangles[i].map(|n| mesh.points[n as usize].map(f64::to_bits));
            let first = (0..3).min_by_key(|&k| t[k]).expect("three");
            t.rotate_left(first);
            (mesh.triangle_parts.get(i).copied().unwrap_or(0), t)
        })
        .collect();
    soup.sort_unstable();
    soup
}

#[test]
fn surfaces_come_back() {
    let mut mesh = block(2, 1);
    mesh.parts = vec!["top".into(), "rest".into()];
    for format in ["obj", "ply", "ply-ascii", "stl-ascii", "3mf"] {
        let again = through(&mesh, format);
        assert_eq!(
            (soup(&again).len(), again.points.len(), &again.parts),
            (48, 26, &mesh.parts),
            "{format}"
        );
        assert_eq!(soup(&again), soup(&mesh), "{format}");
    }
    mesh.triangle_parts.clear();
    assert_eq!(soup(&through(&mesh, "off")), soup(&mesh));
    mesh.points
        .iter_mut()
        .flatten()
        .for_each(|v| *v = f64::from(*v as f32));
    assert_eq!(soup(&through(&mesh, "stl")), soup(&mesh));
}

#[test]
fn abaqus_keeps_elements_surfaces_and_names_in_capitals() {
    for order in [1, 2] {
        let mesh = block(2, order);
        let again = through(&mesh, "inp");
        assert_eq!(
            (&again.tets, &again.tet_mids, &again.tet_regions),
            (&mesh.tets, &mesh.tet_mids, &mesh.tet_regions)
        );
        assert_eq!(
            again.points, mesh.points,
            "these need no more than 20 characters"
        );
        assert_eq!(soup(&again), soup(&mesh));
        assert_eq!(again.parts, ["TOP_FACE", "REST_OF_IT"]);
        assert_eq!(again.regions, ["LEFT", "RIGHT"]);
        assert_eq!(again.triangle_mids.len(), mesh.triangle_mids.len());
        let surface = Mesh {
            tets: vec![],
            tet_mids: vec![],
            tet_regions: vec![],
            ..mesh
        };
        let again = through(&surface, "inp");
        assert_eq!(
            (soup(&again), &again.parts[..]),
            (
                soup(&surface),
                &["TOP_FACE".to_owned(), "REST_OF_IT".to_owned()][..]
            )
        );
    }
}

/// Returns the volume within the surface: a third of the sum of position times outward area.
fn volume_within(mesh: &Mesh) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|n| mesh.points[n as usize]);
    let six = mesh.triangles.iter().map(corners).map(|[a, b, c]| {
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    six.sum::<f64>() / 6.0
}

#[test]
fn wedges_come_back() {
    let mesh = layers();
    for format in EXACT {
        assert_eq!(through(&mesh, format), mesh, "{format}");
    }
    let again = through(&mesh, "inp");
    assert_eq!((&again.tets, &again.wedges), (&mesh.tets, &mesh.wedges));
    assert_eq!(
        (again.parts.join("|"), again.points),
        ("FLOOR|SIDE".into(), mesh.points.clone())
    );
    assert_eq!((again.triangles.len(), again.quads.len()), (6, 8));
    assert_eq!(
        (again.regions.join("|"), again.tet_regions),
        ("SOLID".into(), vec![0; 2])
    );
    let whole = |mut quads: Vec<[u32; 4]>| {
        quads.iter_mut().for_each(|quad| {
            let first = (0..4).min_by_key(|&k| quad[k]).expect("four");
            quad.rotate_left(first);
        });
        quads.sort_unstable();
        quads
    };
    assert_eq!(
        (whole(again.quads), again.quad_parts),
        (whole(mesh.quads.clone()), vec![1; 8])
    );
    let floor = Mesh {
        triangles: again.triangles,
        triangle_parts: again.triangle_parts,
        ..mesh.clone()
    };
    assert_eq!(soup(&floor), soup(&mesh));
}

/// If the file lacks a surface, the sides of the volumes become one.
#[test]
fn wedges_get_a_boundary() {
    let mut bare = layers();
    (bare.triangles, bare.triangle_parts) = (vec![], vec![]);
    (bare.quads, bare.quad_parts) = (vec![], vec![]);
    let bytes = written(&bare, "msh");
    let source = Source::Bytes {
        name: "t",
        bytes: &bytes,
    };
    let (again, _) = read_mesh(source, None, &MeshReadOptions::default()).expect("valid");
    assert_eq!(
        (again.triangles.len(), again.quads.len(), again.wedges.len()),
        (6, 8, 4)
    );
    let volume = volume_within(&again.simplices());
    assert!((volume - 8.0 / 15.0).abs() < 1e-12, "{volume}");
}

#[test]
fn surfaces_of_wedges_are_triangles() {
    let mesh = layers();
    let simplices = mesh.simplices();
    for format in ["obj", "ply", "stl-ascii", "3mf", "off"] {
        let again = through(&mesh, format);
        assert_eq!(again.triangles.len(), 22, "{format}");
        let volume = volume_within(&again);
        assert!((volume - 8.0 / 15.0).abs() < 1e-12, "{format}: {volume}");
        if format != "off" {
            assert_eq!(soup(&again), soup(&simplices), "{format}");
            assert_eq!(again.parts, mesh.parts, "{format}");
        }
    }
    let report = write_mesh(&mesh, &mut Vec::new(), "glb", &MeshWriteOptions::default());
    let warnings = report.expect("written").warnings;
    assert!(warnings[0].contains("22 triangles"), "{warnings:?}");
}

/// A surface alone is read as triangles.
#[test]
fn quadrilaterals_without_wedges_are_two_triangles_each() {
    let surface = Mesh {
        wedges: vec![],
        tets: vec![],
        tet_regions: vec![],
        ..layers()
    };
    for format in EXACT.into_iter().chain(["inp"]) {
        let again = through(&surface, format);
        assert_eq!(
            (again.triangles.len(), again.quads.len()),
            (22, 0),
            "{format}"
        );
        assert_eq!(
            again.triangle_parts.iter().filter(|p| **p == 0).count(),
            2,
            "{format}"
        );
        assert!(
            (volume_within(&again) - 8.0 / 15.0).abs() < 1e-12,
            "{format}"
        );
    }
}

/// Keywords of every format for wedges and quadrilaterals.
#[test]
fn how_wedges_are_called() {
    let mesh = layers();
    let has = |format: &str, rows: &[&str]| {
        let text = String::from_utf8(written(&mesh, format)).expect("text");
        for row in rows {
            assert!(text.contains(row), "{format} without {row:?}:\n{text}");
        }
    };
    // Gmsh: a block of 4 prisms (6) in the volume 1, one of 8 quadrilaterals (3) in the surface 2.
    has(
        "msh",
        &[
            "\n3 1 6 4 \n25 1 2 3 5 6 7 \n",
            "\n2 2 3 8 \n15 1 2 6 5 \n",
            "2 2 \"side\"\n",
            "3 1 \"solid\"\n",
        ],
    );
    has(
        "msh2",
        &["\n25 6 2 1 1 1 2 3 5 6 7\n", "\n15 3 2 2 2 1 2 6 5\n"],
    );
    // VTK: the normal of the first triangle points out.
    has(
        "vtu-ascii",
        &["\n0 2 1 4 6 5 \n", "\n0 1 5 4 \n", "\n13 \n", "\n9 \n"],
    );
    has(
        "inp",
        &[
            "*ELEMENT, TYPE=C3D4, ELSET=SOLID\n1, 9, 10, 11, 13\n",
            "*ELEMENT, TYPE=C3D6, ELSET=SOLID\n3, 1, 2, 3, 5, 6, 7\n",
            "*SURFACE, NAME=FLOOR, TYPE=ELEMENT\n3, S1\n4, S1\n*",
            "\n3, S3\n3, S4\n4, S4\n4, S5\n",
        ],
    );
    has(
        "bdf",
        &[
            "CPENTA  17      3       1       2       3       5       6       7       \n",
            "CQUAD4  7       2       1       2       6       5       \n",
        ],
    );
}

/// Returns the example of a step without the marks of its lines.
fn example(text: &str) -> String {
    let (_, step) = text.split_once("** STEP: ").expect("an example");
    let lines = step.lines().skip(1);
    let lines = lines.map(|line| line.strip_prefix("**").expect("a comment"));
    lines.collect::<Vec<_>>().join("\n")
}

/// The example of a step names sets, surfaces and regions that the file defines, holds one part and
/// presses on another.
#[test]
fn decks_end_with_a_step() {
    for order in [1, 2] {
        let text = String::from_utf8(written(&block(2, order), "inp")).expect("text");
        let step = example(&text);
        let named = |after: &str| {
            let rest = step.split(after).nth(1).expect(after);
            let name: &str = rest.split([',', '\n']).next().expect("a name");
            name.to_owned()
        };
        let held = named("*BOUNDARY\n");
        let pressed = named("*DSLOAD\n");
        assert_ne!(held, pressed);
        assert!(text.contains(&format!("*NSET, NSET={held}\n")));
        assert!(text.contains(&format!("*SURFACE, NAME={pressed}, TYPE=ELEMENT\n")));
        let sections = step.matches("*SOLID SECTION, ELSET=").count();
        assert_eq!(sections, text.matches("*ELEMENT, TYPE=C3D").count());
        assert!(text.contains(&format!(", ELSET={}\n", named("*SOLID SECTION, ELSET="))));
        assert!(step.ends_with("*END STEP"));
        assert!(
            text.lines()
                .all(|line| line.len() <= 132 && line.is_ascii())
        );
    }
}

/// A solid with one part alone is held at three nodes, and so is each of two pieces; shells, which
/// have no thickness, get no step.
#[test]
fn a_part_alone_is_held_at_nodes() {
    let mut mesh = block(1, 1);
    mesh.triangle_parts.clear();
    mesh.parts.clear();
    let held = |mesh: &Mesh| {
        let step = example(&String::from_utf8(written(mesh, "inp")).expect("text"));
        let rest = step
            .split("*BOUNDARY\n")
            .nth(1)
            .expect("a support")
            .to_owned();
        rest.split("\n*STEP").next().expect("lines").lines().count()
    };
    assert_eq!(held(&mesh), 4);
    let n = mesh.points.len() as u32;
    let far: Vec<_> = mesh.points.iter().map(|p| p.map(|x| x + 10.0)).collect();
    mesh.points.extend(far);
    mesh.tets
        .extend(mesh.tets.clone().iter().map(|t| t.map(|v| v + n)));
    mesh.triangles
        .extend(mesh.triangles.clone().iter().map(|t| t.map(|v| v + n)));
    mesh.tet_regions.clear();
    mesh.regions.clear();
    assert_eq!(held(&mesh), 8);
    mesh.tets.clear();
    let shells = String::from_utf8(written(&mesh, "inp")).expect("text");
    assert!(!shells.contains("STEP"));
}

/// Numbers of an XDMF file, element by element.
fn xdmf_numbers(text: &str) -> Vec<Vec<f64>> {
    let items = text.split("Format=\"XML\">").skip(1);
    let items = items.map(|item| item.split('<').next().expect("numbers"));
    items
        .map(|item| {
            item.split_whitespace()
                .map(|v| v.parse().expect("a number"))
                .collect()
        })
        .collect()
}

/// XDMF: all nodes in each file, tetrahedra with regions in one and triangles with parts in the
/// other; wedges are divided.
#[test]
fn xdmf_has_cells_of_one_kind() {
    for order in [1, 2] {
        let mesh = block(2, order);
        for (format, kinds, count, labels) in [
            (
                "xdmf",
                ["Tetrahedron", "Tetrahedron_10"],
                mesh.tets.len(),
                &mesh.tet_regions,
            ),
            (
                "xdmf-faces",
                ["Triangle", "Triangle_6"],
                mesh.triangles.len(),
                &mesh.triangle_parts,
            ),
        ] {
            let text = String::from_utf8(written(&mesh, format)).expect("text");
            let kind = kinds[order as usize - 1];
            let head = format!("TopologyType=\"{kind}\" NumberOfElements=\"{count}\"");
            assert!(text.contains(&head), "{text}");
            let [cells, points, tags] = &xdmf_numbers(&text)[..] else {
                panic!("{format}");
            };
            assert_eq!(points, mesh.points.as_flattened());
            let width = cells.len() / count;
            assert_eq!(tags.len(), count);
            for (k, (cell, tag)) in cells.chunks(width).zip(tags).enumerate() {
                assert_eq!(labels.get(k).map_or(0.0, |l| f64::from(l + 1)), *tag);
                let nodes = match format {
                    "xdmf" => mesh.tets[k].to_vec(),
                    _ => mesh.triangles[k].to_vec(),
                };
                assert!(nodes.iter().zip(cell).all(|(a, b)| f64::from(*a) == *b));
            }
        }
    }
    let mut bytes = Vec::new();
    let report = write_mesh(&layers(), &mut bytes, "xdmf", &MeshWriteOptions::default());
    let said = report.expect("memory takes all").warnings;
    assert_eq!(
        said,
        ["XDMF has no wedges here: each was written as three tetrahedra"]
    );
    let text = String::from_utf8(bytes).expect("text");
    let wedges = layers().wedges.len();
    assert_eq!(
        xdmf_numbers(&text)[2].len(),
        layers().tets.len() + 3 * wedges
    );
}

/// Returns the lists of a file of OpenFOAM, the numbers of each line.
fn foam_rows(folder: &std::path::Path, name: &str) -> Vec<Vec<usize>> {
    let text = std::fs::read_to_string(folder.join(name)).expect(name);
    let (count, rows) = text
        .split_once("}\n")
        .expect("a head")
        .1
        .split_once("\n(\n")
        .expect("(");
    let rows: Vec<Vec<usize>> = rows
        .lines()
        .take_while(|line| *line != ")")
        .map(|line| {
            let numbers = line
                .split(|c: char| !c.is_ascii_digit())
                .filter(|w| !w.is_empty());
            numbers.map(|w| w.parse().expect("a number")).collect()
        })
        .collect();
    assert_eq!(rows.len().to_string(), count);
    rows
}

/// OpenFOAM: faces close every cell, look out of their owners, stand in upper-triangular order, and
/// the parts are patches; without the nodes in the middles of edges.
#[test]
fn openfoam_has_faces_between_cells() {
    let folder = std::env::temp_dir().join(format!("isoform-io-{}-foam", std::process::id()));
    for (mesh, cells) in [(block(2, 1), 48), (block(2, 2), 48), (layers(), 6)] {
        let options = MeshWriteOptions {
            units: Some("mm".into()),
            ..MeshWriteOptions::default()
        };
        let path = folder.join("constant").join("polyMesh");
        let report = write_mesh_path(&mesh, &path, None, &options).expect("written");
        assert_eq!(report.warnings.len(), usize::from(mesh.order() == 2));
        let flat = |name: &str| foam_rows(&path, name).concat();
        let (owner, neighbour) = (flat("owner"), flat("neighbour"));
        let faces = foam_rows(&path, "faces");
        assert_eq!(faces.len(), owner.len());
        assert_eq!(owner.iter().max(), Some(&(cells - 1)));
        let pairs: Vec<_> = owner.iter().zip(&neighbour).collect();
        assert!(pairs.iter().all(|(a, b)| a < b) && pairs.is_sorted());
        let points = std::fs::read_to_string(path.join("points")).expect("points");
        let points: Vec<Vec<f64>> = points
            .lines()
            .filter(|line| line.starts_with('(') && line.len() > 1)
            .map(|line| {
                line[1..line.len() - 1]
                    .split(' ')
                    .map(|w| w.parse().expect("x"))
                    .collect()
            })
            .collect();
        // The area vectors of the sides of each cell sum up to zero, and the volume of all cells is
        // that of the mesh in cubic metres.
        let mut sums = vec![[0.0; 3]; cells];
        let mut volume = 0.0;
        for (k, face) in faces.iter().enumerate() {
            assert_eq!(face[0], face.len() - 1);
            let p = |i: usize| &points[face[i + 1]];
            let edge = |i: usize| [0, 1, 2].map(|x| p(i)[x] - p(0)[x]);
            for i in 1..face.len() - 2 {
                let (u, v) = (edge(i), edge(i + 1));
                let n = [0, 1, 2]
                    .map(|x| u[(x + 1) % 3] * v[(x + 2) % 3] - u[(x + 2) % 3] * v[(x + 1) % 3]);
                for x in 0..3 {
                    sums[owner[k]][x] += n[x];
                    if let Some(&other) = neighbour.get(k) {
                        sums[other][x] -= n[x];
                    } else {
                        volume += n[x] * p(0)[x] / 6.0;
                    }
                }
            }
        }
        assert!(
            sums.as_flattened().iter().all(|x| x.abs() < 1e-18),
            "{sums:?}"
        );
        let exact = if mesh.has_layers() {
            8.0 / 15.0
        } else {
            volume_within(&mesh)
        };
        assert!((volume / (1e-9 * exact) - 1.0).abs() < 1e-12, "{volume}");
        let patches = std::fs::read_to_string(path.join("boundary")).expect("patches");
        assert_eq!(patches.matches("type patch;").count(), mesh.parts.len());
    }
    let surface = Mesh::from_triangles(vec![[0.0; 3]; 3], vec![[0, 1, 2]]);
    let refused = write_mesh_path(
        &surface,
        &folder.join("polyMesh"),
        None,
        &Default::default(),
    );
    assert!(
        refused
            .expect_err("no volumes")
            .why
            .contains("surface alone")
    );
    let refused = write_mesh(&surface, &mut Vec::new(), "openfoam", &Default::default());
    assert!(refused.expect_err("no stream").why.contains("folder"));
    // A case has the mesh in its own place.
    let case = folder.join("case");
    write_mesh_path(&block(1, 1), &case, Some("openfoam"), &Default::default()).expect("written");
    assert!(
        case.join("constant")
            .join("polyMesh")
            .join("owner")
            .is_file()
    );
    std::fs::remove_dir_all(&folder).expect("removed");
}

/// Asserts that every mid node of the bent block is nearer to the middle of its edge than to that
/// of any other edge of the element.
fn mids_sit_right(mesh: &Mesh, format: &str) {
    let distance = |mid: u32, a: u32, b: u32| {
        let p = |n: u32| mesh.points[n as usize];
        (0..3)
            .map(|k| (p(mid)[k] - 0.5 * (p(a)[k] + p(b)[k])).powi(2))
            .sum::<f64>()
    };
    assert!(!mesh.tet_mids.is_empty() || format == "stl");
    for (t, mids) in mesh.tets.iter().zip(&mesh.tet_mids) {
        for (e, &mid) in mids.iter().enumerate() {
            let nearest = (0..6).min_by(|&i, &j| {
                let [i, j] = [i, j].map(|k| distance(mid, t[TET_EDGES[k][0]], t[TET_EDGES[k][1]]));
                i.total_cmp(&j)
            });
            assert_eq!(nearest, Some(e), "{format}");
        }
    }
    for (t, mids) in mesh.triangles.iter().zip(&mesh.triangle_mids) {
        for (e, &mid) in mids.iter().enumerate() {
            let nearest = (0..3).min_by(|&i, &j| {
                let [i, j] =
                    [i, j].map(|k| distance(mid, t[TRIANGLE_EDGES[k][0]], t[TRIANGLE_EDGES[k][1]]));
                i.total_cmp(&j)
            });
            assert_eq!(nearest, Some(e), "{format}");
        }
    }
}

#[test]
fn mid_nodes_sit_between_their_corners() {
    let mesh = block(2, 2);
    mids_sit_right(&mesh, "none");
    for format in EXACT.into_iter().chain(["inp"]) {
        mids_sit_right(&through(&mesh, format), format);
    }
    let mut bare = mesh.clone();
    (bare.triangles, bare.triangle_mids, bare.triangle_parts) = (vec![], vec![], vec![]);
    let bytes = written(&bare, "vtu");
    let (again, _) = read_mesh(
        Source::Bytes {
            name: "t.vtu",
            bytes: &bytes,
        },
        None,
        &MeshReadOptions::default(),
    )
    .expect("valid");
    mids_sit_right(&again, "boundary");
    assert_eq!(
        soup(&again).iter().map(|t| t.1).collect::<Vec<_>>(),
        soup(&Mesh {
            triangle_parts: vec![],
            ..mesh
        })
        .iter()
        .map(|t| t.1)
        .collect::<Vec<_>>()
    );
}

/// Order of nodes in Gmsh: the last two mid nodes are exchanged.
#[test]
fn the_order_of_gmsh() {
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        .into_iter()
        .chain([[0.5; 3]; 6])
        .collect();
    let mesh = Mesh {
        points,
        tets: vec![[0, 1, 2, 3]],
        tet_mids: vec![[4, 5, 6, 7, 8, 9]],
        ..Mesh::default()
    };
    for (format, row) in [
        ("msh", "1 1 2 3 4 5 6 7 8 10 9 \n"),
        ("msh2", "1 11 2 0 1 1 2 3 4 5 6 7 8 10 9\n"),
    ] {
        let text = String::from_utf8(written(&mesh, format)).expect("text");
        assert!(text.contains(row), "{text}");
    }
    let text = String::from_utf8(written(&mesh, "inp")).expect("text");
    assert!(
        text.contains("TYPE=C3D10, ELSET=SOLID\n1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10\n"),
        "{text}"
    );
    let text = String::from_utf8(written(&mesh, "bdf")).expect("text");
    assert!(
        text.contains(
            "CTETRA  1       1       1       2       3       4       5       6       \n+       7       8       9       10      \n"
        ),
        "{text}"
    );
}

#[test]
fn what_others_write() {
    let read = |name: &str| {
        let (_, format, text) = FOREIGN.into_iter().find(|f| f.0 == name).expect("listed");
        let by_content = read_as(text.as_bytes(), None).expect(name);
        let (mesh, report) = read_as(text.as_bytes(), Some(format)).expect(name);
        assert_eq!(by_content.0, mesh, "{name}");
        (mesh, report)
    };
    for name in ["meshio-zlib.vtu", "meshio-base64.vtu"] {
        let (mesh, report) = read(name);
        assert_eq!(mesh.points[3], [0.0, 0.0, 1.5], "{name}");
        assert_eq!(
            (mesh.triangles.len(), &mesh.tets[..], report.warnings.len()),
            (4, &[[0, 1, 2, 3]][..], 0)
        );
        assert_eq!(
            (&mesh.triangle_parts[..], mesh.parts.join("|")),
            (&[1, 0, 0, 0][..], "part 3|part 7".into())
        );
    }
    let (mesh, _) = read("appended-base64.vtu");
    assert_eq!(
        (mesh.points[1], mesh.tets.len(), &mesh.corners[..]),
        ([1.0, 0.0, 0.0], 1, &[3][..])
    );
    let (mesh, report) = read("gmsh-parametric.msh");
    assert_eq!(
        mesh.points,
        [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    );
    assert_eq!((mesh.tets[0], &mesh.corners[..]), ([0, 3, 1, 2], &[0][..]));
    assert_eq!(
        (mesh.triangles.len(), &mesh.parts[..], &mesh.regions[0][..]),
        (3, &["skin of it".to_owned(), "no part".into()][..], "body")
    );
    assert_eq!(report.warnings.len(), 1, "$Comments: {:?}", report.warnings);
    let (mesh, report) = read("gmsh-bare.msh");
    assert_eq!(
        (mesh.points.len(), mesh.parts.join("|"), mesh.tets[0]),
        (5, "part 8|part 9".into(), [0, 1, 2, 3])
    );
    assert_eq!(
        report.warnings.len(),
        2,
        "inside out, a hexahedron: {:?}",
        report.warnings
    );
    let (mesh, _) = read("gmsh-legacy.msh");
    assert_eq!(
        (mesh.points[3], &mesh.triangles[..]),
        ([0.0, 6.0, 0.0], &[[0, 1, 2], [0, 2, 3]][..])
    );
    let (mesh, report) = read("abaqus-sets.inp");
    assert_eq!(
        (mesh.tets.len(), &mesh.regions[..], report.units.as_deref()),
        (2, &["Body".to_owned()][..], Some("mm"))
    );
    assert_eq!(
        (mesh.points[2], mesh.triangles.clone(), &mesh.parts[..]),
        (
            [0.0, 1.0, 0.0],
            vec![[0, 2, 1], [1, 3, 2], [2, 3, 4]],
            &["Top".to_owned()][..]
        )
    );
    let (mesh, _) = read("abaqus-shells.inp");
    assert_eq!(
        (&mesh.triangle_parts[..], mesh.parts.join("|")),
        (&[0, 1, 2, 2][..], "A|b|no part".into())
    );
}

#[test]
fn unknown_sections_are_named() {
    let head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    for rest in ["$Points\n1\n1 0 0 0\n$EndPoints\n", "$Points\n1\n1 0 0 0\n"] {
        let e = read_as(format!("{head}{rest}").as_bytes(), Some("msh")).expect_err(rest);
        assert_eq!(e.code(), "format-unsupported", "{e}");
        assert!(e.why.contains("$Points"), "{e}");
    }
    let cut = format!("{head}$Nodes\n1\n1 0 0 0\n");
    let e = read_as(cut.as_bytes(), Some("msh")).expect_err("cut");
    assert_eq!(e.code(), "file-truncated");
}

#[test]
fn refusals_say_where() {
    let refusal = |text: &str, format: &str| {
        let e = read_as(text.as_bytes(), Some(format)).expect_err(text);
        (e.code(), e.place.to_string())
    };
    let head = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
    assert_eq!(
        refusal(
            &format!("{head}$Nodes\n1 1 1 1\n2 1 0 1\n1\n0 zero 0\n"),
            "msh"
        ),
        ("bad-number", "t:8:3".into())
    );
    assert_eq!(
        refusal(
            &format!("{head}$Nodes\n1 18446744073709551615 1 1\n2 1 0 18446744073709551615\n1\n"),
            "msh"
        )
        .0,
        "file-truncated"
    );
    let nodes = "$Nodes\n1 1 1 1\n2 1 0 1\n1\n0 0 0\n$EndNodes\n";
    assert_eq!(
        refusal(
            &format!("{head}{nodes}$Elements\n1 1 1 1\n2 1 2 1\n1 1 1 2\n$EndElements\n"),
            "msh"
        ),
        ("bad-index", "t:12".into())
    );
    assert_eq!(
        refusal(
            &format!("{head}{nodes}$Elements\n1 1 1 1\n2 1 777 1\n1 1 1 2\n"),
            "msh"
        )
        .0,
        "format-unsupported"
    );
    assert_eq!(
        refusal("$MeshFormat\n4 0 8\n$EndMeshFormat\n", "msh").0,
        "format-unsupported"
    );
    assert_eq!(refusal("$Nodes\n0\n$EndNodes\n", "msh").0, "bad-header");
    assert_eq!(
        refusal("*NODE\n1, 0, 0, 0\n2, x, 0, 0\n", "inp"),
        ("bad-number", "t:3".into())
    );
    assert_eq!(
        refusal("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n", "inp"),
        ("bad-index", "t:4".into())
    );
    assert_eq!(
        refusal("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=S3\n1, 1, 2\n", "inp"),
        ("file-corrupt", "t:4".into())
    );
    assert_eq!(
        refusal("<VTKFile type=\"PolyData\">", "vtu").0,
        "format-unsupported"
    );
    assert_eq!(
        refusal(
            "<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkLZ4DataCompressor\">",
            "vtu"
        )
        .0,
        "format-unsupported"
    );
    assert_eq!(
        refusal("<VTKFile type=\"UnstructuredGrid\"><Piece>", "vtu").0,
        "bad-header"
    );
    assert_eq!(refusal("", "glb").0, "format-unsupported");
    assert_eq!(read_as(b"", None).expect_err("empty").code(), "file-empty");
    assert_eq!(
        read_as(b"\x01\x02", None).expect_err("noise").code(),
        "format-unknown"
    );
    assert_eq!(refusal("", "xyz").0, "format-unknown");
}

#[test]
fn writing_says_what_is_lost_and_refuses_nonsense() {
    let mesh = block(1, 2);
    let warnings = |format: &str| {
        let report = write_mesh(&mesh, &mut Vec::new(), format, &MeshWriteOptions::default())
            .expect("written");
        (report.format, report.warnings.len())
    };
    assert_eq!(
        ["msh", "vtu", "inp", "bdf"].map(warnings),
        [("msh", 0), ("vtu", 0), ("inp", 0), ("bdf", 0)]
    );
    assert_eq!(
        ["stl", "stl-ascii", "glb", "obj"].map(warnings),
        [("stl", 3), ("stl", 2), ("glb", 3), ("obj", 2)]
    );
    let code = |mesh: &Mesh, format: &str| {
        write_mesh(mesh, &mut Vec::new(), format, &MeshWriteOptions::default())
            .expect_err("refused")
            .code
    };
    assert_eq!(code(&mesh, "med"), "format-unknown");
    assert_eq!(
        code(
            &Mesh {
                corners: vec![99],
                ..mesh.clone()
            },
            "msh"
        ),
        "bad-mesh"
    );
    let folder = std::env::temp_dir().join(format!("isoform-io-{}-mesh", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let with_ending = || mesh_formats().iter().filter(|f| !f.extensions.is_empty());
    for format in with_ending() {
        let path = folder.join(format!("a.{}", format.extensions[0]));
        write_mesh_path(&mesh, &path, None, &MeshWriteOptions::default()).expect(format.name);
        if format.is_readable() {
            let (again, report) = read_mesh(Source::Path(&path), None, &MeshReadOptions::default())
                .expect(format.name);
            assert_eq!(
                (again.triangles.len(), report.warnings),
                (mesh.triangles.len(), vec![]),
                "{}",
                format.name
            );
        }
    }
    assert_eq!(
        std::fs::read_dir(&folder).expect("a folder").count(),
        with_ending().count(),
        "no litter"
    );
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[test]
fn nothing_at_all_can_be_written() {
    for format in mesh_formats().iter().filter(|f| !f.is_folder()) {
        for ascii in [None, Some(true), Some(false)] {
            let mut bytes = Vec::new();
            write_mesh(
                &Mesh::default(),
                &mut bytes,
                format.name,
                &MeshWriteOptions {
                    ascii,
                    units: Some("mm".into()),
                },
            )
            .expect(format.name);
            if format.is_readable() {
                assert_eq!(
                    read_as(&bytes, Some(format.name)).expect(format.name).0,
                    Mesh::default(),
                    "{}",
                    format.name
                );
            }
        }
    }
}

/// Generates numbers of all magnitudes, and small integers.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        (-9..9_i32).prop_map(f64::from),
        -1e3..1e3
    ]
}

fn nodes<const N: usize>(
    n: usize,
    count: std::ops::Range<usize>,
) -> impl Strategy<Value = Vec<[u32; N]>> {
    prop::collection::vec(prop::array::uniform(0..n as u32), count)
}

fn names(count: usize, what: &'static str) -> impl Strategy<Value = Vec<String>> {
    prop::collection::vec("[a-z<>&'. -]{0,5}", count).prop_map(move |names| {
        names
            .into_iter()
            .enumerate()
            .map(|(i, n)| format!("{what}{n}{i}"))
            .collect()
    })
}

/// Generates valid meshes; tetrahedra may have any volume that is not clearly negative.
fn any_mesh() -> impl Strategy<Value = Mesh> {
    (1..12_usize, 1..4_usize, any::<[bool; 4]>()).prop_flat_map(
        |(n, groups, [second, parts, regions, curves])| {
            let label = move || prop::collection::vec(0..groups as u32, 30);
            (
                (
                    prop::collection::vec(prop::array::uniform3(number()), n),
                    nodes::<3>(n, 1..20),
                    nodes::<4>(n, 1..20),
                    nodes::<2>(n, 1..9),
                ),
                (
                    nodes::<3>(n, 30..31),
                    nodes::<6>(n, 30..31),
                    prop::collection::vec(0..n as u32, 30),
                ),
                (
                    label(),
                    label(),
                    label(),
                    names(groups, "p"),
                    names(groups, "r"),
                    names(groups, "c"),
                ),
                prop::collection::vec(0..n as u32, 0..3),
            )
                .prop_map(move |(cells, mids, labels, corners)| {
                    let (points, triangles, mut tets, edges) = cells;
                    for t in &mut tets {
                        t[3] = t[0]; // flat: neither inside out nor not
                    }
                    let cut = |labels: &[u32], n: usize, has: bool| {
                        if has { labels[..n].to_vec() } else { vec![] }
                    };
                    let curve = |name| Curve {
                        name,
                        parts: [0; 2],
                    };
                    Mesh {
                        triangle_mids: if second {
                            mids.0[..triangles.len()].to_vec()
                        } else {
                            vec![]
                        },
                        triangle_parts: cut(&labels.0, triangles.len(), parts),
                        parts: if parts { labels.3 } else { vec![] },
                        tet_mids: if second {
                            mids.1[..tets.len()].to_vec()
                        } else {
                            vec![]
                        },
                        tet_regions: cut(&labels.1, tets.len(), regions),
                        regions: if regions { labels.4 } else { vec![] },
                        edge_mids: cut(&mids.2, edges.len(), second),
                        edge_curves: cut(&labels.2, edges.len(), curves),
                        curves: if curves {
                            labels.5.into_iter().map(curve).collect()
                        } else {
                            vec![]
                        },
                        points,
                        triangles,
                        tets,
                        edges,
                        corners,
                        ..Mesh::default()
                    }
                })
        },
    )
}

fn survive(name: &str, format: Option<&str>, bytes: &[u8]) {
    /// Time limit per file: far above the time that any of them takes, far below that of a hang.
    const SOON: Duration = Duration::from_secs(5);
    let start = Instant::now();
    match read_mesh(
        Source::Bytes { name, bytes },
        format,
        &MeshReadOptions::default(),
    ) {
        Ok((mesh, _)) => {
            // A mesh that was read must be writable.
            write_mesh(&mesh, &mut Vec::new(), "vtu", &MeshWriteOptions::default()).expect(name);
        }
        Err(e) => assert!(
            !e.why.is_empty() && !e.hint.is_empty() && !e.code().is_empty(),
            "{name}"
        ),
    }
    assert!(start.elapsed() < SOON, "{name} took {:?}", start.elapsed());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn all_comes_back(mesh in any_mesh()) {
        for format in EXACT {
            let mut again = through(&mesh, format);
            again.curves.iter_mut().for_each(|c| c.parts = [0; 2]);
            prop_assert_eq!(&again, &mesh, "{}", format);
        }
    }

    #[test]
    fn all_surfaces_come_back(mesh in any_mesh()) {
        let parts = mesh.parts.iter().map(|p| p.replace(' ', "_").trim().to_owned()).collect();
        let mut mesh = Mesh { points: mesh.points, triangles: mesh.triangles, triangle_parts: mesh.triangle_parts, parts, ..Mesh::default() };
        // Groups are written in turn; groups without triangles are omitted.
        let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
        order.sort_by_key(|&i| mesh.triangle_parts.get(i));
        for format in SURFACES {
            let again = through(&mesh, format);
            prop_assert_eq!(&again.points, &mesh.points, "{}", format);
            let names = |mesh: &Mesh, i: usize| mesh.triangle_parts.get(i).map(|&p| mesh.parts[p as usize].clone());
            for (i, &j) in order.iter().enumerate() {
                let i = if format == "obj" { i } else { j };
                prop_assert_eq!((again.triangles[i], names(&again, i)), (mesh.triangles[j], names(&mesh, j)), "{}", format);
            }
        }
        (mesh.triangle_parts, mesh.parts) = (vec![], vec![]);
        prop_assert_eq!(through(&mesh, "off"), mesh);
    }

    #[test]
    fn abaqus_rounds_little(mesh in any_mesh()) {
        let again = through(&mesh, "inp");
        prop_assert_eq!((&again.tets.len(), again.tet_mids.len()), (&mesh.tets.len(), mesh.tet_mids.len()));
        for (a, b) in again.points.iter().zip(&mesh.points) {
            let near = |a: Point3, b: Point3| (0..3).all(|k| (a[k] - b[k]).abs() <= 1e-11 * b[k].abs());
            prop_assert!(near(*a, *b), "{a:?} {b:?}");
        }
    }

    #[test]
    fn damaged_files(damages in prop::collection::vec(damage(), 1..4)) {
        for (name, format, mut bytes) in mesh_fixtures() {
            damages.iter().for_each(|d| apply(&mut bytes, d));
            survive(&name, Some(format), &bytes);
        }
    }

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..300), text in "[-0-9 .,;enaN#/=<>$*\n\t\"xyz]{0,200}") {
        for format in mesh_formats().iter().filter(|f| f.is_readable()) {
            survive("noise", Some(format.name), &bytes);
            survive("text", Some(format.name), text.as_bytes());
        }
        survive("noise", None, &bytes);
    }
}

#[test]
fn every_prefix_of_every_file() {
    for (name, format, bytes) in mesh_fixtures() {
        let step = 1 + bytes.len() / 500;
        for n in (0..bytes.len()).step_by(step) {
            survive(&name, Some(format), &bytes[..n]);
        }
    }
}

#[test]
fn every_byte_of_binary_files() {
    for (name, format, bytes) in mesh_fixtures()
        .into_iter()
        .filter(|f| ["msh-binary-1", "vtu-1", "meshio-zlib.vtu", "3mf-1"].contains(&f.0.as_str()))
    {
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut changed = bytes.clone();
                changed[at] = value;
                survive(&name, Some(format), &changed);
            }
        }
    }
}

/// Sets of millions of numbers that are referenced many times: they are not expanded, and not
/// traversed more often than there are faces.
#[test]
fn abaqus_sets_are_not_expanded() {
    let mut text = String::from(
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n2,1,2,3,4\n",
    );
    text += "*ELSET,ELSET=A,GENERATE\n1,4294967295,1\n*SURFACE,NAME=S\n";
    text += &"A,S1\n".repeat(100_000);
    survive("sets.inp", Some("inp"), text.as_bytes());
    let e = read_as(text.as_bytes(), Some("inp")).expect_err("too many");
    assert_eq!(e.code(), "file-corrupt");
    // Likewise with ranges of numbers that no element has.
    let mut text = String::from("*NODE\n1,0,0,0\n*ELSET,ELSET=A,GENERATE\n");
    text += &"5,6,1\n".repeat(100_000);
    text += "*SURFACE,NAME=S\n";
    text += &"A,S1\n".repeat(100_000);
    survive("runs.inp", Some("inp"), text.as_bytes());
}

/// A thousand pieces that share one large array.
#[test]
fn vtk_pieces_do_not_multiply() {
    let array = |name: &str| {
        format!("<DataArray type='UInt8' Name='{name}' format='appended' offset='0'/>")
    };
    let piece = format!(
        "<Piece><Points>{}</Points><Cells>{}{}{}</Cells></Piece>",
        array("Points"),
        array("connectivity"),
        array("offsets"),
        array("types")
    );
    let head = "<VTKFile type='UnstructuredGrid' header_type='UInt64'><UnstructuredGrid>";
    let mut bytes =
        format!("{head}{}<AppendedData encoding='raw'>_", piece.repeat(3000)).into_bytes();
    bytes.extend(1_000_000_u64.to_le_bytes());
    bytes.resize(bytes.len() + 1_000_000, 0);
    let e = read_as(&bytes, Some("vtu")).expect_err("too much");
    assert!(e.why.contains("far more"), "{e}");
}

#[test]
fn names_find_formats() {
    assert_eq!(mesh_format_named(".VTU").map(|f| f.name), Some("vtu"));
    assert_eq!(mesh_format_named("nas").map(|f| f.title), Some("Nastran"));
    assert!(mesh_format_named("xyz").is_none());
}

/// Returns a bent square with parameters and another number per node.
fn parameterized() -> Mesh {
    let at = |k: usize| ((k / 3) as f64 / 2.0, (k % 3) as f64 / 2.0);
    let points: Vec<Point3> = (0..9).map(at).map(|(u, v)| [u, v, u * v]).collect();
    let triangles = [0, 1, 3, 4]
        .into_iter()
        .flat_map(|k| [[k, k + 3, k + 4], [k, k + 4, k + 1]])
        .collect();
    let column = |name: &str, value: fn((f64, f64)) -> f64| Column {
        name: name.into(),
        values: (0..9).map(at).map(value).collect(),
    };
    let columns = vec![
        column("u", |p| p.0),
        column("v", |p| p.1),
        column("distance", |p| 0.1 * p.0 - p.1 / 3.0),
    ];
    Mesh {
        columns,
        ..Mesh::from_triangles(points, triangles)
    }
}

#[test]
fn numbers_per_node_go_where_there_is_a_place() {
    let mesh = parameterized();
    for format in ["ply", "ply-ascii"] {
        let bytes = written(&mesh, format);
        let (cloud, _) = read(
            Source::Bytes {
                name: "t.ply",
                bytes: &bytes,
            },
            None,
            &ReadOptions::default(),
        )
        .expect("valid");
        assert_eq!(
            (&cloud.columns, &cloud.points),
            (&mesh.columns, &mesh.points),
            "{format}"
        );
    }
    let obj = String::from_utf8(written(&mesh, "obj")).expect("text");
    assert!(
        obj.contains("\nvt 0.5 1.0\n") && obj.contains("\nf 1/1 4/4 5/5\n"),
        "{obj}"
    );
    assert_eq!(
        through(&mesh, "obj"),
        Mesh {
            columns: vec![],
            ..mesh.clone()
        }
    );
    let left = |format: &str| {
        write_mesh(&mesh, &mut Vec::new(), format, &MeshWriteOptions::default())
            .expect("written")
            .warnings
    };
    let told = |format: &str| {
        left(format)
            .iter()
            .filter(|w| w.contains("no place"))
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!([told("ply"), told("glb")], [vec![], Vec::<String>::new()]);
    assert_eq!(
        told("obj"),
        ["OBJ has no place for the nodes' distance: left out"]
    );
    assert_eq!(
        told("vtu"),
        ["VTK has no place for the nodes' u, v, distance: left out"]
    );
}

#[test]
fn gltf_has_a_texture_along_parameters() {
    let bytes = written(&parameterized(), "glb");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
    assert_eq!((word(8), word(12) % 4), (bytes.len(), 0));
    let scene: serde_json::Value = serde_json::from_slice(&bytes[20..20 + word(12)]).expect("JSON");
    let data = &bytes[28 + word(12)..];
    assert_eq!(scene["buffers"][0]["byteLength"], data.len());
    let attributes = &scene["meshes"][0]["primitives"][0]["attributes"];
    let view = |accessor: &serde_json::Value| {
        let accessor = &scene["accessors"][accessor.as_u64().expect("a number") as usize];
        let view =
            &scene["bufferViews"][accessor["bufferView"].as_u64().expect("a number") as usize];
        let [start, length] =
            ["byteOffset", "byteLength"].map(|k| view[k].as_u64().unwrap_or(0) as usize);
        let floats = data[start..start + length]
            .chunks(4)
            .map(|c| f32::from_le_bytes(c.try_into().expect("four")));
        (
            accessor["type"].as_str().expect("a type").to_owned(),
            floats.collect::<Vec<_>>(),
        )
    };
    let (kind, uv) = view(&attributes["TEXCOORD_0"]);
    assert_eq!(
        (kind.as_str(), uv.len(), &uv[6..10]),
        ("VEC2", 18, &[0.5, 0.0, 0.5, 0.5][..])
    );
    let (kind, distance) = view(&attributes["_DISTANCE"]);
    assert_eq!((kind.as_str(), distance[1]), ("SCALAR", -1.0_f32 / 6.0));
    let image = &scene["bufferViews"]
        [scene["images"][0]["bufferView"].as_u64().expect("a number") as usize];
    let [start, length] =
        ["byteOffset", "byteLength"].map(|k| image[k].as_u64().expect("a number") as usize);
    assert!(
        data[start..].starts_with(b"\x89PNG")
            && data[..start + length].ends_with(b"IEND\xae\x42\x60\x82")
    );
    assert!(start + length <= data.len() && data.len() - start - length < 4);
}
