//! Surfaces whose parameters are moved by a projectivity: no triangles cross there that did not before.

use isoform::rational_surface;
use isoform_algebra::RBig;
use isoform_tess::{Budget, Map, MeshOptions, Mode, TriangulateOptions};

/// Forms in A, B and C for s, t and w, in other parameters, joined: everything is proved.
fn is_certified(forms: [&str; 4], half_width: i32) {
    let moved = |t: &str| {
        t.replace('A', "(-4*s - 9*t - 9)")
            .replace('B', "(9*s + 12*t - 9)")
            .replace('C', "(-12*s + 4*t - 8)")
    };
    let texts = forms.map(moved);
    let map = Map::parse(texts.each_ref().map(String::as_str), Default::default()).expect("a map");
    let size = f64::from(half_width);
    let options = TriangulateOptions {
        half_width: RBig::from(half_width),
        domain: None,
        mode: Mode::Glued,
        mesh: MeshOptions {
            tolerance: 5e-4 * size,
            longest: 0.25 * size,
            triangles: 400_000,
        },
        budget: Budget::default(),
    };
    let (surface, _) = rational_surface(&map, &options, &|| false).expect("not stopped");
    assert!(surface.unproven.is_empty(), "{:?}", surface.unproven);
}

/// A Bohemian dome, on which a line is contracted to a point of a seam: strips beside the seam are narrower there than its chords bulge, unless
/// these are short.
#[test]
fn narrow_strips_at_a_seam() {
    is_certified(
        [
            "(C^2 - A^2)*(C^2 + B^2)",
            "2*A*C*(C^2 + B^2) + (C^2 + A^2)*(C^2 - B^2)",
            "2*B*C*(C^2 + A^2)",
            "(C^2 + A^2)*(C^2 + B^2)",
        ],
        3,
    );
}

/// X, Y and Z vanish to second order along a line: that it is straight is not seen in derivatives, and vertices crowded on it.
#[test]
fn vertices_on_a_line_contracted_to_second_order() {
    is_certified(
        ["A*C^3", "B*C^3", "A^2*C^2 + C^4", "(A^2 + B^2 - C^2)^2"],
        3,
    );
}
