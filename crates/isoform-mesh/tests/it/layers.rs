//! Layers of wedges along parts of the surface.

use crate::common::solid;
use isoform_check::{Certificate, Options as CheckOptions, certify};
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm, sub};
use isoform_mesh::{Control, Layers, MeshError, Meshed, Options, WarningKind};

fn options(size: f64, part: &str, first: f64, growth: f64, count: usize) -> Options {
    let parts = part.split(',').map(String::from).collect();
    Options {
        size,
        layers: Some(Layers {
            parts,
            first,
            growth,
            count,
        }),
        ..Options::default()
    }
}

fn certified(made: &Meshed, solid: &dyn Solid, options: &Options) -> Certificate {
    let curves: Vec<Vec<Point3>> = made
        .features
        .curves
        .iter()
        .map(|c| c.points.clone())
        .collect();
    let corners = made.features.corners.iter().filter(|c| c.needs_node());
    let corners: Vec<Point3> = corners.map(|c| c.point).collect();
    let wanted = CheckOptions {
        region: options.region,
        size: Some(options.size),
        curves: &curves,
        corners: &corners,
        ..CheckOptions::default()
    };
    certify(&made.mesh, Some(solid), &wanted, &Control::default())
}

/// Meshes a solid with layers, whose certificate must hold.
fn meshed(solid: &dyn Solid, options: &Options) -> (Meshed, Certificate) {
    let made = isoform_mesh::mesh(solid, options, &Control::default()).expect("a mesh");
    assert_eq!(made.warnings, []);
    let certificate = certified(&made, solid, options);
    let failures = certificate.failures();
    assert!(failures.is_empty(), "{failures:?}");
    (made, certificate)
}

fn refused(solid: &dyn Solid, options: &Options) -> MeshError {
    isoform_mesh::mesh(solid, options, &Control::default()).expect_err("no mesh")
}

/// Volume of a wedge whose base and top are parallel enough: three tetrahedra.
fn volume(made: &Meshed) -> f64 {
    let simplices = made.mesh.simplices();
    let six = |tet: &[u32; 4]| {
        let [a, b, c, d] = tet.map(|v| simplices.points[v as usize]);
        dot(sub(b, a), cross(sub(c, a), sub(d, a)))
    };
    simplices.tets.iter().map(six).sum::<f64>() / 6.0
}

const BALL: &str = "ball(x[3], a[1]) { array c[3]; c = [0, 0, 0]; ball = hfSphere(x, c, 1); }";
const BLOCK: &str = "b(x[3], a[1]) { array c[3]; c = [0, 0, 0]; b = hfBlock(x, c, 1, 2, 3); }";

/// On a ball layers are spheres: the nodes of each one are at its depth below the surface.
#[test]
fn a_ball_has_layers_of_the_thickness_asked_for() {
    let options = options(0.25, "*", 0.02, 1.5, 4);
    let (made, certificate) = meshed(&solid(BALL), &options);
    let layers = options.layers.expect("layers");
    assert_eq!(made.mesh.wedges.len(), 4 * made.mesh.triangles.len());
    assert!(made.mesh.quads.is_empty());
    let heights = layers.heights();
    for (k, wedge) in made.mesh.wedges.iter().enumerate() {
        let depth = |v: u32| 1.0 - norm(made.mesh.points[v as usize]);
        let layer = k % 4;
        for i in 0..3 {
            assert!((depth(wedge[i]) - heights[layer]).abs() < 1e-9);
            assert!((depth(wedge[i + 3]) - heights[layer + 1]).abs() < 1e-9);
        }
    }
    let wedges = certificate.wedges.expect("wedges");
    assert!(wedges.scaled_jacobian_min > 0.5, "{wedges:?}");
    // A surface of chords, as coarse as a quarter of the radius.
    let whole = 4.0 / 3.0 * std::f64::consts::PI;
    assert!(
        (volume(&made) / whole - 1.0).abs() < 0.04,
        "{}",
        volume(&made)
    );
}

/// All sides of a block: the columns at edges and corners lean, and the volume is the block's.
#[test]
fn a_block_has_layers_on_all_sides() {
    let (made, _) = meshed(&solid(BLOCK), &options(0.25, "*", 0.01, 1.3, 5));
    assert!((volume(&made) - 6.0).abs() < 1e-9, "{}", volume(&made));
    assert_eq!(made.mesh.corners.len(), 8);
}

