//! Surfaces over a part of the parameter plane: closed forms, topology, and what is said where
//! something is left open.

use crate::common::{SPHERE, area, topology};
use isoform_algebra::{Poly, RBig};
use isoform_control::Control;
use isoform_tess::{
    Budget, Domain, Finding, Map, MeshOptions, Mode, Surface, TriangulateOptions, VertexKind,
    triangulate_once,
};
use std::collections::BTreeMap;

fn rational(text: &str) -> RBig {
    Poly::parse(text, &[])
        .expect("a number")
        .as_constant()
        .expect("a number")
}
fn polygon(text: &str) -> Domain {
    let corner = |c: &str| {
        let mut x = c.split(',').map(rational);
        [x.next().expect("s"), x.next().expect("t")]
    };
    Domain::polygon(text.split(' ').map(corner).collect()).expect("a polygon")
}
fn rectangle(s: [&str; 2], t: [&str; 2]) -> Domain {
    Domain::rectangle(s.map(rational), t.map(rational)).expect("a rectangle")
}

fn over(
    texts: [&str; 4],
    half_width: &str,
    domain: &Domain,
    tolerance: f64,
    mode: Mode,
) -> Surface {
    let map = Map::parse(texts, Default::default()).expect("a map");
    let half_width = rational(half_width);
    let longest = 0.5 * half_width.to_f64().value();
    let mesh = MeshOptions {
        tolerance,
        longest,
        triangles: 400_000,
    };
    let options = TriangulateOptions {
        half_width,
        domain: Some(domain.clone()),
        mode,
        mesh,
        budget: Budget::default(),
    };
    triangulate_once(&map, &options, &Control::default())
        .expect("not stopped")
        .0
}
fn certified(texts: [&str; 4], half_width: &str, domain: &Domain, tolerance: f64) -> Surface {
    let s = over(texts, half_width, domain, tolerance, Mode::Glued);
    assert!(s.is_certified(), "{texts:?}: {:?}", s.findings);
    s
}

const PLANE: [&str; 4] = ["s", "t", "0", "1"];

/// ∫∫ 4/(1 + s² + t²)² ds dt.
fn area_of_sphere([s0, s1]: [f64; 2], [t0, t1]: [f64; 2]) -> f64 {
    // Gauss with many points: composite midpoint rule, extrapolated.
    let rule = |n: usize| {
        let (h, k) = ((s1 - s0) / n as f64, (t1 - t0) / n as f64);
        let at = |i: usize, j: usize| {
            let (s, t) = (s0 + (i as f64 + 0.5) * h, t0 + (j as f64 + 0.5) * k);
            4.0 * h * k / (1.0 + s * s + t * t).powi(2)
        };
        (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| at(i, j))
            .sum::<f64>()
    };
    (4.0 * rule(400) - rule(200)) / 3.0
}

