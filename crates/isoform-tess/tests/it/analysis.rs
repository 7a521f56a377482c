//! The analysis against closed forms, limits along lines and curves, and changes of frame.

use isoform_algebra::{Poly, RBig};
use isoform_control::Control;
use isoform_tess::{
    Algebraic, Analysis, BasePoint, BinaryForm, Budget, Chart, CurveKind, Finding, Map, MapOptions,
    Phase, RealPart, Seam, VARIABLES, analyse, base_multiplicity, base_points,
};
use std::time::Instant;

const CLEBSCH: [&str; 4] = [
    "-s^2*t + t^2 + t",
    "-s^2 + s*t^2 - s",
    "-s*t^2 + s + t + 1",
    "s^2*t - s - t - 1",
];
const FIGURE_3: [&str; 4] = [
    "s*(s^2 + t^2 - 3)",
    "(s^2 + t^2)*(s^2 + t^2 - 3)",
    "t*(s^2 + t^2 - 3)",
    "(s^2 + t^2 + 1)^2",
];
const ROMAN: [&str; 4] = ["t", "s", "s*t", "s^2 + t^2 + 1"];
const FOUR_NODES: [&str; 4] = [
    "(s^2 - 2)*(t + 1)",
    "(t^2 - 3)*(s + 1)",
    "s^2 - 2 + s*(t^2 - 3)",
    "(s^2 - 2)*t - (s + 2)*(t^2 - 3)",
];
const MONKEY_SADDLE: [&str; 4] = ["s", "t", "s^3 - 3*s*t^2", "1"];
const CUSPIDAL_EDGE: [&str; 4] = ["s^2", "s^3", "s*t + t", "1"];
/// Base points over Q(√2) with two blow-ups more in a direction over Q(√2, √3), and others.
const TOWER: [&str; 4] = [
    "(s^2 - 2)^2 - 3*t^2",
    "t^4 + (s^2 - 2)^3",
    "((s^2 - 2)^2 - 3*t^2)*(s + t)",
    "(s^2 - 2)^3*t + t^5 + (s^2 - 2)^2*t*s - 3*t^3*s",
];

fn map(texts: [&str; 4]) -> Map {
    Map::parse(texts, MapOptions::default()).unwrap_or_else(|e| panic!("{texts:?}: {e}"))
}

fn analysed(texts: [&str; 4]) -> Analysis {
    let found = analyse(&map(texts), &Budget::default(), &Control::default());
    assert!(found.findings.is_empty(), "{:?}", found.findings);
    found
}

fn text(p: &Poly) -> String {
    p.display(&VARIABLES).to_string()
}

/// (curve, what it is, multiplicity in D, multiplicity in J)
fn curves(found: &Analysis) -> Vec<(String, &'static str, usize, usize)> {
    let kind = |k: &CurveKind| match k {
        CurveKind::Contracted(_) => "contracted",
        CurveKind::Ramified => "ramified",
        CurveKind::Double => "double",
    };
    let curves = &found.singular.as_ref().expect("within the budget").curves;
    curves
        .iter()
        .map(|c| {
            (
                text(&c.curve),
                kind(&c.kind),
                c.in_double.expect("D is known"),
                c.in_minors,
            )
        })
        .collect()
}

fn own<'a>(list: &[(&str, &'a str, usize, usize)]) -> Vec<(String, &'a str, usize, usize)> {
    list.iter()
        .map(|&(c, k, d, j)| (c.to_owned(), k, d, j))
        .collect()
}

