//! Implicit splines of surfaces that are known.

use isoform_control::Control;
use isoform_geom::{Aabb, Field, Point3, PolynomialData, norm};
use isoform_num::Random;
use isoform_spline::{
    DataError, Error, Fineness, ImplicitSpline, NormalSource, Normals, Options, PolynomialFit,
    SplineFit, implicitize, implicitize_globally,
};

/// Radii of the torus.
const RADII: [f64; 2] = [1.0, 0.4];

/// Points of the torus by area, with outward normals.
fn torus(n: usize, seed: u64) -> (Vec<Point3>, Vec<Point3>) {
    let mut random = Random::new(seed);
    let [large, small] = RADII;
    let mut pairs = Vec::new();
    while pairs.len() < n {
        let v = random.unit() * std::f64::consts::TAU;
        if random.unit() * (large + small) > large + small * v.cos() {
            continue;
        }
        let u = random.unit() * std::f64::consts::TAU;
        let n = [u.cos() * v.cos(), u.sin() * v.cos(), v.sin()];
        let p = [
            large * u.cos() + small * n[0],
            large * u.sin() + small * n[1],
            small * n[2],
        ];
        pairs.push((p, n));
    }
    pairs.into_iter().unzip()
}

fn fitted(points: &[Point3], normals: Normals<'_>, fineness: Fineness) -> SplineFit {
    let options = Options {
        fineness,
        ..Options::default()
    };
    implicitize(points, normals, &options, &Control::default()).expect("a surface")
}

/// The root mean square of the distances of points from f = 0, by one Newton step.
fn error(spline: &ImplicitSpline, points: &[Point3]) -> f64 {
    let squares = points.iter().map(|p| {
        let jet = spline.jet(*p);
        jet.v * jet.v / jet.g.iter().map(|g| g * g).sum::<f64>()
    });
    (squares.sum::<f64>() / points.len() as f64).sqrt()
}

#[test]
fn errors_fall_with_the_fourth_power_of_the_spacing() {
    let (points, normals) = torus(20_000, 1);
    let (others, _) = torus(1000, 2);
    let run = |cells| {
        let made = fitted(&points, Normals::Given(&normals), Fineness::Cells(cells));
        assert!(made.spline.data_cells() <= cells);
        (made.spline.unknowns() as f64, error(&made.spline, &others))
    };
    let (few, coarse) = run(150);
    let (many, fine) = run(1000);
    let order = (coarse / fine).ln() / (many / few).ln();
    // A surface has h^-2 cells: 2 is order 4 in the spacing, as cubic splines have it.
    assert!(order > 1.6, "{coarse:e} with {few}, {fine:e} with {many}");
    assert!(fine < 1e-5);
}

#[test]
fn cells_are_at_most_half_as_many_as_points() {
    let (points, normals) = torus(1000, 4);
    let made = fitted(
        &points,
        Normals::Given(&normals),
        Fineness::Cells(usize::MAX),
    );
    assert!((400..=500).contains(&made.spline.data_cells()));
}

#[test]
fn inside_is_positive_and_unknown_normals_are_found() {
    let (points, normals) = torus(6000, 3);
    let mut random = Random::new(5);
    let flipped: Vec<Point3> = normals
        .iter()
        .map(|n| {
            if random.unit() < 0.5 {
                *n
            } else {
                n.map(|v| -v)
            }
        })
        .collect();
    for (normals, source) in [
        (Normals::Unknown, NormalSource::Estimated),
        (Normals::Given(&normals), NormalSource::Given),
        (Normals::Given(&flipped), NormalSource::Turned),
    ] {
        let made = fitted(&points, normals, Fineness::Data);
        assert_eq!(made.sides.source, source);
        assert!(made.spline.value([1.0, 0.0, 0.2]) > 0.0, "{source:?}");
        assert!(made.spline.value([0.0, 0.0, 0.0]) < 0.0, "{source:?}");
        assert!(made.spline.value([9.0, 0.0, 0.0]) < 0.0, "{source:?}");
        assert!(
            made.distances.rms < 2e-3,
            "{source:?}: {:?}",
            made.distances
        );
        assert_eq!(made.components.with_data, 1);
    }
}

#[test]
fn noise_ends_refinement_and_is_averaged() {
    let (clean, normals) = torus(8000, 7);
    let mut random = Random::new(8);
    let sigma = 0.02;
    let noisy: Vec<Point3> = clean
        .iter()
        .map(|p| p.map(|v| v + sigma * 1.732 * random.symmetric()))
        .collect();
    let made = fitted(&noisy, Normals::Given(&normals), Fineness::Data);
    // Of order sigma · sqrt(unknowns / points).
    assert!(error(&made.spline, &clean) < 0.5 * sigma);
    assert!(made.spline.unknowns() < 4000);
}

