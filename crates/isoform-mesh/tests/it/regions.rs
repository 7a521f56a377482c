//! Regions of a solid: conforming, in place, with exact volumes, and certified.

use isoform_check::{Options as CheckOptions, certify};
use isoform_field::Pieces;
use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Mesh, Point3, Solid, TET_FACES, cross, dot, sub};
use isoform_mesh::{Control, MeshError, Meshed, Options, Region, RegionSolid, WarningKind};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Returns objects of a program as solids: the model, and those with the given names.
fn solids(program: &str, names: &[&str]) -> Vec<Pieces> {
    let model = Model::parse(program, Mode::Default).expect("a program");
    let all = std::iter::once(None).chain(names.iter().copied().map(Some));
    let object = |name| {
        let object = model
            .clone()
            .object(name)
            .expect("an object of the program");
        Pieces::of_model(&object, &vec![0.0; object.n_params()]).expect("a solid")
    };
    all.map(object).collect()
}

/// Meshes the model of a program in regions, which are other objects of it.
fn meshed(program: &str, names: &[&str], options: &Options) -> Meshed {
    let solids = solids(program, names);
    let regions = regions(&solids, names);
    let made = isoform_mesh::mesh_regions(&solids[0], &regions, options, &Control::default());
    let made = made.expect("a mesh");
    check_conforming(&made.mesh);
    made
}

fn regions<'a>(solids: &'a [Pieces], names: &[&'a str]) -> Vec<Region<'a>> {
    let pairs = names.iter().zip(&solids[1..]);
    pairs.map(|(name, solid)| Region { name, solid }).collect()
}

fn sized(size: f64) -> Options {
    Options {
        size,
        ..Options::default()
    }
}

/// Every tetrahedron is positive, every face lies in one or two, and the triangles are exactly
/// those faces that are on the outside or between two regions, outward of the first.
fn check_conforming(mesh: &Mesh) {
    let key = |mut f: [u32; 3]| {
        f.sort_unstable();
        f
    };
    let corner = |v: u32| mesh.points[v as usize];
    let six = |f: [u32; 3], p: Point3| {
        let [a, b, c] = f.map(corner);
        dot(sub(b, a), cross(sub(c, a), sub(p, a)))
    };
    let mut faces: BTreeMap<[u32; 3], Vec<(u32, [u32; 3])>> = BTreeMap::new();
    for (tet, &region) in mesh.tets.iter().zip(&mesh.tet_regions) {
        assert!(six([tet[0], tet[1], tet[2]], corner(tet[3])) > 0.0);
        for face in TET_FACES.map(|f| f.map(|k| tet[k])) {
            faces.entry(key(face)).or_default().push((region, face));
        }
    }
    let mut wanted: BTreeMap<[u32; 3], [u32; 3]> = BTreeMap::new();
    for (face, sides) in &mut faces {
        sides.sort_unstable();
        match sides.as_slice() {
            [only] => {
                wanted.insert(*face, only.1);
            }
            [first, second] if first.0 != second.0 => {
                wanted.insert(*face, first.1);
            }
            [_, _] => {}
            more => panic!("a face of {} tetrahedra", more.len()),
        }
    }
    assert_eq!(mesh.triangles.len(), wanted.len());
    let turned = |f: [u32; 3]| [f, [f[1], f[2], f[0]], [f[2], f[0], f[1]]];
    for triangle in &mesh.triangles {
        assert!(turned(wanted[&key(*triangle)]).contains(triangle));
    }
}

/// The volumes of the regions, by name.
fn volumes(mesh: &Mesh) -> BTreeMap<&str, f64> {
    let mut volumes = BTreeMap::new();
    for (tet, &region) in mesh.tets.iter().zip(&mesh.tet_regions) {
        let [a, b, c, d] = tet.map(|v| mesh.points[v as usize]);
        let volume = dot(sub(b, a), cross(sub(c, a), sub(d, a))) / 6.0;
        *volumes
            .entry(mesh.regions[region as usize].as_str())
            .or_insert(0.0) += volume;
    }
    volumes
}

/// Returns the failures in the certificates of all regions.
fn failures(program: &str, names: &[&str], made: &Meshed) -> Vec<String> {
    let solids = solids(program, names);
    let regions = regions(&solids, names);
    let mut found = Vec::new();
    for k in 0..=names.len() {
        let name = names.get(k).copied().unwrap_or(isoform_mesh::REST);
        let Some(number) = made.mesh.regions.iter().position(|other| other == name) else {
            continue;
        };
        let solid = RegionSolid::new(&solids[0], &regions, k);
        let features = &made.region_features[k];
        let curves: Vec<Vec<Point3>> = features.curves.iter().map(|c| c.points.clone()).collect();
        let corners = features.corners.iter().filter(|c| c.needs_node());
        let options = CheckOptions {
            curves: &curves,
            corners: &corners.map(|c| c.point).collect::<Vec<_>>(),
            ..CheckOptions::default()
        };
        let part = made.mesh.region(number as u32);
        let certificate = certify(&part, Some(&solid), &options, &Control::default());
        let failures = certificate.failures();
        found.extend(failures.iter().map(|failure| format!("{name}: {failure}")));
    }
    found
}

const BLOCK: &str = "my_model(x[3], a[1]) {
    my_model = (x[1] + 1) & (1 - x[1]) & (x[2] + 1) & (1 - x[2]) & (x[3] + 1) & (1 - x[3]); }";