#[test]
fn clebsch_has_six_real_base_points() {
    let found = analysed(CLEBSCH);
    let points: Vec<(Chart, [f64; 3], usize, usize)> = found
        .base_points
        .iter()
        .flatten()
        .map(|b| (b.chart, b.to_f64(), b.multiplicity(), b.seam.blowups()))
        .collect();
    let phi = (1.0 + 5f64.sqrt()) / 2.0;
    let expected = [
        (Chart::Affine, [0.0, -1.0, 1.0], 1, 0),
        (Chart::Affine, [-1.0, 0.0, 1.0], 1, 0),
        (Chart::Affine, [1.0 - phi, 1.0 - phi, 1.0], 1, 0),
        (Chart::Affine, [phi, phi, 1.0], 1, 0),
        (Chart::Infinite, [0.0, 1.0, 0.0], 1, 0),
        (Chart::Corner, [1.0, 0.0, 0.0], 1, 0),
    ];
    assert_eq!(points.len(), expected.len());
    for e in &expected {
        let close = |p: &(Chart, [f64; 3], usize, usize)| {
            (p.0, p.2, p.3) == (e.0, e.2, e.3) && (0..3).all(|i| (p.1[i] - e.1[i]).abs() < 1e-15)
        };
        assert_eq!(
            points.iter().filter(|p| close(p)).count(),
            1,
            "{e:?} in {points:?}"
        );
    }
    assert_eq!(curves(&found), []);
}

#[test]
fn the_surface_of_revolution_of_figure_3() {
    let found = analysed(FIGURE_3);
    assert_eq!(found.base_points.as_ref().map(Vec::len), Some(0));
    let expected = [
        ("w", "contracted", 0, 1),
        ("s^2 + t^2", "double", 1, 0),
        ("s^2 + t^2 - 3*w^2", "contracted", 2, 1),
    ];
    assert_eq!(curves(&found), own(&expected));
    let singular = found.singular.expect("within the budget");
    let RealPart::Points(points) = &singular.curves[1].real else {
        panic!("a pair of complex lines")
    };
    assert_eq!(
        points
            .iter()
            .map(|p| p.each_ref().map(Algebraic::to_f64))
            .collect::<Vec<_>>(),
        [[0.0, 0.0, 1.0]]
    );
    let CurveKind::Contracted(c) = &singular.curves[2].kind else {
        panic!("a circle contracted to the origin")
    };
    let image: Vec<[f64; 4]> = c
        .points()
        .iter()
        .map(|p| p.each_ref().map(Algebraic::to_f64))
        .collect();
    assert_eq!(
        (image, c.at_infinity()),
        (vec![[0.0, 0.0, 0.0, 1.0]], false)
    );
}

#[test]
fn the_roman_surface_has_double_lines_without_a_drop_of_rank() {
    let found = analysed(ROMAN);
    assert_eq!(
        curves(&found),
        own(&[
            ("w", "double", 1, 0),
            ("t", "double", 1, 0),
            ("s", "double", 1, 0)
        ])
    );
    assert_eq!(found.singular.map(|s| s.minors), Some(Poly::one()));
}

#[test]
fn lines_over_a_number_field_are_contracted_to_conjugate_points() {
    let found = analysed(FOUR_NODES);
    assert_eq!(
        curves(&found),
        own(&[
            ("t^2 - 3*w^2", "contracted", 1, 1),
            ("s^2 - 2*w^2", "contracted", 1, 1)
        ])
    );
    let singular = found.singular.expect("within the budget");
    let CurveKind::Contracted(c) = &singular.curves[1].kind else {
        panic!("contracted")
    };
    let points: Vec<[f64; 4]> = c
        .points()
        .iter()
        .map(|p| p.each_ref().map(Algebraic::to_f64))
        .collect();
    // On s = √2: (0 : s + 1 : s : −s − 2)(t² − 3).
    assert_eq!(points.len(), 2);
    for s in [2f64.sqrt(), -(2f64.sqrt())] {
        let expected = [0.0, -(s + 1.0) / (s + 2.0), -s / (s + 2.0), 1.0];
        assert!(
            points
                .iter()
                .any(|p| (0..4).all(|i| (p[i] - expected[i]).abs() < 1e-14)),
            "{expected:?} in {points:?}"
        );
    }
}