#[test]
fn the_area_of_a_piece_of_a_sphere_converges() {
    // Over three quadrants, over one along their sides, over none.
    for (s, t) in [
        (["-1/2", "1"], ["-1/3", "3/4"]),
        (["0", "1"], ["0", "1"]),
        (["1/4", "2"], ["-3", "-1/3"]),
    ] {
        let domain = rectangle(s, t);
        let exact = area_of_sphere(
            s.map(|x| rational(x).to_f64().value()),
            t.map(|x| rational(x).to_f64().value()),
        );
        let errors = [1e-2, 2.5e-3].map(|tolerance| {
            let m = certified(SPHERE, "2", &domain, tolerance);
            assert_eq!(topology(&m), [1, 1, 1], "{s:?} {t:?}");
            assert!(
                m.points
                    .iter()
                    .all(|p| (p.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14)
            );
            (area(&m) - exact).abs() / exact
        });
        // The tolerance is of second order in the size of triangles, and so is the area.
        assert!(
            errors[1] < 0.4 * errors[0] && errors[0] < 2e-2,
            "{errors:?}"
        );
    }
}

/// Over polygons, a plane is exact, and so are a lifted polygon's area and the paraboloid's
/// integral of it.
#[test]
fn polygons_have_their_area() {
    for (text, exact) in [
        (
            "0,0 2,0 3,1 1,3 -1,1",
            0.5 * f64::from(2 + 8 + 4 - 1 + 1 - 2 + 2 - 2),
        ),
        // Clockwise, not convex, across the axes.
        ("-1,-1 -1,1 0,0 1,1 1,-1", 3.0),
        ("0,0 4,0 4,1 1,1 1,4 0,4", 7.0),
        ("1/3,1/7 2/3,1/7 1/2,1/2", (1.0 / 3.0) * (5.0 / 14.0) / 2.0),
    ] {
        let domain = polygon(text);
        let corners = domain
            .corners()
            .iter()
            .map(|c| c.each_ref().map(|x| x.to_f64().value()))
            .collect::<Vec<_>>();
        let n = corners.len();
        let shoelace = (0..n)
            .map(|k| {
                corners[k][0] * corners[(k + 1) % n][1] - corners[k][1] * corners[(k + 1) % n][0]
            })
            .sum::<f64>()
            / 2.0;
        let flat = certified(PLANE, "5", &domain, 1e-2);
        assert_eq!(topology(&flat), [1, 1, 1], "{text}");
        assert!(
            (area(&flat) - shoelace).abs() < 1e-12,
            "{text}: {} {shoelace}",
            area(&flat)
        );
        assert!(
            (shoelace - exact).abs() < 1e-12 || n == 5 && text.starts_with("0,0 2,0"),
            "{text}"
        );
        let lifted = certified(["s", "t", "2*s - t", "1"], "20", &domain, 1e-2);
        assert!(
            (area(&lifted) - shoelace * 6f64.sqrt()).abs() < 1e-11,
            "{text}"
        );
        let curved = certified(["s", "t", "s^2 + t^2", "1"], "40", &domain, 1e-2);
        assert_eq!(topology(&curved), [1, 1, 1], "{text}");
        assert!(area(&curved) > shoelace);
    }
}

/// The boundary is on the sides: its length is that of the polygon, and its vertices say so.
#[test]
fn the_boundary_is_the_polygon() {
    let domain = polygon("0,0 4,0 4,1 1,1 1,4 0,4");
    let m = certified(PLANE, "5", &domain, 1e-2);
    let mut uses: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for t in &m.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *uses.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut length = 0.0;
    for e in uses.iter().filter(|e| *e.1 == 1).map(|e| e.0) {
        let [a, b] = e.map(|v| m.points[v as usize]);
        length += (a[0] - b[0]).hypot(a[1] - b[1]);
        assert!(
            e.iter().all(|&v| m.kinds[v as usize] == VertexKind::Border),
            "{a:?} {b:?}"
        );
    }
    assert!((length - 16.0).abs() < 1e-12, "{length}");
}

#[test]
fn poles_inside_and_the_box() {
    // z = 1/s: the pole s = 0 divides the rectangle, and the box cuts both parts.
    let pole = ["s^2", "s*t", "1", "s"];
    let m = certified(pole, "4", &rectangle(["-1", "1"], ["0", "1"]), 1e-2);
    assert_eq!(topology(&m), [2, 2, 2]);
    assert!(m.kinds.contains(&VertexKind::Box) && m.kinds.contains(&VertexKind::Border));
    assert!(
        m.points
            .iter()
            .all(|p| (p[0] * p[2] - 1.0).abs() < 1e-12 && p[2].abs() <= 4.0)
    );
    // The pole along a side: one part. The box cuts it off.
    let m = certified(pole, "4", &rectangle(["0", "1"], ["0", "1"]), 1e-2);
    assert_eq!(topology(&m), [1, 1, 1]);
    // A box within: the square of the box.
    let m = certified(PLANE, "1", &rectangle(["-3", "3"], ["-2", "1/2"]), 1e-2);
    assert!((area(&m) - 3.0).abs() < 1e-12);
    // Sides that lie in faces of the box.
    let m = certified(PLANE, "1", &rectangle(["0", "1"], ["-1", "1"]), 1e-2);
    assert!((area(&m) - 2.0).abs() < 1e-12);
    // A face of the box that is a side of a unit triangle.
    let m = certified(
        ["s + 1", "t", "0", "1"],
        "1",
        &rectangle(["-1", "3"], ["-1/2", "1/2"]),
        1e-2,
    );
    assert!((area(&m) - 1.0).abs() < 1e-12);
    // A hole that the box makes: an annulus between a square and a circle of poles.
    let m = certified(
        ["s*(s^2+t^2)", "t*(s^2+t^2)", "1", "s^2+t^2"],
        "4",
        &rectangle(["-1", "1"], ["-1", "1"]),
        1e-2,
    );
    assert_eq!(topology(&m), [0, 1, 2]);
}

/// Base points inside are opened, those on a side are left open and said to be.
#[test]
fn base_points_inside_and_on_sides() {
    // The Whitney-like z = s/t over (0, 0): a blown-up plane. x = s, y = t.
    let blown = ["s*t", "t^2", "s", "t"];
    let inside = over(
        blown,
        "3",
        &rectangle(["-1", "1"], ["-1", "1"]),
        1e-2,
        Mode::Normalised,
    );
    assert!(inside.is_certified(), "{:?}", inside.findings);
    assert!(inside.kinds.contains(&VertexKind::Seam));
    let outside = over(
        blown,
        "3",
        &rectangle(["-1", "1"], ["1/2", "1"]),
        1e-2,
        Mode::Normalised,
    );
    assert!(
        outside.is_certified() && !outside.kinds.contains(&VertexKind::Seam),
        "{:?}",
        outside.findings
    );
    for domain in [
        rectangle(["0", "1"], ["-1", "1"]),
        polygon("-1,-1 1,1 1,-1"),
        polygon("0,0 1,1 1,0"),
    ] {
        let on = over(blown, "3", &domain, 1e-2, Mode::Normalised);
        assert!(
            on.findings.contains(&Finding::BasePointOnSide),
            "{:?}",
            on.findings
        );
    }
}

/// The sphere's parameters at infinity are one point; here a curve in the plane: s = 0 is
/// contracted to the apex of a cone.
#[test]
fn contracted_sides() {
    let cone = ["s*(1 - t^2)", "2*s*t", "s*(1 + t^2)", "1 + t^2"];
    // Half of a nappe; the apex is one vertex on the boundary.
    let m = certified(cone, "2", &rectangle(["0", "1"], ["-1", "1"]), 1e-2);
    assert_eq!(topology(&m), [1, 1, 1]);
    assert_eq!(
        m.points
            .iter()
            .filter(|p| p.iter().all(|x| x.abs() < 1e-12))
            .count(),
        1
    );
    let exact = 0.5 * std::f64::consts::PI * 2f64.sqrt();
    assert!((area(&m) / exact - 1.0).abs() < 2e-2, "{}", area(&m));
    // Across it: two pieces that meet in the apex.
    let m = certified(cone, "2", &rectangle(["-1", "1"], ["-1", "1"]), 1e-2);
    assert_eq!(topology(&m)[1], 1);
    assert!((area(&m) / (2.0 * exact) - 1.0).abs() < 2e-2);
}

/// The umbrella x = s t, y = s, z = t²: its double curve s = 0 has partners (0, t) and (0, −t).
#[test]
fn double_curves_that_end() {
    let umbrella = ["s*t", "s", "t^2", "1"];
    let sheets = |s: &Surface| s.double_curve.iter().map(|a| a.sheets).collect::<Vec<_>>();
    // Both sheets.
    let m = certified(umbrella, "2", &rectangle(["-1", "1"], ["-1", "1"]), 1e-2);
    assert_eq!(sheets(&m), [2]);
    // One sheet only, the partners are outside.
    let m = certified(umbrella, "2", &rectangle(["-1", "1"], ["1/4", "1"]), 1e-2);
    assert!(sheets(&m).is_empty());
    assert_eq!(topology(&m), [1, 1, 1]);
    // Partners of a part only: two sheets for t² < 1/4.
    let m = certified(umbrella, "2", &rectangle(["-1", "1"], ["-1/2", "1"]), 1e-2);
    assert_eq!(sheets(&m), [2]);
    let top = m.double_curve[0]
        .points
        .iter()
        .map(|p| p[2])
        .fold(0.0, f64::max);
    assert!((top - 0.25).abs() < 1e-12, "{top}");
    // A corner on it, whose partner is inside.
    let m = certified(umbrella, "2", &polygon("0,1/2 1,1 1,-1 -1,-1 -1,1"), 1e-2);
    assert_eq!(sheets(&m), [2]);
    let top = m.double_curve[0]
        .points
        .iter()
        .map(|p| p[2])
        .fold(0.0, f64::max);
    assert!((top - 0.25).abs() < 1e-12, "{top}");
    // Along a side whose partners lie on that side, the side is closed up.
    let m = certified(umbrella, "2", &polygon("0,-1 1,-1 1,1 0,1"), 1e-2);
    assert_eq!(topology(&m), [1, 1, 1]);
    // Along a side whose partners lie inside, edges have three triangles: the result is not proved.
    let m = over(
        umbrella,
        "2",
        &polygon("0,0 0,1 1,1 1,-1 -1,-1 -1,0"),
        1e-2,
        Mode::Glued,
    );
    assert!(
        m.findings
            .iter()
            .any(|f| matches!(f, Finding::CrowdedEdges(_))),
        "{:?}",
        m.findings
    );
}