#[test]
fn planes_part_a_block_exactly() {
    // Of the block the first takes x > 0.1, the second of the rest y > 0.2 x: a wall ends at a
    // wall.
    let program = format!(
        "east(x[3], a[1]) {{ east = x[1] - 0.1; }}
         north(x[3], a[1]) {{ north = x[2] - 0.2*x[1]; }} {BLOCK}"
    );
    let names = ["east", "north"];
    let made = meshed(&program, &names, &sized(0.2));
    assert!(made.warnings.is_empty());
    let volumes = volumes(&made.mesh);
    let east = 0.9 * 4.0;
    // ∫ (1 − 0.2 x) dx over −1 < x < 0.1, times the height.
    let north = 2.0 * (1.1 - 0.1 * (0.01 - 1.0));
    for (name, wanted) in [
        ("east", east),
        ("north", north),
        ("rest", 8.0 - east - north),
    ] {
        assert!(
            (volumes[name] - wanted).abs() < 1e-12,
            "{name}: {}",
            volumes[name]
        );
    }
    assert_eq!(failures(&program, &names, &made), [""; 0]);
}

#[test]
fn balls_take_what_is_left() {
    let program = format!(
        "one(x[3], a[1]) {{ one = 0.25 - (x[1] - 0.3)^2 - x[2]^2 - x[3]^2; }}
         two(x[3], a[1]) {{ two = 0.25 - (x[1] + 0.3)^2 - x[2]^2 - x[3]^2; }} {BLOCK}"
    );
    let ball = 4.0 / 3.0 * PI * 0.125;
    // Two caps of height r − d for balls whose centres are 2 d apart.
    let h = 0.5 - 0.3;
    let lens = 2.0 * PI * h * h * (1.5 - h) / 3.0;
    for names in [["one", "two"], ["two", "one"]] {
        let made = meshed(&program, &names, &sized(0.1));
        let volumes = volumes(&made.mesh);
        for (name, wanted) in [(names[0], ball), (names[1], ball - lens)] {
            // Chords of 0.1 on a radius of 0.5 lose about 1 − (h/r)²/8 · 2.
            assert!(
                (volumes[name] / wanted - 1.0).abs() < 0.02,
                "{name}: {}",
                volumes[name]
            );
        }
        let sum: f64 = volumes.values().sum();
        assert!((sum - 8.0).abs() < 1e-11, "{sum}");
        assert_eq!(failures(&program, &names, &made), [""; 0]);
    }
}

/// The surfaces of the regions are those of the whole, too: written once more.
#[test]
fn coincident_surfaces() {
    let program = "
        core(x[3], a[1]) { core = (0.36 - x[1]^2 - x[2]^2) & (x[3] + 1) & (1.5 - x[3]); }
        shell(x[3], a[1]) { shell = (1 - x[1]^2 - x[2]^2) & (x[3] + 1) & (1 - x[3]); }
        my_model(x[3], a[1]) { my_model = core(x, a) | shell(x, a); }";
    let names = ["core", "shell"];
    let made = meshed(program, &names, &sized(0.15));
    assert_eq!(made.mesh.regions, names);
    let volumes = volumes(&made.mesh);
    for (name, wanted) in [("core", 0.9 * PI), ("shell", 1.28 * PI)] {
        assert!(
            (volumes[name] / wanted - 1.0).abs() < 0.02,
            "{name}: {}",
            volumes[name]
        );
    }
    assert_eq!(failures(program, &names, &made), [""; 0]);
}