#[test]
fn cells_are_refined_where_a_tolerance_asks() {
    let (points, normals) = torus(8000, 9);
    let made = fitted(&points, Normals::Given(&normals), Fineness::Tolerance(5e-3));
    assert!(made.distances.rms < 5e-3);
    let finer = fitted(&points, Normals::Given(&normals), Fineness::Tolerance(2e-4));
    assert!(finer.distances.rms < 2e-4);
    assert!(finer.spline.data_cells() > made.spline.data_cells());
}

#[test]
fn bounds_hold_the_values_and_derivatives_are_those_of_values() {
    let (points, normals) = torus(4000, 11);
    let made = fitted(&points, Normals::Given(&normals), Fineness::Cells(300));
    let spline = &made.spline;
    let mut random = Random::new(12);
    for k in 0..400 {
        // Boxes from a hundredth of a cell to beyond the domain.
        let size = 3.0 * (0.5f64).powi(k % 12);
        let lo: Point3 = std::array::from_fn(|_| 2.2 * random.symmetric());
        let region = Aabb {
            lo,
            hi: lo.map(|v| v + size * random.unit()),
        };
        let bounds = spline.bounds(region);
        for _ in 0..20 {
            let p: Point3 = std::array::from_fn(|i| {
                region.lo[i] + random.unit() * (region.hi[i] - region.lo[i])
            });
            let v = spline.value(p);
            assert!(
                bounds.lo() <= v && v <= bounds.hi(),
                "{v} outside {bounds:?}"
            );
        }
    }
    for p in &points[..50] {
        let jet = spline.jet(*p);
        for axis in 0..3 {
            let moved = |s: f64| {
                let mut q = *p;
                q[axis] += s;
                spline.value(q)
            };
            let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!(
                (slope - jet.g[axis]).abs() < 1e-7,
                "{slope} {}",
                jet.g[axis]
            );
        }
        assert_eq!(jet.v.to_bits(), spline.value(*p).to_bits());
    }
}

#[test]
fn numbers_make_the_spline_again() {
    let (points, normals) = torus(3000, 13);
    let made = fitted(&points, Normals::Given(&normals), Fineness::Tolerance(2e-4));
    let data = made.spline.data();
    let again = ImplicitSpline::from_data(&data).expect("a spline");
    assert_eq!(again.data(), data);
    for p in &points[..200] {
        assert_eq!(again.value(*p).to_bits(), made.spline.value(*p).to_bits());
        assert!(again.is_seen(*p) && again.holds_data(*p));
    }
    assert!(!again.is_seen([0.0; 3]));
    let broken = |change: fn(&mut isoform_geom::SplineData)| {
        let mut data = data.clone();
        change(&mut data);
        ImplicitSpline::from_data(&data).expect_err("no spline")
    };
    assert_eq!(broken(|d| d.degree = 9), DataError::Degree(9));
    assert!(matches!(
        broken(|d| d.count = [1 << 20; 3]),
        DataError::Lattice { .. }
    ));
    assert_eq!(broken(|d| d.levels.clear()), DataError::Levels(0));
    assert!(matches!(
        broken(|d| d.levels[1].cells[0] = [-1; 3]),
        DataError::Cell { .. }
    ));
    assert!(matches!(
        broken(|d| {
            d.levels[0].coefficients.pop();
        }),
        DataError::Coefficients { .. }
    ));
    assert_eq!(
        broken(|d| d.levels[0].coefficients[0] = f64::NAN),
        DataError::NotFinite
    );
}

#[test]
fn points_without_a_surface_are_refused() {
    let run = |points: &[Point3]| {
        implicitize(
            points,
            Normals::Unknown,
            &Options::default(),
            &Control::default(),
        )
        .map(|made| made.spline)
    };
    assert_eq!(run(&[]).expect_err("none"), Error::Few { found: 0 });
    let one = vec![[1.0, 2.0, 3.0]; 50];
    assert_eq!(
        run(&one).expect_err("none"),
        Error::Degenerate { is_point: true }
    );
    let line: Vec<Point3> = (0..50)
        .map(|i| [f64::from(i), 2.0 * f64::from(i), 1.0])
        .collect();
    assert_eq!(
        run(&line).expect_err("none"),
        Error::Degenerate { is_point: false }
    );
    assert_eq!(
        run(&[[f64::NAN; 3]; 50]).expect_err("none"),
        Error::NotFinite
    );
    // A plane is a surface.
    let plane: Vec<Point3> = (0..400)
        .map(|i| [f64::from(i % 20), f64::from(i / 20), 5.0])
        .collect();
    let spline = run(&plane).expect("a plane");
    let far = plane.iter().map(|p| {
        let jet = spline.jet(*p);
        jet.v.abs() / norm(jet.g)
    });
    assert!(far.fold(0.0, f64::max) < 1e-6);
}

