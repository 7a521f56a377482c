//! Winding: neighbours run opposite ways along their edge, and closed surfaces are turned outward.

use crate::common::SPHERE;
use isoform_algebra::{Poly, RBig};
use isoform_control::Control;
use isoform_geom::{Point3, RationalPatch, cross, dot, sub};
use isoform_tess::{
    Claim, CutCurve, Map, Mode, Patch, Surface, SurfaceBox, TriangulateOptions, triangulate_once,
    triangulate_patches,
};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// A surface to 0.004 of its box.
fn drawn(texts: [&str; 4], half_width: i64, mode: Mode) -> Surface {
    let map = Map::parse(texts, Default::default()).expect("a map");
    let mut options = TriangulateOptions::around(RBig::from(half_width));
    options.mode = mode;
    options.mesh.tolerance = 4e-3 * half_width as f64;
    triangulate_once(&map, &options, &Control::default())
        .expect("not stopped")
        .0
}

/// Returns the volume of a surface without a border.
fn volume(s: &Surface) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|v| s.points[v as usize]);
    let one = |[p, q, r]: [Point3; 3]| dot(p, cross(q, r)) / 6.0;
    s.triangles.iter().map(|t| one(corners(t))).sum()
}

/// Returns the edges whose two triangles traverse them in one direction, and the number of edges
/// with more triangles that traverse them in unbalanced directions.
fn wrong(s: &Surface) -> (BTreeSet<[u32; 2]>, usize) {
    let mut ways: BTreeMap<[u32; 2], [usize; 2]> = BTreeMap::new();
    for t in &s.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            ways.entry([a.min(b), a.max(b)]).or_default()[usize::from(a < b)] += 1;
        }
    }
    let same = ways.iter().filter(|(_, n)| **n == [2, 0] || **n == [0, 2]);
    let same = same.map(|e| *e.0).collect();
    let more = ways.values().filter(|[a, b]| a + b > 2 && a != b).count();
    (same, more)
}

/// Parameters in all quadrants, and infinite ones; in projective coordinates of another kind; with
/// space mirrored: the volume is positive.
#[test]
fn closed_surfaces_are_turned_outward() {
    // (s : t : w) = (s + t : 2 t − w : s + w) in the map of the sphere, z turned.
    let moved = [
        "2*(s + t)*(s + 1)",
        "2*(2*t - 1)*(s + 1)",
        "(s + 1)^2 - (s + t)^2 - (2*t - 1)^2",
        "(s + t)^2 + (2*t - 1)^2 + (s + 1)^2",
    ];
    let torus = [
        "-s^2*t^2 - 3*s^2 + t^2 + 3",
        "2*s*t^2 + 6*s",
        "2*s^2*t + 2*t",
        "s^2*t^2 + s^2 + t^2 + 1",
    ];
    // By longitude and latitude that go all around, one of two parameters drawn.
    let twice = [
        "(1 - s^2)*(1 - t^2)",
        "2*s*(1 - t^2)",
        "2*t*(1 + s^2)",
        "(1 + s^2)*(1 + t^2)",
    ];
    for (texts, half_width, expected) in [
        (SPHERE, 2, 4.0 * PI / 3.0),
        (moved, 2, 4.0 * PI / 3.0),
        (twice, 2, 4.0 * PI / 3.0),
        (torus, 4, 4.0 * PI * PI),
    ] {
        for mode in [Mode::Glued, Mode::Normalised] {
            let s = drawn(texts, half_width, mode);
            assert!(s.holds(Claim::Winding), "{texts:?}: {:?}", s.findings);
            assert_eq!(wrong(&s), (BTreeSet::new(), 0), "{texts:?}");
            let found = volume(&s);
            assert!((found / expected - 1.0).abs() < 0.03, "{found}: {texts:?}");
            let w = &s.winding;
            assert_eq!((w.pieces, w.outward, w.is_orientable()), (1, 1, true));
        }
    }
}

/// The normals of a graph over the plane are ∂φ/∂s × ∂φ/∂t = (…, …, 1), in all four quadrants.
#[test]
fn saddles_are_turned_as_their_parameters() {
    for texts in [["s", "t", "s*t", "1"], ["s", "t", "s^3 - 3*s*t^2", "1"]] {
        let s = drawn(texts, 2, Mode::Glued);
        assert_eq!(s.winding.outward, 0);
        for t in &s.triangles {
            let [p, q, r] = t.map(|v| s.points[v as usize]);
            assert!(cross(sub(q, p), sub(r, p))[2] > 0.0);
        }
    }
}