#[test]
fn thin_plies_around_a_hole() {
    let program = "
        one(x[3], a[1]) { one = 0.05 - x[3]; }
        two(x[3], a[1]) { two = 0.1 - x[3]; }
        my_model(x[3], a[1]) { my_model = x[1] & (1 - x[1]) & x[2] & (0.6 - x[2]) & x[3]
            & (0.15 - x[3]) & ((x[1] - 0.5)^2 + (x[2] - 0.3)^2 - 0.01); }";
    let names = ["one", "two"];
    let made = meshed(program, &names, &sized(0.05));
    let ply = 0.05 * (0.6 - PI * 0.01);
    for (name, volume) in volumes(&made.mesh) {
        assert!((volume / ply - 1.0).abs() < 2e-3, "{name}: {volume}");
    }
    assert_eq!(failures(program, &names, &made), [""; 0]);
}

/// A wall of parts that continue each other smoothly, with curved elements on it.
#[test]
fn a_capsule_of_second_order() {
    let program = format!(
        "pill(x[3], a[1]) {{ pill = (0.16 - x[1]^2 - x[2]^2 - (x[3] - 0.3)^2)
             | (0.16 - x[1]^2 - x[2]^2 - (x[3] + 0.3)^2)
             | ((0.16 - x[1]^2 - x[2]^2) & (x[3] + 0.3) & (0.3 - x[3])); }} {BLOCK}"
    );
    let options = Options {
        order: 2,
        ..sized(0.12)
    };
    let made = meshed(&program, &["pill"], &options);
    assert!(made.warnings.is_empty(), "{:?}", made.warnings);
    let mesh = &made.mesh;
    let walls = mesh.walls();
    let mut mids = 0;
    for (k, nodes) in mesh
        .triangle_mids
        .iter()
        .enumerate()
        .filter(|(k, _)| walls[*k])
    {
        for v in nodes.iter().chain(&mesh.triangles[k]) {
            let [x, y, z] = mesh.points[*v as usize];
            let off = x.hypot(y).hypot((z.abs() - 0.3).max(0.0)) - 0.4;
            assert!(off.abs() < 1e-11, "{off} at {x}, {y}, {z}");
            mids += 1;
        }
    }
    assert!(mids > 1000);
    assert_eq!(failures(&program, &["pill"], &made), [""; 0]);
}

#[test]
fn regions_of_nothing_and_of_all() {
    let program = format!(
        "far(x[3], a[1]) {{ far = x[1] - 5; }} all(x[3], a[1]) {{ all = x[1] + 5; }} {BLOCK}"
    );
    let made = meshed(&program, &["far", "all"], &sized(0.5));
    assert_eq!(made.mesh.regions, ["all"]);
    let kinds: Vec<&WarningKind> = made.warnings.iter().map(|w| &w.kind).collect();
    assert_eq!(kinds, [&WarningKind::EmptyRegion("far".to_owned())]);
    assert!(made.mesh.walls().iter().all(|wall| !wall));
    // Without regions there is one, called solid.
    assert_eq!(meshed(BLOCK, &[], &sized(0.5)).mesh.regions, ["solid"]);
}

/// A region of two balls, one of them far smaller than the size and missed by the lattice, or too
/// small to be meshed at all: a warning reports it.
#[test]
fn what_a_region_misses_is_made_or_said() {
    for (radius, is_made) in [(0.02, true), (0.002, false)] {
        let program = format!(
            "p(x[3], a[1]) {{ p = (0.09 - x[1]^2 - x[2]^2 - x[3]^2)
                 | ({radius}^2 - (x[1] - 0.14)^2 - (x[2] + 0.69)^2 - (x[3] + 0.114)^2); }} {BLOCK}"
        );
        let made = meshed(&program, &["p"], &sized(0.1));
        let is_near = |p: &Point3| (p[0] - 0.14).hypot(p[1] + 0.69).hypot(p[2] + 0.114) < 0.05;
        let found = made
            .mesh
            .region(0)
            .points
            .iter()
            .filter(|p| is_near(p))
            .count();
        let is_said = made.warnings.iter().any(|w| w.kind == WarningKind::Missed);
        assert_eq!(
            (found > 3, is_said),
            (is_made, !is_made),
            "{radius}: {found} nodes"
        );
    }
}