#[test]
fn a_cuspidal_edge_is_ramified() {
    let found = analysed(CUSPIDAL_EDGE);
    assert_eq!(
        curves(&found),
        own(&[
            ("w", "contracted", 0, 1),
            ("s", "ramified", 3, 1),
            ("s + w", "contracted", 0, 1)
        ])
    );
}

#[test]
fn equal_tangents_are_blown_up_again() {
    // At (0 : 1 : 0) in (s, w): (s w², w², s³ − 3s, w³) has the leading forms (0, 0, −3a, 0), so w
    // = b grows alone: then (1, 1, …).
    let points = base_points(&map(MONKEY_SADDLE), &Control::default()).expect("nobody stops");
    assert_eq!(points.len(), 3);
    for p in &points {
        assert_eq!((p.multiplicity(), p.seam.near.len()), (1, 1));
        assert_eq!(
            p.seam.near[0].direction.each_ref().map(Algebraic::to_f64),
            [0.0, 1.0]
        );
        assert_eq!((p.seam.curve[2].degree(), p.seam.blowups()), (0, 1));
    }
    assert_eq!(
        base_multiplicity(&map(MONKEY_SADDLE), &Control::default()),
        Ok(6)
    );
}

/// The image of a rational point (s : t : w).
fn image(map: &Map, at: &[RBig; 3]) -> [RBig; 4] {
    map.forms().each_ref().map(|f| f.eval(at))
}

/// The sine of the angle between two vectors.
fn angle(a: [f64; 4], b: [f64; 4]) -> f64 {
    let dot = |a: [f64; 4], b: [f64; 4]| (0..4).map(|i| a[i] * b[i]).sum::<f64>();
    let mut cross = 0.0;
    for i in 0..4 {
        for j in 0..i {
            cross += (a[i] * b[j] - a[j] * b[i]).powi(2);
        }
    }
    (cross / (dot(a, a) * dot(b, b))).sqrt()
}

/// Compares the seam with images at a distance of about 2^−40 in rational directions (a : b);
/// `path` gives the local coordinates (u, v) of a point whose last blow-up has the coordinates (τa,
/// τb).
fn check_seam(
    map: &Map,
    base: &BasePoint,
    seam: &Seam,
    path: &dyn Fn([RBig; 2]) -> [RBig; 2],
    checked: &mut usize,
) {
    let small = RBig::ONE / RBig::from(1u64 << 40);
    for (a, b) in [(1, 0), (0, 1), (3, 1), (-2, 5), (1, 1), (7, -3)]
        .map(|(a, b): (i32, i32)| (RBig::from(a), RBig::from(b)))
    {
        let form = |f: &BinaryForm| f.eval(&a, &b).to_f64();
        let limit = seam.curve.each_ref().map(form);
        // Near a common direction the image is still far from the limit.
        if form(&seam.common).abs() < 1e-3 {
            continue;
        }
        // Irrational coordinates by rational ones far closer than τ.
        let near = |x: &Algebraic| x.interval(4000).0;
        let ([u, v], _) = base.chart.variables();
        let mut at = base.point.each_ref().map(near);
        let [du, dv] = path([&a * &small, &b * &small]);
        // On the exceptional line itself.
        if du == RBig::ZERO && dv == RBig::ZERO {
            continue;
        }
        at[u] += du;
        at[v] += dv;
        let exact = image(map, &at);
        let scale = exact
            .iter()
            .map(|x| x.clone().max(-x))
            .max()
            .expect("four numbers");
        let found = exact.map(|x| (x / &scale).to_f64().value());
        assert!(
            angle(found, limit) < 1e-6,
            "{:?}, direction ({a} : {b}): {found:?} against {limit:?}",
            base.point
        );
        *checked += 1;
    }
    for below in &seam.near {
        let d = below.direction.each_ref().map(|x| x.interval(4000).0);
        let path = |[x, y]: [RBig; 2]| {
            path(if d[0] == RBig::ZERO {
                [&x * &y, y]
            } else {
                [x.clone(), x * (y + &d[1])]
            })
        };
        check_seam(map, base, &below.seam, &path, checked);
    }
}