/// Points that are left out to decide on the fineness have copies among the others, which are met
/// better by any level.
#[test]
fn points_at_one_place_count_once() {
    let (points, normals) = torus(200, 16);
    let plain = fitted(&points, Normals::Given(&normals), Fineness::Data);
    let (others, _) = torus(1000, 17);
    let [many, of_many] = [&points, &normals].map(|list| list.repeat(10));
    let mut random = Random::new(19);
    for apart in [0.0, 1e-9] {
        let many: Vec<Point3> = many
            .iter()
            .map(|p| p.map(|v| v + apart * random.unit()))
            .collect();
        let made = fitted(&many, Normals::Given(&of_many), Fineness::Data);
        assert!(made.spline.data_cells() * 2 <= points.len());
        assert!(error(&made.spline, &others) < 1.5 * error(&plain.spline, &others));
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let (points, _) = torus(100, 18);
    let refused = |options: &Options| {
        let made = implicitize(&points, Normals::Unknown, options, &Control::default());
        match made.map(|made| made.spline) {
            Err(Error::Option { name, .. }) => name,
            other => panic!("{other:?}"),
        }
    };
    for smoothing in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        let options = Options {
            smoothing,
            ..Options::default()
        };
        assert_eq!(refused(&options), "smoothing");
    }
    for degree in [1, 6] {
        let options = Options {
            degree,
            ..Options::default()
        };
        assert_eq!(refused(&options), "degree");
    }
}

#[test]
fn a_stopped_fit_says_so() {
    let (points, normals) = torus(3000, 15);
    let control = Control::default().for_seconds(0.0);
    let options = Options::default();
    let made = implicitize(&points, Normals::Given(&normals), &options, &control);
    assert!(matches!(made, Err(Error::Stopped(_))));
}

/// A polynomial's value and gradient, straight from its numbers.
fn polynomial_at(data: &PolynomialData, p: Point3) -> (f64, Point3) {
    let value = |p: Point3| -> f64 {
        let q: Point3 = std::array::from_fn(|k| (p[k] - data.origin[k]) / data.unit);
        let monomial = |e: &[u16; 3]| -> f64 { (0..3).map(|k| q[k].powi(e[k].into())).product() };
        let exponents = PolynomialData::exponents(data.degree);
        let terms = exponents.iter().zip(&data.coefficients);
        terms.map(|(e, c)| c * monomial(e)).sum()
    };
    let h = 1e-4 * data.unit;
    let slope = |k: usize| {
        let moved = |s: f64| {
            let mut q = p;
            q[k] += s * h;
            value(q)
        };
        (moved(1.0) - moved(-1.0)) / (2.0 * h)
    };
    (value(p), std::array::from_fn(slope))
}

/// The root mean square of the distances of points from F = 0.
fn error_of(data: &PolynomialData, points: &[Point3]) -> f64 {
    let squares = points.iter().map(|p| {
        let (f, g) = polynomial_at(data, *p);
        (f / norm(g)).powi(2)
    });
    (squares.sum::<f64>() / points.len() as f64).sqrt()
}

fn globally(points: &[Point3], normals: Normals<'_>, degree: usize) -> PolynomialFit {
    implicitize_globally(points, normals, degree, &Control::default()).expect("a polynomial")
}

#[test]
fn a_torus_is_a_polynomial_of_degree_four() {
    let (points, normals) = torus(4000, 21);
    let (others, _) = torus(300, 22);
    for (unit, offset, least) in [(1.0, 0.0, 1e-12), (1e-6, 0.0, 1e-12), (1.0, 1e6, 1e-9)] {
        let placed = |p: &Point3| p.map(|v| unit * v + offset);
        let near: Vec<Point3> = points.iter().map(placed).collect();
        let others: Vec<Point3> = others.iter().map(placed).collect();
        // The errors of estimated normals are not averaged away.
        for (normals, least) in [(Normals::Given(&normals), least), (Normals::Unknown, 1e-6)] {
            let made = globally(&near, normals, 4);
            let error = error_of(&made.polynomial, &others);
            assert!(error < 2.0 * least * unit, "{error:e}");
            assert_eq!(
                (made.components.with_data, made.components.without_data),
                (1, 0)
            );
            let inside = [1.0, 0.0, 0.2];
            assert!(polynomial_at(&made.polynomial, placed(&inside)).0 > 0.0);
        }
    }
}