#[test]
fn the_surface_alone_has_no_regions() {
    let program = format!("east(x[3], a[1]) {{ east = x[1]; }} {BLOCK}");
    let solids = solids(&program, &["east"]);
    let options = Options {
        surface_only: true,
        ..sized(0.5)
    };
    let regions = regions(&solids, &["east"]);
    let made = isoform_mesh::mesh_regions(&solids[0], &regions, &options, &Control::default());
    assert!(matches!(
        made,
        Err(MeshError::Option {
            name: "regions",
            ..
        })
    ));
}

/// The function of a region agrees with its definition everywhere.
#[test]
fn the_solid_of_a_region() {
    let program = format!(
        "one(x[3], a[1]) {{ one = x[1] - 0.1; }} two(x[3], a[1]) {{ two = x[2] | x[3]; }} {BLOCK}"
    );
    let names = ["one", "two"];
    let solids = solids(&program, &names);
    let regions = regions(&solids, &names);
    let of = |k| RegionSolid::new(&solids[0], &regions, k);
    let all = [of(0), of(1), of(2)];
    for p in [
        [0.5, 0.5, 0.5],
        [0.0, 0.5, -0.5],
        [0.0, -0.5, -0.5],
        [2.0, 0.0, 0.0],
    ] {
        let [x, y, z]: Point3 = p;
        let inside = x.abs() < 1.0;
        let wanted = [
            inside && x > 0.1,
            inside && x < 0.1 && (y > 0.0 || z > 0.0),
            inside && x < 0.1 && y < 0.0 && z < 0.0,
        ];
        for (solid, wanted) in all.iter().zip(wanted) {
            let mut sign = [0.0];
            solid.sign_values(&[p], &mut sign);
            let by_tree = solid.tree().value(&|i| solid.gradient(i, p).0);
            let mut by_values = vec![0.0; solid.names().len()];
            let every: Vec<u32> = (0..solid.names().len() as u32).collect();
            solid.values(&every, &[p], &mut by_values);
            let by_values = solid.tree().value(&|i| by_values[i as usize]);
            assert_eq!((sign[0] > 0.0, by_tree > 0.0), (wanted, wanted), "{p:?}");
            assert_eq!(by_values, by_tree, "{p:?}");
        }
    }
}

/// Random blocks, half spaces and balls in a block, with arbitrary contacts.
#[test]
fn regions_at_random_are_certified() {
    let mut state = 7u64;
    let mut uniform = move |lo: f64, hi: f64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        lo + (hi - lo) * (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for case in 0..isoform_testdata::cases(12, 4) {
        let mut shape = |kind: usize| {
            let [x, y, z] = [(); 3].map(|()| uniform(-0.7, 0.7));
            let r = uniform(0.3, 0.6);
            match kind % 3 {
                0 => format!(
                    "{} - (x[1]-({x}))^2 - (x[2]-({y}))^2 - (x[3]-({z}))^2",
                    r * r
                ),
                1 => format!("x[1]*({x}) + x[2]*({y}) + x[3]*({z}) + {}", 0.2 * r),
                _ => format!(
                    "(x[1]-({x})+{r}) & ({r}-x[1]+({x})) & (x[2]-({y})+{r}) & ({r}-x[2]+({y}))"
                ),
            }
        };
        let (one, two) = (shape(case), shape(case / 3));
        let program = format!(
            "one(x[3], a[1]) {{ one = {one}; }} two(x[3], a[1]) {{ two = {two}; }} {BLOCK}"
        );
        let names = ["one", "two"];
        let made = meshed(&program, &names, &sized(0.15));
        assert_eq!(
            failures(&program, &names, &made),
            [""; 0],
            "case {case}: {program}"
        );
        let sum: f64 = volumes(&made.mesh).values().sum();
        assert!((sum - 8.0).abs() < 1e-11, "{sum}");
    }
}

#[test]
fn one_mesh_for_any_number_of_threads() {
    let program = format!(
        "one(x[3], a[1]) {{ one = 0.25 - x[1]^2 - x[2]^2 - x[3]^2; }}
         two(x[3], a[1]) {{ two = x[1] - x[2]; }} {BLOCK}"
    );
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| meshed(&program, &["one", "two"], &sized(0.2)).mesh)
    };
    assert_eq!(by(1), by(3));
}