/// One side alone: its layers stand on the four adjacent sides and extend along their edges.
#[test]
fn one_side_of_a_block_has_layers() {
    let model = solid(BLOCK);
    let names = model.names().to_vec();
    for side in &names {
        let (made, _) = meshed(&model, &options(0.3, side, 0.02, 1.2, 3));
        assert!((volume(&made) - 6.0).abs() < 1e-9);
        assert_eq!(made.mesh.corners.len(), 8);
        assert!(made.mesh.wedges.len() >= 30 && made.mesh.quads.len() >= 12);
        let on = |part: &u32| made.mesh.parts[*part as usize] == *side;
        assert!(!made.mesh.quad_parts.iter().any(on));
    }
}

/// A pipe cut by a box: layers on its wall, quadrilaterals on its ends.
#[test]
fn a_pipe_has_layers_on_its_wall() {
    let pipe = solid("p(x[3], a[1]) { array c[3]; c = [0, 0, 0]; p = hfCylX(x, c, 1); }");
    let region = Aabb {
        lo: [0.0, -2.0, -2.0],
        hi: [3.0, 2.0, 2.0],
    };
    let options = Options {
        region: Some(region),
        ..options(0.25, "*Cyl*,p*", 0.01, 1.4, 5)
    };
    let wall = pipe.names()[0].clone();
    let options = Options {
        layers: options.layers.map(|layers| Layers {
            parts: vec![wall],
            ..layers
        }),
        ..options
    };
    let (made, _) = meshed(&pipe, &options);
    let mesh = &made.mesh;
    for (quad, part) in mesh.quads.iter().zip(&mesh.quad_parts) {
        let end = match mesh.parts[*part as usize].as_str() {
            "cap.x_min" => 0.0,
            "cap.x_max" => 3.0,
            other => panic!("{other}"),
        };
        assert!(quad.iter().all(|&v| mesh.points[v as usize][0] == end));
    }
    let rim = mesh.quads.len() / 5;
    assert!(rim >= 40, "{rim}");
}

/// A step: an edge with a solid angle of 270 degrees.
#[test]
fn layers_go_around_a_step() {
    let step = solid(
        "step(x[3], a[1]) { array c[3]; c = [0, 0, 0]; b = hfBlock(x, c, 2, 2, 1);
         c = [1, 1, -1]; d = hfBlock(x, c, 2, 2, 3); step = b \\ d; }",
    );
    let (made, _) = meshed(&step, &options(0.2, "*", 0.01, 1.3, 4));
    assert!((volume(&made) - 3.0).abs() < 1e-9);
}

/// A hub on a disc, with triangles far smaller than the layers are thick: over the edge between
/// them the core is wider than the solid.
#[test]
fn layers_lean_towards_edges_that_the_solid_turns_around() {
    let hub = solid(
        "hub(x[3], a[1]) { array c[3]; array d[3]; c = [0, 0, 0]; d = [-1.5, -1.5, -0.5];
         hub = hfBlock(x, d, 3, 3, 0.5) | (hfCylZ(x, c, 0.6) & (x[3] + 0.3) & (0.8 - x[3])); }",
    );
    for (size, first) in [(0.1, 0.02), (0.07, 0.03)] {
        let (made, certificate) = meshed(&hub, &options(size, "*", first, 1.2, 4));
        assert!(made.mesh.wedges.len() > 4000);
        assert!(certificate.wedges.expect("wedges").scaled_jacobian_min > 0.05);
    }
}

/// Layers on only one face of a step would have no side to end on.
#[test]
fn layers_that_end_nowhere_are_refused() {
    let step = solid(
        "step(x[3], a[1]) { array c[3]; c = [0, 0, 0]; b = hfBlock(x, c, 2, 2, 1);
         c = [1, 1, -1]; d = hfBlock(x, c, 2, 2, 3); step = b \\ d; }",
    );
    let mut refusals = 0;
    for name in step.names().to_vec() {
        match isoform_mesh::mesh(
            &step,
            &options(0.2, &name, 0.02, 1.2, 3),
            &Control::default(),
        ) {
            Ok(made) => {
                let found = certified(&made, &step, &options(0.2, &name, 0.02, 1.2, 3));
                assert!(found.is_ok(), "{name}: {:?}", found.failures());
            }
            Err(MeshError::LayersEnd { .. }) => refusals += 1,
            // A face that is nowhere on the surface.
            Err(error) => assert!(matches!(error, MeshError::NoPart { .. }), "{name}: {error}"),
        }
    }
    assert_eq!(refusals, 2);
}