#[test]
fn what_points_leave_open_is_chosen_simply() {
    // (1 − r²) times anything of degree 4 vanishes on the sphere, as does (1 − r²)² twice.
    let sphere: Vec<Point3> = torus(3000, 23).0;
    let sphere: Vec<Point3> = sphere.iter().map(|p| p.map(|v| v / norm(*p))).collect();
    for degree in [2, 4, 6] {
        let made = globally(&sphere, Normals::Given(&sphere), degree);
        for p in &sphere[..200] {
            let (f, g) = polynomial_at(&made.polynomial, *p);
            assert!(
                f.abs() < 1e-6 && (norm(g) - 1.0).abs() < 0.2,
                "degree {degree}: {f:e}"
            );
        }
    }
}

#[test]
fn noise_is_averaged_by_the_whole_polynomial() {
    let (clean, normals) = torus(6000, 25);
    let mut random = Random::new(26);
    let sigma = 2e-3;
    let mut noise = || sigma * 1.732 * random.symmetric();
    let noisy: Vec<Point3> = clean.iter().map(|p| p.map(|v| v + noise())).collect();
    let share = (35.0f64 / 6000.0).sqrt();
    let mut turn = Random::new(27);
    // Normals off by some ten degrees count for less.
    let rough: Vec<Point3> = (normals.iter())
        .map(|n| n.map(|v| v + 0.1 * 1.732 * turn.symmetric()))
        .collect();
    for (normals, most) in [(&normals, 1.0), (&rough, 1.3)] {
        let made = globally(&noisy, Normals::Given(normals), 4);
        let error = error_of(&made.polynomial, &clean[..1000]);
        assert!(error < most * sigma * share, "{error:e}");
    }
}

#[test]
fn polynomials_are_asked_for_in_range() {
    let (points, normals) = torus(100, 29);
    let run = |points: &[Point3], degree| {
        let normals = Normals::Given(&normals[..points.len()]);
        implicitize_globally(points, normals, degree, &Control::default())
    };
    for degree in [0, 13] {
        assert!(matches!(
            run(&points, degree),
            Err(Error::Option { name: "global", .. })
        ));
    }
    assert!(matches!(run(&points[..3], 2), Err(Error::Few { found: 3 })));
    // Fewer points than coefficients: some polynomial through them.
    let made = run(&points, 8).expect("a polynomial");
    let off = points
        .iter()
        .map(|p| polynomial_at(&made.polynomial, *p).0.abs());
    assert!(off.fold(0.0, f64::max) < 1e-2);
}

#[test]
fn outliers_are_counted_and_left_out() {
    let (mut points, mut normals) = torus(8000, 31);
    let others = torus(1000, 32).0;
    let clean = fitted(&points, Normals::Given(&normals), Fineness::Cells(400));
    assert_eq!(clean.outliers, 0);
    let mut random = Random::new(33);
    for _ in 0..400 {
        points.push(std::array::from_fn(|_| 1.5 * random.symmetric()));
        normals.push([0.0, 0.0, 1.0]);
    }
    let made = fitted(&points, Normals::Given(&normals), Fineness::Cells(400));
    // Those within half a cell of the surface do little harm.
    assert!((250..=400).contains(&made.outliers), "{}", made.outliers);
    assert!(error(&made.spline, &others) < 2e-3);
    assert_eq!(made.components.with_data, 1);
}

#[test]
fn edges_bring_no_extra_pieces() {
    // A bored cylinder with sharp edges: normals jump where cells hold two faces.
    let mut random = Random::new(35);
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for i in 0..20_000 {
        let (u, s) = (
            random.unit() * std::f64::consts::TAU,
            0.4 * random.symmetric(),
        );
        let (e, flat) = ([u.cos(), u.sin()], (0.04 + 0.12 * random.unit()).sqrt());
        let (r, z, n) = match i % 24 {
            0..12 => (0.4, s, [e[0], e[1], 0.0]),
            12..18 => (0.2, s, [-e[0], -e[1], 0.0]),
            18..21 => (flat, 0.4, [0.0, 0.0, 1.0]),
            _ => (flat, -0.4, [0.0, 0.0, -1.0]),
        };
        points.push([r * e[0], r * e[1], z]);
        normals.push(n);
    }
    let made = fitted(&points, Normals::Given(&normals), Fineness::Cells(800));
    assert_eq!(made.outliers, 0);
    // Deep inside f is positive and far outside negative, everywhere.
    for k in 0..4000 {
        let u = f64::from(k) * 2.4;
        let z = 0.33 * (2.0 * f64::from(k) / 4000.0 - 1.0);
        let at = |r: f64, z: f64| made.spline.value([r * u.cos(), r * u.sin(), z]);
        assert!(at(0.3, z) > 0.0 && at(0.32, z) > 0.0, "{u} {z}");
        assert!(at(0.5, z) < 0.0 && at(0.1, z) < 0.0, "{u} {z}");
    }
}
