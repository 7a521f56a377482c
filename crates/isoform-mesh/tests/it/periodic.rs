//! Unit cells: opposite sides match, and everything else holds as for any mesh.

use crate::common::solid;
use isoform_check::{Options as CheckOptions, certify};
use isoform_field::Pieces;
use isoform_geom::{Aabb, Mesh, Point3, Solid, cross, dot, sub};
use isoform_mesh::{Control, MeshError, Meshed, Options, Region, Warning, WarningKind};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::fmt::Write;

const UNIT: Aabb = Aabb {
    lo: [0.0; 3],
    hi: [1.0; 3],
};

/// A union of balls with their images one period away in each direction.
fn balls(balls: &[(Point3, f64)], region: Aabb) -> Pieces {
    let mut text = String::from("m(x[3], a[1]) { array c[3]; ");
    let mut join = "t =";
    for (center, radius) in balls {
        for image in 0..27 {
            let shift = [image % 3 - 1, image / 3 % 3 - 1, image / 9 - 1];
            let at: Point3 = std::array::from_fn(|i| {
                center[i] + f64::from(shift[i]) * (region.hi[i] - region.lo[i])
            });
            write!(text, "c = {at:?}; {join} hfSphere(x, c, {radius:?}); ").expect("a string");
            join = "t = t |";
        }
    }
    solid(&(text + "m = t; }"))
}

fn cell(region: Aabb, size: f64) -> Options {
    Options {
        size,
        region: Some(region),
        periodic: [true; 3],
        ..Options::default()
    }
}

/// Meshes a unit cell; the certificate must hold and the sides must match.
fn meshed(solid: &dyn Solid, options: &Options) -> Meshed {
    let made = isoform_mesh::mesh(solid, options, &Control::default()).expect("a mesh");
    check(&made, solid, options);
    made
}

fn check(made: &Meshed, solid: &dyn Solid, options: &Options) {
    assert_eq!(made.warnings, []);
    let region = options.region.expect("a box");
    let wanted = CheckOptions {
        region: options.region,
        periodic: options.periodic,
        size: Some(options.size),
        ..CheckOptions::default()
    };
    let found = certify(&made.mesh, Some(solid), &wanted, &Control::default()).failures();
    assert!(found.is_empty(), "{found:?}");
    assert!(
        made.mesh
            .opposite
            .iter()
            .any(|sides| !sides.nodes.is_empty())
    );
    for axis in (0..3).filter(|&axis| options.periodic[axis]) {
        let [lower, upper] = [region.lo, region.hi].map(|end| side(&made.mesh, axis, end[axis]));
        assert_eq!(lower, upper, "axis {axis}");
    }
}

/// The triangles on a side, by the other two coordinates of all their nodes, bit for bit.
fn side(mesh: &Mesh, axis: usize, at: f64) -> BTreeSet<Vec<[u64; 2]>> {
    let key = |v: u32| {
        let p = mesh.points[v as usize];
        [1, 2].map(|k| p[(axis + k) % 3].to_bits())
    };
    let is_on = |k: &usize| {
        mesh.triangles[*k]
            .iter()
            .all(|&v| mesh.points[v as usize][axis] == at)
    };
    let all = (0..mesh.triangles.len()).filter(is_on);
    let nodes = all.map(|k| {
        let mids = mesh.triangle_mids.get(k).into_iter().flatten();
        let mut keys: Vec<[u64; 2]> = mesh.triangles[k]
            .iter()
            .chain(mids)
            .map(|v| key(*v))
            .collect();
        keys.sort_unstable();
        keys
    });
    nodes.collect()
}

fn volume(mesh: &Mesh, is_counted: impl Fn(usize) -> bool) -> f64 {
    let six = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(|v| mesh.points[v as usize]);
        dot(sub(b, a), cross(sub(c, a), sub(d, a)))
    };
    let counted = mesh.tets.iter().enumerate().filter(|(k, _)| is_counted(*k));
    counted.map(|(_, tet)| six(tet) / 6.0).sum()
}

const GYROID: &str = "m(x[3], a[1]) { k = 6.283185307179586;
    g = sin(k*x[1])*cos(k*x[2]) + sin(k*x[2])*cos(k*x[3]) + sin(k*x[3])*cos(k*x[1]); m = g; }";

/// The gyroid halves its cell: it is taken to its complement by x → −x. Its node at the origin is
/// a corner of the box at once.
#[test]
fn the_gyroid_halves_its_cell() {
    let made = meshed(&solid(GYROID), &cell(UNIT, 0.1));
    let v = volume(&made.mesh, |_| true);
    assert!((v - 0.5).abs() < 2e-3, "{v}");
    assert_eq!(made.caps.len(), 6);
}