/// Sheets that cross are wound each for itself: Enneper's surface, and Whitney's umbrella.
#[test]
fn sheets_that_cross_are_wound_by_themselves() {
    let enneper = [
        "3*s + 3*s*t^2 - s^3",
        "3*t + 3*s^2*t - t^3",
        "3*s^2 - 3*t^2",
        "3",
    ];
    for texts in [enneper, ["s*t", "s", "t^2", "1"]] {
        let s = drawn(texts, 4, Mode::Glued);
        assert!(s.is_certified(), "{:?}", s.findings);
        assert!(s.winding.is_orientable() && s.winding.pieces == 1);
        assert_eq!(wrong(&s), (BTreeSet::new(), 0), "{texts:?}");
    }
}

/// Surfaces with a Möbius band have a cut, and only along it neighbours traverse an edge in one
/// direction.
#[test]
fn surfaces_that_are_not_orientable_have_a_cut() {
    let roman = ["2*s*t", "2*t", "2*s", "s^2 + t^2 + 1"];
    let cross_cap = ["2*s*t", "2*s", "s^2 - 1", "s^2 + t^2 + 1"];
    // A Möbius band by its half angle, of two parameters for each point.
    let band = [
        "(2*(1 + s^2) + t*(1 - s^2))*((1 - s^2)^2 - 4*s^2)",
        "(2*(1 + s^2) + t*(1 - s^2))*4*s*(1 - s^2)",
        "2*s*t*(1 + s^2)^2",
        "(1 + s^2)^3",
    ];
    for (texts, half_width, along) in [
        (roman, 2, CutCurve::Infinite),
        (cross_cap, 2, CutCurve::Infinite),
        (band, 3, CutCurve::FundamentalDomain),
    ] {
        let s = drawn(texts, half_width, Mode::Normalised);
        assert!(s.holds(Claim::Winding), "{:?}", s.findings);
        assert_eq!(s.winding.unorientable, 1, "{texts:?}");
        let cut: BTreeSet<[u32; 2]> = s.winding.cut.iter().map(|e| e.vertices).collect();
        assert_eq!(wrong(&s), (cut, 0), "{texts:?}");
        assert!(s.winding.cut.iter().all(|e| e.along == along), "{texts:?}");
    }
    let s = drawn(roman, 2, Mode::Glued);
    assert!(s.is_certified() && s.winding.unorientable == 1);
}

/// A bilinear patch with corners at s, t = 0 and 1.
fn square([a, b, c, d]: [Point3; 4]) -> Patch {
    let control = [a, b, c, d].map(|[x, y, z]| [x, y, z, 1.0]).to_vec();
    Patch::from(&RationalPatch::new((1, 1), control).expect("a patch"))
}
fn of_patches(patches: &[Patch]) -> Surface {
    let around = SurfaceBox::of_patches(patches).expect("no pole");
    let options = TriangulateOptions::of_patches(&around);
    triangulate_patches(patches, &options, &Control::default())
        .expect("patches")
        .0
}

/// The faces of the cube [0, 1]³, their parameters in either order: its volume is 1.
#[test]
fn patches_are_wound_together() {
    for turned in [0, 0b01_0110, 0b11_1111] {
        let face = |k: usize| {
            let (axis, height) = (k / 2, (k % 2) as f64);
            let corner = |x: f64, y: f64| {
                let mut p = [height; 3];
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (x, y);
                p
            };
            let [a, b] = [corner(0.0, 1.0), corner(1.0, 0.0)];
            let [first, second] = if turned >> k & 1 == 0 { [a, b] } else { [b, a] };
            square([corner(0.0, 0.0), first, second, corner(1.0, 1.0)])
        };
        let s = of_patches(&(0..6).map(face).collect::<Vec<_>>());
        assert!(s.is_certified(), "{:?}", s.findings);
        assert_eq!((s.winding.pieces, s.winding.outward), (1, 1));
        assert_eq!(wrong(&s), (BTreeSet::new(), 0));
        assert!((volume(&s) - 1.0).abs() < 1e-12, "{}", volume(&s));
    }
}