/// The core of an ellipsoid is only close to a parallel surface: layers that leave a quarter of its
/// least radius of curvature (0.08) have the requested thickness to a tenth, without a warning.
/// Layers as thick as the solid are refused or fail the certificate.
#[test]
fn layers_of_an_ellipsoid_are_as_thick_as_asked_for_or_refused() {
    let model = solid("e(x[3], a[1]) { e = 1 - x[1]^2/4 - x[2]^2 - x[3]^2/0.16; }");
    meshed(&model, &options(0.1, "*", 0.03, 1.0, 2));
    let error = refused(&solid(BALL), &options(0.1, "*", 0.51, 1.0, 2));
    assert!(matches!(error, MeshError::NoRoom { .. }), "{error}");
    let thick = options(0.1, "*", 0.21, 1.0, 2);
    if let Ok(made) = isoform_mesh::mesh(&model, &thick, &Control::default()) {
        assert!(!certified(&made, &model, &thick).is_ok());
    }
}

/// A ball smaller than the layers has no core: a warning names the layers as the reason.
#[test]
fn a_body_smaller_than_its_layers_is_told() {
    let two = solid(
        "two(x[3], a[1]) { array c[3]; c = [0, 0, 0]; t = hfSphere(x, c, 1);
         c = [3, 0, 0]; two = t | hfSphere(x, c, 0.1); }",
    );
    let options = options(0.2, "*", 0.06, 1.0, 2);
    let made = isoform_mesh::mesh(&two, &options, &Control::default()).expect("a mesh");
    let kinds: Vec<&WarningKind> = made.warnings.iter().map(|w| &w.kind).collect();
    assert_eq!(kinds, [&WarningKind::MissedByLayers]);
}

/// Layers from both sides of a gap that is too narrow for them have no room there; the error does
/// not name the end of the gap, which meets both at right angles.
#[test]
fn a_gap_too_narrow_for_layers_is_told() {
    let gap = solid(
        "gap(x[3], a[1]) { outer = 1 - x[1]^2 - x[2]^2; inner = (x[1] - 0.2)^2 + x[2]^2 - 0.49;
         gap = outer & inner & x[3] & (1 - x[3]); }",
    );
    for parts in ["outer,inner", "inner"] {
        let error = refused(&gap, &options(0.1, parts, 0.04, 1.0, 3));
        assert!(
            matches!(error, MeshError::NoRoom { .. }),
            "{parts}: {error}"
        );
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let ball = solid(BALL);
    let error = refused(&ball, &options(0.3, "wall", 0.02, 1.2, 3));
    assert!(error.to_string().contains("called wall"), "{error}");
    // Thinner than the rounding of coordinates, and thicker than all of the ball.
    let error = refused(&ball, &options(0.3, "*", 1e-300, 1.2, 3));
    assert!(error.to_string().ends_with("not 1e-300"), "{error}");
    let error = refused(&ball, &options(0.3, "*", 1e300, 1.2, 3));
    assert!(matches!(error, MeshError::NoRoom { at: None, .. }));
    let error = refused(&ball, &options(0.3, "*", 0.5, 1.2, 3));
    assert!(matches!(error, MeshError::NoRoom { .. }), "{error}");
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(&ball, &options(0.3, "*", wrong, 1.2, 3));
        assert!(matches!(error, MeshError::Option { .. }), "{error}");
        let error = refused(&ball, &options(0.3, "*", 0.1, wrong, 3));
        assert!(matches!(error, MeshError::Option { .. }), "{error}");
    }
    let error = refused(&ball, &options(0.3, "*", 0.1, 1.2, 0));
    assert!(matches!(error, MeshError::Option { .. }), "{error}");
    let second = Options {
        order: 2,
        ..options(0.3, "*", 0.02, 1.2, 3)
    };
    assert!(matches!(
        refused(&ball, &second),
        MeshError::NoLayers { .. }
    ));
}