#[test]
fn mid_nodes_are_one_too() {
    let options = Options {
        order: 2,
        ..cell(UNIT, 0.12)
    };
    let made = meshed(&solid(GYROID), &options);
    let pairs = made.mesh.opposite.iter().map(|sides| sides.nodes.len());
    let mids = made.mesh.triangle_mids.len();
    assert!(mids > 0 && pairs.sum::<usize>() > 3 * 200);
}

/// A ball around a corner of the box consists of eight functions, each valid at one corner only.
#[test]
fn a_ball_that_goes_over_all_sides() {
    for (at, radius) in [([0.0; 3], 0.31), ([0.02, 0.97, 0.4], 0.37)] {
        let made = meshed(&balls(&[(at, radius)], UNIT), &cell(UNIT, 0.07));
        let (v, wanted) = (
            volume(&made.mesh, |_| true),
            4.0 / 3.0 * PI * radius.powi(3),
        );
        assert!(v < wanted && v > 0.97 * wanted, "{v} of {wanted}");
    }
}

/// A surface inclined to a side: faces whose corners all lie on the side belong to the piece on
/// their own side of it.
#[test]
fn surfaces_that_lean_over_a_side() {
    let region = Aabb {
        lo: [-1.5; 3],
        hi: [1.5; 3],
    };
    for (z, radius) in [
        (0.9191510239220713, 0.6625286630789711),
        (1.1, 0.41),
        (-1.11, 0.5),
    ] {
        let at = [0.617655778476677, -1.5037707578100208, z];
        meshed(&balls(&[(at, radius)], region), &cell(region, 0.13));
    }
}

/// Boxes with edges in no simple ratio, far from the origin, of any unit; coarser than an eighth of
/// the box eight cells remain.
#[test]
fn boxes_of_any_shape_place_and_unit() {
    for (scale, lo, edges, size) in [
        (1.0, [0.3, -2.0, 7.0], [1.0, 1.37, 0.81], 0.1),
        (1e-3, [0.0; 3], [1.0, 2.0, 1.0], 0.12),
        (3.0, [300.0, 0.0, -150.0], [1.0, 1.0, 1.0], 0.7),
    ] {
        let lo = lo.map(|v| scale * v);
        let region = Aabb {
            lo,
            hi: std::array::from_fn(|i| lo[i] + scale * edges[i]),
        };
        let place = |share: Point3| std::array::from_fn(|i| lo[i] + scale * edges[i] * share[i]);
        let both = [
            (place([0.1, 0.9, 0.5]), 0.31 * scale),
            (place([0.5, 0.4, 0.95]), 0.27 * scale),
        ];
        meshed(&balls(&both, region), &cell(region, scale * size));
    }
}

/// Along one axis, with the solid ending within the box along the others, or cut off there.
#[test]
fn along_one_axis_alone() {
    for (half, caps) in [(0.8, 2), (0.3, 6)] {
        let region = Aabb {
            lo: [-half, -half, 0.0],
            hi: [half, half, 1.0],
        };
        let wavy = solid(
            "m(x[3], a[1]) { m = 0.4 + 0.1*cos(6.283185307179586*x[3]) - sqrt(x[1]^2 + x[2]^2); }",
        );
        let options = Options {
            periodic: [false, false, true],
            ..cell(region, 0.08)
        };
        let made = meshed(&wavy, &options);
        assert_eq!((made.caps.len(), made.mesh.opposite.len()), (caps, 1));
    }
}

/// A matrix that fills the box, with balls across its sides: the volumes add up to the box.
#[test]
fn regions_go_over_the_sides() {
    let matrix =
        solid("m(x[3], a[1]) { array c[3]; c = [-1, -1, -1]; m = hfBlock(x, c, 3, 3, 3); }");
    let core = balls(&[([0.0; 3], 0.3), ([0.55, 0.5, 0.9], 0.21)], UNIT);
    let region = [Region {
        name: "core",
        solid: &core,
    }];
    let options = cell(UNIT, 0.08);
    let made = isoform_mesh::mesh_regions(&matrix, &region, &options, &Control::default());
    let made = made.expect("a mesh");
    check(&made, &matrix, &options);
    let of = |k: u32| volume(&made.mesh, |t| made.mesh.tet_regions[t] == k);
    let (core, rest) = (of(0), of(1));
    assert!((core + rest - 1.0).abs() < 1e-12);
    let wanted = 4.0 / 3.0 * PI * (0.3f64.powi(3) + 0.21f64.powi(3));
    assert!(core < wanted && core > 0.97 * wanted, "{core} of {wanted}");
    // Walls meet the sides in curves that the two sides share.
    let lower = side(&made.mesh, 0, 0.0);
    assert_eq!(lower, side(&made.mesh, 0, 1.0));
}