#[test]
fn seams_are_limits_of_the_map() {
    let mut checked = 0;
    for texts in [
        CLEBSCH,
        FOUR_NODES,
        MONKEY_SADDLE,
        CUSPIDAL_EDGE,
        TOWER,
        ["1", "s", "t", "t^2 - s^3"],
        [
            "(t - s^2)^2",
            "s^4 + t^4",
            "(t - s^2)*s^3",
            "(t - s^2)*(t - 2*s^2) + s^5",
        ],
        [
            "s^2 + t^3",
            "s^3 + s*t",
            "-s^2*t + t^2",
            "s^2 - 2*s*t^2 + t^2",
        ],
    ] {
        let map = map(texts);
        for base in base_points(&map, &Control::default()).expect("nobody stops") {
            check_seam(&map, &base, &base.seam, &|x| x, &mut checked);
        }
    }
    assert!(checked > 150, "{checked}");
}

#[test]
fn points_are_infinitely_near_over_two_fields() {
    let map = map(TOWER);
    let points = base_points(&map, &Control::default()).expect("nobody stops");
    let irrational: Vec<_> = points
        .iter()
        .filter(|b| b.chart == Chart::Affine && b.point[0].as_rational().is_none())
        .collect();
    assert_eq!(irrational.len(), 2, "{points:?}");
    for b in irrational {
        // (s² − 2)² − 3t² with s² − 2 ≈ 2√2·a: 8a² = 3b².
        let slopes: Vec<f64> = b
            .seam
            .near
            .iter()
            .map(|n| n.direction[1].to_f64() / n.direction[0].to_f64())
            .collect();
        assert_eq!(slopes.len(), 2);
        for m in slopes {
            assert!((m * m - 8.0 / 3.0).abs() < 1e-14, "{m}");
        }
    }
    let degrees =
        isoform_algebra::map_degrees(map.affine(), &Control::default()).expect("a surface");
    assert_eq!(
        base_multiplicity(&map, &Control::default()),
        Ok(degrees.base_multiplicity)
    );
}

#[test]
fn a_change_of_the_parameter_frame_changes_no_count() {
    let mut random = fastrand::Rng::with_seed(11);
    for texts in [
        CLEBSCH,
        FIGURE_3,
        ROMAN,
        FOUR_NODES,
        MONKEY_SADDLE,
        CUSPIDAL_EDGE,
        ["1", "s", "t", "t^2 - s^3"],
    ] {
        let summary = |map: &Map| {
            let found = analyse(map, &Budget::default(), &Control::default());
            assert!(found.findings.is_empty(), "{:?}", found.findings);
            let mut points: Vec<(usize, usize)> = found
                .base_points
                .iter()
                .flatten()
                .map(|b| (b.multiplicity(), b.seam.blowups()))
                .collect();
            points.sort_unstable();
            let mut kinds: Vec<_> = curves(&found)
                .into_iter()
                .map(|(_, kind, d, j)| (kind, d, j))
                .collect();
            kinds.sort_unstable();
            let singular = found.singular.expect("within the budget");
            let arcs = singular
                .curves
                .iter()
                .filter(|c| matches!(c.real, RealPart::Curve))
                .count();
            (found.degrees, points, kinds, arcs)
        };
        let original = map(texts);
        let expected = summary(&original);
        for _ in 0..3 {
            let rows: Vec<Poly> = (0..3)
                .map(|_| {
                    (0..3).fold(Poly::zero(), |sum, v| {
                        sum + Poly::var(v).scale(&RBig::from(random.i32(-4..=4)))
                    })
                })
                .map(|row| row.dehomogenise(2))
                .collect();
            let moved = original.forms().each_ref().map(|f| f.compose(&rows));
            // A singular matrix makes a curve of the surface.
            if let Ok(moved) = Map::new(moved, MapOptions::default()) {
                assert_eq!(summary(&moved), expected, "{texts:?} in the frame {rows:?}");
            }
        }
    }
}

