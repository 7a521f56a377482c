//! Surfaces whose parameters are moved by a projectivity: no triangles cross there that did not before.

use isoform::rational_surface;
use isoform_algebra::RBig;
use isoform_tess::{Budget, Map, MeshOptions, Mode, TriangulateOptions};

/// A Bohemian dome, on which a line is contracted to a point of a seam: strips beside the seam are narrower there than its chords bulge, unless
/// these are short.
#[test]
fn narrow_strips_at_a_seam() {
    let dome = ["(C^2 - A^2)*(C^2 + B^2)", "2*A*C*(C^2 + B^2) + (C^2 + A^2)*(C^2 - B^2)", "2*B*C*(C^2 + A^2)", "(C^2 + A^2)*(C^2 + B^2)"];
    let texts = dome.map(|t| t.replace('A', "(-4*s - 9*t - 9)").replace('B', "(9*s + 12*t - 9)").replace('C', "(-12*s + 4*t - 8)"));
    let map = Map::parse(texts.each_ref().map(String::as_str), Default::default()).expect("a map");
    let options = TriangulateOptions {
        half_width: RBig::from(3),
        domain: None,
        mode: Mode::Glued,
        mesh: MeshOptions { tolerance: 1.5e-3, longest: 0.75, triangles: 400_000 },
        budget: Budget::default(),
    };
    let (surface, _) = rational_surface(&map, &options, &|| false).expect("not stopped");
    assert!(surface.unproven.is_empty(), "{:?}", surface.unproven);
}