#[test]
fn the_threads_do_not_matter() {
    let model = balls(&[([0.1, 0.5, 0.93], 0.3), ([0.8, 0.1, 0.5], 0.25)], UNIT);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads")
            .install(|| meshed(&model, &cell(UNIT, 0.1)).mesh)
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn what_does_not_repeat_is_refused() {
    let error = |solid: &dyn Solid, regions: &[Region<'_>], options: &Options| {
        let made = isoform_mesh::mesh_regions(solid, regions, options, &Control::default());
        made.expect_err("no mesh")
    };
    let short = Aabb {
        lo: [0.0; 3],
        hi: [1.0, 1.0, 0.7],
    };
    let found = error(&solid(GYROID), &[], &cell(short, 0.1));
    assert!(
        matches!(found, MeshError::NotPeriodic { axis: 'z', .. }),
        "{found}"
    );
    // A ball without its image on the other side.
    let alone = "m(x[3], a[1]) { array c[3]; c = [0.5, 0, 0.5]; m = hfSphere(x, c, 0.3); }";
    let found = error(&solid(alone), &[], &cell(UNIT, 0.1));
    assert!(
        matches!(found, MeshError::NotPeriodic { axis: 'y', .. }),
        "{found}"
    );
    let matrix =
        solid("m(x[3], a[1]) { array c[3]; c = [-1, -1, -1]; m = hfBlock(x, c, 3, 3, 3); }");
    let region = [Region {
        name: "core",
        solid: &solid(alone),
    }];
    let found = error(&matrix, &region, &cell(UNIT, 0.1));
    assert!(found.to_string().contains("region core"), "{found}");
    // A plate whose faces lie in the sides: here it goes on, but nothing of the function says so.
    let plate = "m(x[3], a[1]) { m = (x[1] & (0.5 - x[1])) | ((x[1] - 1) & (1.5 - x[1])); }";
    let found = error(&solid(plate), &[], &cell(UNIT, 0.1));
    assert!(
        matches!(found, MeshError::InSide { axis: 'x', .. }),
        "{found}"
    );
    let boxless = Options {
        region: None,
        ..cell(UNIT, 0.1)
    };
    assert_eq!(error(&solid(GYROID), &[], &boxless), MeshError::NoBox);
}

/// Surfaces that miss each other across a side by less than the signs show: no certificate, and a
/// warning with their distance. The ball's circle in the side is shifted by 1e-4.
#[test]
fn surfaces_that_miss_each_other_at_a_side_have_no_certificate() {
    let off = "m(x[3], a[1]) { array c[3]; c = [0, 0.5, 0.5]; t = hfSphere(x, c, 0.3);
        c = [1, 0.5, 0.5001]; m = t | hfSphere(x, c, 0.3); }";
    let model = solid(off);
    let options = Options {
        periodic: [true, false, false],
        ..cell(UNIT, 0.1)
    };
    let made = isoform_mesh::mesh(&model, &options, &Control::default()).expect("a mesh");
    let is_told = |warning: &Warning| match warning.kind {
        WarningKind::SidesApart { axis, by } => axis == 'x' && (0.9e-4..1.1e-4).contains(&by),
        _ => false,
    };
    assert!(made.warnings.iter().any(is_told), "{:?}", made.warnings);
    let wanted = CheckOptions {
        region: Some(UNIT),
        periodic: options.periodic,
        ..CheckOptions::default()
    };
    assert!(!certify(&made.mesh, Some(&model), &wanted, &Control::default()).is_ok());
}

/// Curves in which balls meet end in the sides, where each ball is one function below and another
/// one above. Cutting of this cell once did not terminate.
#[test]
fn curves_of_balls_go_over_the_sides() {
    let region = Aabb {
        lo: [-0.35, 4.9, 0.0],
        hi: [0.65, 5.9, 0.7],
    };
    let one = [-0.28549520753486346, 5.893917765356397, 0.5354448077146079];
    let other = [-0.20610165979197193, 5.682984323569068, 0.6707482860036442];
    let solid = balls(
        &[(one, 0.18564082697709552), (other, 0.21752820908718334)],
        region,
    );
    meshed(&solid, &cell(region, 0.04));
}
