//! Maps with several parameters for each point: every point is drawn once.

use crate::common::{area, edges, topology};
use isoform_algebra::RBig;
use isoform_control::Control;
use isoform_tess::{Budget, Map, MeshOptions, Mode, Surface, TriangulateOptions, triangulate_once};
use std::f64::consts::PI;

fn surface(texts: [&str; 4], half_width: i64) -> Surface {
    let found = drawn(texts, half_width);
    assert!(found.findings.is_empty(), "{texts:?}: {:?}", found.findings);
    found
}
fn drawn(texts: [&str; 4], half_width: i64) -> Surface {
    let map = Map::parse(texts, Default::default()).expect("a map");
    let options = TriangulateOptions {
        half_width: RBig::from(half_width),
        domain: None,
        mode: Mode::Normalised,
        mesh: MeshOptions {
            tolerance: 2e-3 * half_width as f64,
            longest: 0.5 * half_width as f64,
            triangles: 400_000,
        },
        budget: Budget::default(),
    };
    triangulate_once(&map, &options, &Control::default())
        .expect("not stopped")
        .0
}

/// The area is what it should be, but for a share.
fn assert_area(s: &Surface, expected: f64, share: f64) {
    let found = area(s);
    assert!(
        (found - expected).abs() < share * expected,
        "{found}, not {expected}"
    );
}

/// The Euler characteristic, and the number of edges with one triangle.
fn euler_and_open(s: &Surface) -> (i64, usize) {
    let open = edges(s).values().filter(|n| **n == 1).count();
    (topology(s)[0], open)
}

/// Planes, of which quadratic maps reach a part only: its area is known.
#[test]
fn planes_end_in_folds() {
    for (texts, half_width, expected, sheets) in [
        (["s^2", "t^2", "0", "1"], 2, 4.0, 1),
        (["s^2", "t", "0", "1"], 2, 8.0, 1),
        // x = s + t and y = s t: x^2 > 4 y.
        (["s + t", "s*t", "0", "1"], 1, 2.0 + 1.0 / 6.0, 1),
        // From (s, t) to (-1/s, t): all of it.
        (["s^2 - 1", "s*t", "0", "s"], 1, 4.0, 1),
        // The half turn about the origin: nothing is folded. Two more parameters are complex.
        (["s^2 - t^2", "2*s*t", "0", "1"], 1, 4.0, 2),
    ] {
        let s = surface(texts, half_width);
        assert_eq!(s.sheets, sheets, "{texts:?}");
        assert_area(&s, expected, 3e-3);
        assert_eq!(euler_and_open(&s).0, 1, "{texts:?}");
    }
}

/// Spheres, tori and bands as people type them first.
#[test]
fn closed_surfaces_are_closed() {
    let sphere = [
        "s^2*t^2 - s^2 - t^2 + 1",
        "-2*s*t^2 + 2*s",
        "2*s^2*t + 2*t",
        "s^2*t^2 + s^2 + t^2 + 1",
    ];
    // The torus with radii 2 and 1, its first angle by (s^2 - 1)/(2 s).
    let torus = [
        "-(s^4 - 6*s^2 + 1)*(t^2 + 3)",
        "4*s*(s^2 - 1)*(t^2 + 3)",
        "2*t*(s^2 + 1)^2",
        "(s^2 + 1)^2*(t^2 + 1)",
    ];
    for (texts, half_width, expected, euler) in
        [(sphere, 2, 4.0 * PI, 2), (torus, 4, 8.0 * PI * PI, 0)]
    {
        let s = surface(texts, half_width);
        assert_eq!(euler_and_open(&s), (euler, 0), "{texts:?}");
        assert_area(&s, expected, 0.02);
    }
}

/// Half of a sphere, and of a torus: the fold of the second one is a base point's curve, too.
#[test]
fn surfaces_end_in_folds() {
    let sphere = ["2*s^2", "2*t", "s^4 + t^2 - 1", "s^4 + t^2 + 1"];
    let torus = [
        "(1 - s^4)*(t^2 + 3)",
        "2*s^2*(t^2 + 3)",
        "2*t*(s^4 + 1)",
        "(s^4 + 1)*(t^2 + 1)",
    ];
    for (texts, half_width, expected, euler) in
        [(sphere, 2, 2.0 * PI, 1), (torus, 4, 4.0 * PI * PI, 0)]
    {
        let s = surface(texts, half_width);
        let (found, open) = euler_and_open(&s);
        assert_eq!(found, euler, "{texts:?}");
        assert!(open > 10, "{texts:?}: it ends");
        assert_area(&s, expected, 0.02);
    }
}

/// A Möbius band by its half angle: one border, which goes around twice.
#[test]
fn bands_are_twisted() {
    // (2 + t cos a) (cos 2 a, sin 2 a), t sin a with s = tan a/2, near to the circle.
    let s = surface(
        [
            "(2*(1 + s^2) + t*(1 - s^2))*((1 - s^2)^2 - 4*s^2)",
            "(2*(1 + s^2) + t*(1 - s^2))*4*s*(1 - s^2)",
            "2*s*t*(1 + s^2)^2",
            "(1 + s^2)^3",
        ],
        3,
    );
    assert_eq!(euler_and_open(&s).0, 0);
}

/// The Roman surface from a sphere: antipodal points have one image, and (0, 0, 0) is that of three
/// pairs of them, of which a contracted line is one. They are three points of the projective plane.
#[test]
fn sheets_that_meet_in_a_contracted_point_stay_apart() {
    let s = surface(
        [
            "8*s*t",
            "4*s^2*t + 4*t^3 - 4*t",
            "4*s^3 + 4*s*t^2 - 4*s",
            "(s^2 + t^2 + 1)^2",
        ],
        2,
    );
    assert_eq!((euler_and_open(&s), s.sheets), ((1, 0), 1));
}

/// In other parameters, several contracted curves have the image (0, 0, 0), which becomes one
/// vertex: the result is not a projective plane, and a finding says so.
#[test]
fn what_may_be_of_another_sheet_is_said() {
    let s = drawn(
        [
            "-s^3*t^2 - s^3 + s*t^4 + 2*s*t^2 + s",
            "-s^3*t^3 - s^3*t + s*t^5 + 2*s*t^3 + s*t",
            "s^4*t - 2*s^2*t^3 - 2*s^2*t + t^5 + 2*t^3 + t",
            "s^4*t^2 + s^4 - s^2*t^4 - 2*s^2*t^2 - s^2 + t^6 + 3*t^4 + 3*t^2 + 1",
        ],
        1,
    );
    assert!(euler_and_open(&s) == (1, 0) || !s.findings.is_empty());
}

/// Real base points on the fold w = 0, which a quotient of linear forms does not serve.
#[test]
fn half_turns_are_found() {
    let s = surface(["s^2 - t^2", "s*t", "s^4 - t^4", "1"], 2);
    assert_eq!((euler_and_open(&s).0, s.sheets), (1, 1));
}

/// Of (s, t) and (s, -t) one is drawn, of three parameters of s^3 all, which is said.
#[test]
fn what_is_drawn_is_said() {
    assert_eq!(surface(["s^3", "t^2", "s^3*t^2", "1"], 1).sheets, 3);
}