#[test]
fn random_maps_are_analysed_or_refused() {
    let mut random = fastrand::Rng::with_seed(5);
    let (mut analysed, mut implicit) = (0, 0);
    for round in 0..300 {
        let n = 2 + round % 3;
        let density = random.f64();
        let polynomials: [Poly; 4] = std::array::from_fn(|_| {
            let cells = (0..=n).flat_map(|i| (0..=n - i).map(move |j| [i, j, 0, 0]));
            let chosen: Vec<_> = cells.filter(|_| random.f64() < density).collect();
            Poly::from_terms(
                chosen
                    .into_iter()
                    .map(|e| (e, RBig::from(random.i32(-2..=2)))),
            )
        });
        let Ok(map) = Map::new(polynomials, MapOptions { reduce: true }) else {
            continue;
        };
        // The implicit equations of degree 16 are slow without optimisation.
        let found = analyse(
            &map,
            &Budget {
                implicit_degree: 9,
                ..Budget::default()
            },
            &Control::default(),
        );
        for finding in &found.findings {
            assert!(
                matches!(finding, Finding::DegreeAboveLimit { limit: 9, .. }),
                "{:?}: {finding}",
                map.affine()
            );
        }
        let equations = facts_hold(&map, &found, &mut random);
        implicit += usize::from(equations);
        analysed += 1;
    }
    assert!(analysed > 150, "{analysed}");
    assert!(implicit > 100, "{implicit} implicit equations");
}

/// What must hold of any map: Bézout's theorem, with the base points' multiplicities found one by
/// one; the factors of the pole make up W; the implicit equation has its degree and is zero, in
/// exact arithmetic, at points of the surface. Returns whether there is an equation.
fn facts_hold(map: &Map, found: &Analysis, random: &mut fastrand::Rng) -> bool {
    let degrees = found.degrees.as_ref().expect("counted");
    let met = degrees.map_degree * degrees.implicit_degree;
    assert_eq!(
        base_multiplicity(map, &Control::default()),
        Ok(degrees.degree * degrees.degree - met),
        "{:?}",
        map.affine()
    );
    let pole = found.pole.as_ref().expect("factored");
    let product = pole
        .iter()
        .fold(Poly::one(), |p, (f, n)| p * f.pow(*n as u32));
    assert!(product.is_associate(&map.forms()[3]), "{:?}", map.affine());
    let Some(implicit) = &found.implicit else {
        return false;
    };
    assert_eq!(implicit.equation.total_degree(), degrees.implicit_degree);
    for _ in 0..4 {
        let mut number = || RBig::from_parts(random.i64(-99..=99).into(), random.u8(1..99).into());
        let at = [number(), number()];
        let point = map.affine().each_ref().map(|f| f.eval(&at));
        let value = implicit.equation.eval(&point);
        assert_eq!(value, RBig::ZERO, "{:?} at {at:?}", map.affine());
    }
    true
}

#[test]
fn stopping_is_said() {
    let found = analyse(
        &map(CLEBSCH),
        &Budget::default(),
        &Control::default().until(Instant::now()),
    );
    assert!(found.base_points.is_none() && found.singular.is_none() && found.degrees.is_none());
    let stopped = [
        Phase::BasePoints,
        Phase::Pole,
        Phase::MapDegree,
        Phase::SingularCurves,
    ];
    for phase in stopped.map(Finding::Stopped) {
        assert!(found.findings.contains(&phase), "{:?}", found.findings);
    }
    assert_eq!(found.findings.len(), 6, "{:?}", found.findings);
    let found = analyse(
        &map(ROMAN),
        &Budget {
            implicit_degree: 3,
            ..Budget::default()
        },
        &Control::default(),
    );
    assert_eq!(
        found.findings,
        [Finding::DegreeAboveLimit {
            degree: 4,
            limit: 3
        }]
    );
    assert!(found.singular.is_some_and(|s| s.double.is_none()));
}