/// Three patches around a band with one half turn.
#[test]
fn patches_may_make_a_band() {
    let at = |k: usize, width: f64| {
        let (turn, half) = (k as f64 / 5.0 * 2.0 * PI, k as f64 / 5.0 * PI);
        // The last pair of points is the first one, exchanged.
        let (turn, half) = if k == 5 { (0.0, 0.0) } else { (turn, half) };
        let width = if k == 5 { -width } else { width };
        let radius = 2.0 + width * half.cos();
        [radius * turn.cos(), radius * turn.sin(), width * half.sin()]
    };
    let patch = |k: usize| square([at(k, -0.5), at(k, 0.5), at(k + 1, -0.5), at(k + 1, 0.5)]);
    let s = of_patches(&(0..5).map(patch).collect::<Vec<_>>());
    assert!(s.is_certified(), "{:?}", s.findings);
    assert_eq!(s.winding.unorientable, 1);
    let cut: BTreeSet<[u32; 2]> = s.winding.cut.iter().map(|e| e.vertices).collect();
    assert_eq!(wrong(&s), (cut, 0));
    assert!(s.winding.cut.iter().all(|e| e.along == CutCurve::Sides));
}

/// A patch without area between two others is left out, and they are joined; what has only such
/// patches is refused.
#[test]
fn patches_without_area_are_left_out() {
    let at = |x: f64, y: f64| [x, y, 0.0];
    let span = |x: f64, y: f64| square([at(x, 0.0), at(x, 1.0), at(y, 0.0), at(y, 1.0)]);
    let s = of_patches(&[span(0.0, 1.0), span(1.0, 1.0), span(1.0, 2.0)]);
    assert!(s.is_certified(), "{:?}", s.findings);
    assert_eq!(s.collapsed, [1]);
    assert_eq!(
        BTreeSet::from_iter(s.patches.iter().copied()),
        BTreeSet::from([0, 2])
    );
    assert_eq!(
        (s.winding.pieces, crate::common::topology(&s)),
        (1, [1, 1, 1])
    );
    let point = square([at(1.0, 1.0); 4]);
    let around = SurfaceBox::of_patches(&[span(0.0, 1.0)]).expect("no pole");
    let options = TriangulateOptions::of_patches(&around);
    let found = triangulate_patches(&[span(1.0, 1.0), point], &options, &Control::default());
    assert!(found.is_err());
}

/// The real image of (s², t, s⁴ + t²) is the half of a paraboloid where x ≥ 0: it ends in the
/// parabola z = y² over the box. Maps that fold nothing have no border.
#[test]
fn the_border_of_the_real_image_is_listed() {
    let s = drawn(["s^2", "t", "s^4 + t^2", "1"], 2, Mode::Glued);
    let border = &s.real_border;
    assert_eq!(border.folds, [Poly::var(0)]);
    assert_eq!((border.lines.len(), border.beyond.len()), (1, 1));
    let line = &border.lines[0];
    assert!(
        line.iter()
            .all(|p| p[0] == 0.0 && (p[2] - p[1] * p[1]).abs() < 1e-12)
    );
    let ends = [line[0], line[line.len() - 1]].map(|p| p[1].abs());
    assert!(
        ends.iter().all(|y| (y - 2f64.sqrt()).abs() < 1e-9),
        "{ends:?}"
    );

    // Two lines at right angles, and three other quadrants.
    let s = drawn(["s^2", "t^2", "0", "1"], 2, Mode::Glued);
    let lengths = s.real_border.lines.iter().flat_map(|l| l.windows(2));
    let length: f64 = lengths.map(|w| isoform_geom::norm(sub(w[0], w[1]))).sum();
    assert!((length - 4.0).abs() < 1e-9, "{length}");
    assert_eq!(
        (s.real_border.folds.len(), s.real_border.beyond.len()),
        (2, 3)
    );

    let half_turns = [
        "(1 - s^2)*(1 - t^2)",
        "2*s*(1 - t^2)",
        "2*t*(1 + s^2)",
        "(1 + s^2)*(1 + t^2)",
    ];
    // From (s, t) to (−1/s, t): the curve of points that stay, s² + w² = 0, has no real arc.
    let inverses = ["s^2 - 1", "s*t", "0", "s"];
    for texts in [SPHERE, half_turns, inverses] {
        assert!(drawn(texts, 2, Mode::Glued).real_border.is_empty());
    }
    // Half of a cone, up to its apex: the other half has imaginary parameters.
    let s = drawn(["s^2", "s*t", "t^2", "1"], 2, Mode::Glued);
    assert_eq!(
        (s.real_border.lines.len(), s.real_border.beyond.len()),
        (0, 1)
    );
}
