//! Patches on surfaces with sharp edges, compared with closed forms.

use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::{Aabb, Parts, Point3};
use isoform_patch::{Control, Cover, Covering, Error, Options, Parameterized, reached};

const CUBE: Aabb = Aabb {
    lo: [-0.5; 3],
    hi: [0.5; 3],
};
const TOLERANCE: f64 = 1e-3;

fn parts(formula: &str) -> Parts {
    let text = format!("my_model(x[3], a[1]) {{ my_model = {formula}; }}");
    isoform_field::parts_of(
        &Model::parse(&text, Mode::Default).expect("a model"),
        &[0.0],
    )
    .expect("parts")
}

fn options() -> Options {
    Options {
        tolerance: Some(TOLERANCE),
        ..Options::paper((3, 3), CUBE)
    }
}

/// Checks every bound against the distance given in closed form, and against the tolerance.
fn check(patches: &[Parameterized], distance: &dyn Fn(Point3) -> f64) {
    check_within(patches, distance, TOLERANCE);
}

fn check_within(patches: &[Parameterized], distance: &dyn Fn(Point3) -> f64, tolerance: f64) {
    for p in patches {
        let bound = p.distances.bound.expect("a proof");
        assert!(bound <= tolerance);
        for k in 0..41 * 41 {
            let d = distance(
                p.grown
                    .patch
                    .point(f64::from(k / 41) / 40.0, f64::from(k % 41) / 40.0),
            );
            assert!(
                d <= bound,
                "{d:e} > {bound:e} about {:?}",
                p.grown.seed_point
            );
        }
    }
}

/// Returns the fraction of points within the tolerance of a patch.
fn share(patches: &[Parameterized], points: &[Point3]) -> f64 {
    let lists: Vec<Vec<bool>> = patches
        .iter()
        .map(|p| reached(&p.grown.patch, points, TOLERANCE))
        .collect();
    (0..points.len())
        .filter(|&i| lists.iter().any(|l| l[i]))
        .count() as f64
        / points.len() as f64
}

/// Makes a cover on a pool with a given number of threads.
fn cover_parts(parts: &Parts, options: &Options, threads: usize) -> Result<Cover, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let (covering, control) = (Covering::default(), Control::default());
    let make = || isoform_patch::cover_parts(parts, options, &covering, &control);
    pool.expect("threads").install(make)
}

fn parameterize_part(parts: &Parts, options: &Options) -> Result<Parameterized, Error> {
    isoform_patch::parameterize_part(parts, options, &Control::default())
}

/// Halves of the edges of a box.
const SIZE: Point3 = [0.4, 0.3, 0.2];

/// Returns the distance from the surface of that box.
fn from_box(p: Point3) -> f64 {
    let q: Point3 = std::array::from_fn(|k| p[k].abs() - SIZE[k]);
    let outside = q.iter().map(|v| v.max(0.0).powi(2)).sum::<f64>().sqrt();
    if outside > 0.0 {
        outside
    } else {
        -q.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

#[test]
fn a_box_has_a_patch_for_each_face() {
    let model = parts("min(min(0.4 - abs(x[1]), 0.3 - abs(x[2])), 0.2 - abs(x[3]))");
    let made = cover_parts(&model, &options(), 2).expect("a cover");
    check(&made.patches, &from_box);
    assert_eq!(made.patches.len(), 6);
    let mut points = Vec::new();
    for k in 0..3 {
        for i in 0..=60 {
            for j in 0..=60 {
                let at = |i: i32| f64::from(i) / 30.0 - 1.0;
                let mut p = [0.0; 3];
                (p[k], p[(k + 1) % 3], p[(k + 2) % 3]) = (
                    SIZE[k],
                    at(i) * SIZE[(k + 1) % 3],
                    at(j) * SIZE[(k + 2) % 3],
                );
                points.extend([p, p.map(|v| -v)]);
            }
        }
    }
    assert_eq!(share(&made.patches, &points), 1.0);
    let again = cover_parts(&model, &options(), 1).expect("a cover");
    assert!(
        made.patches
            .iter()
            .zip(&again.patches)
            .all(|(a, b)| a.grown.patch == b.grown.patch)
    );
}

/// The faces are triangles, whose corners no rectangle reaches.
#[test]
fn an_octahedron_is_covered() {
    let made = cover_parts(
        &parts("0.45 - abs(x[1]) - abs(x[2]) - abs(x[3])"),
        &options(),
        2,
    )
    .expect("a cover");
    let points: Vec<Point3> = (0..=40)
        .flat_map(|i| {
            (0..=40 - i).map(move |j| {
                [f64::from(i), f64::from(j), f64::from(40 - i - j)].map(|v| v * 0.45 / 40.0)
            })
        })
        .flat_map(|p| {
            (0..8).map(move |s| std::array::from_fn(|k| if s >> k & 1 == 1 { -p[k] } else { p[k] }))
        })
        .collect();
    assert!(share(&made.patches, &points) > 0.99);
    // Planes of the faces; beyond the edges the surface is farther than the planes, but no farther
    // than that.
    check(&made.patches, &|p| {
        (p.iter().map(|v| v.abs()).sum::<f64>() - 0.45).abs() / 3f64.sqrt()
    });
    assert!(made.patches.len() <= 40, "{}", made.patches.len());
}

/// Slab with a round hole: patches along the hole follow its circle.
#[test]
fn a_round_hole_is_followed() {
    let model = parts("min(0.1 - abs(x[3]), sqrt(x[1]*x[1] + x[2]*x[2]) - 0.3)");
    let options = Options {
        seed_point: Some([0.301, 0.0, 0.1]),
        ..options()
    };
    let made = parameterize_part(&model, &options).expect("a patch");
    check(std::slice::from_ref(&made), &|p| {
        let (r, z) = (p[0].hypot(p[1]), p[2]);
        if r < 0.3 {
            (0.3 - r).hypot((z.abs() - 0.1).max(0.0))
        } else {
            (z.abs() - 0.1).abs()
        }
    });
    // A side lies on the circle for a good part of it; a straight one would by 2 √(2 · 0.3 · 1e-3)
    // = 0.05 or 0.16 radians only.
    let circle: Vec<Point3> = (0..1000)
        .map(|k| (f64::from(k) * 0.001 * std::f64::consts::TAU).sin_cos())
        .map(|(s, c)| [0.3 * c, 0.3 * s, 0.1])
        .collect();
    let arc = share(std::slice::from_ref(&made), &circle) * std::f64::consts::TAU;
    assert!(arc > 0.8, "{arc}");
}

/// The surface continues smoothly, with another curvature, at the beginning of a blend: bounds hold
/// across it.
#[test]
fn blends_are_covered_and_proved() {
    // Two planes at a right angle, joined by a polynomial fillet.
    let text = "my_model(x[3], a[1]) { u = 0 - x[1]; v = 0 - x[2]; h = max(0.2 - abs(u - v), 0); my_model = max(u, v) + h*h/0.8; }";
    let model =
        isoform_field::parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0])
            .expect("parts");
    let value = |p: Point3| (-p[0]).max(-p[1]) + (0.2 - (p[1] - p[0]).abs()).max(0.0).powi(2) / 0.8;
    let made = cover_parts(&model, &options(), 2).expect("a cover");
    // |∇F| is between 1/√2 and 1, so that |F| is at most the distance, and the distance at most
    // √2 |F|.
    check(&made.patches, &|p| value(p).abs());
    assert!(
        made.covered == made.samples && made.patches.len() <= 4,
        "{} of {}, {}",
        made.covered,
        made.samples,
        made.patches.len()
    );
}

/// Bounds are not much larger than sampled distances at the beginning of blends and at the end of
/// faces at a hole: flat faces are flat to rounding.
#[test]
fn bounds_near_edges_are_tight() {
    // A plate and a boss joined by a blend, minus a hole.
    let text = "my_model(x[3], a[1]) { r = sqrt(x[1]*x[1] + x[2]*x[2]); plate = min(min(3 - abs(x[1]), 2 - abs(x[2])), 0.5 - abs(x[3]));
        boss = min(1 - r, min(2.5 - x[3], x[3])); h = max(0.4 - abs(plate - boss), 0)/0.4;
        my_model = min(max(plate, boss) + h*h*0.1, r - 0.5); }";
    let model =
        isoform_field::parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0])
            .expect("parts");
    let value = |p: Point3| {
        let r = p[0].hypot(p[1]);
        let plate = (3.0 - p[0].abs())
            .min(2.0 - p[1].abs())
            .min(0.5 - p[2].abs());
        let boss = (1.0 - r).min(2.5 - p[2]).min(p[2]);
        let h = (0.4 - (plate - boss).abs()).max(0.0) / 0.4;
        (plate.max(boss) + h * h * 0.1).min(r - 0.5)
    };
    let cases = [
        // A face with a side that comes over the hole between samples; one below a blend that does
        // not begin yet.
        ([-2.92, 1.92, -0.5], 1e-3, [3.3, 2.3, 0.8, 2.8]),
        ([0.0, -1.81, -0.5], 1e-3, [3.3, 2.3, 0.8, 2.8]),
        // One patch at the beginning of the blend on the plate, and one on the blend.
        ([-0.2, -1.39, 0.5], 1e-4, [3.5, 2.5, 1.0, 3.0]),
        ([1.86, 0.82, 0.5], 1e-4, [3.5, 2.5, 1.0, 3.0]),
        ([-0.89, 0.47, 0.81], 1e-4, [3.5, 2.5, 1.0, 3.0]),
        ([0.88, -0.67, 0.6], 1e-4, [3.5, 2.5, 1.0, 3.0]),
    ];
    for (seed, tolerance, [x, y, below, above]) in cases {
        let region = Aabb {
            lo: [-x, -y, -below],
            hi: [x, y, above],
        };
        let options = Options {
            tolerance: Some(tolerance),
            seed_point: Some(seed),
            ..Options::paper((3, 3), region)
        };
        let made = parameterize_part(&model, &options).expect("a patch");
        let (bound, sampled) = (
            made.distances.bound.expect("a proof"),
            made.distances.sampled,
        );
        assert!(
            bound <= (3.0 * sampled).max(1e-12),
            "{bound:e} and {sampled:e} about {seed:?}"
        );
        // |∇F| is at most 1, so that |F| is at most the distance.
        let patch = &made.grown.patch;
        for k in 0..401 * 401 {
            let p = patch.point(f64::from(k / 401) / 400.0, f64::from(k % 401) / 400.0);
            assert!(
                value(p).abs() <= bound,
                "{:e} > {bound:e} at {p:?}",
                value(p)
            );
        }
        assert!(made.grown.area(&region) > 0.5, "about {seed:?}");
    }
}

/// A patch from inside a fillet extends across its whole width and along a large part of its
/// circle, and is proved where the two halves of the fillet meet.
#[test]
fn a_round_fillet_is_one_patch_wide() {
    let text = "my_model(x[3], a[1]) { r = sqrt(x[1]*x[1] + x[2]*x[2]); u = 0 - x[3]; v = 0.25 - r;
        h = max(0.12 - max(u - v, v - u), 0); my_model = max(u, v) + h*h/0.48; }";
    let model =
        isoform_field::parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0])
            .expect("parts");
    let options = Options {
        seed_point: Some([0.28, 0.0, 0.03]),
        ..options()
    };
    let made = parameterize_part(&model, &options).expect("a patch");
    // The middle of the fillet is the circle u = v = −0.03; its ends are those where u − v = ±0.12.
    let arc = |r: f64, z: f64| -> f64 {
        let circle: Vec<Point3> = (0..720)
            .map(|k| (f64::from(k) / 720.0 * std::f64::consts::TAU).sin_cos())
            .map(|(s, c)| [r * c, r * s, z])
            .collect();
        share(std::slice::from_ref(&made), &circle) * std::f64::consts::TAU
    };
    assert!(
        made.distances.bound.is_some_and(|b| b <= TOLERANCE),
        "{:?}",
        made.distances
    );
    for (r, z) in [(0.28, 0.03), (0.369, 0.0), (0.25, 0.119)] {
        assert!(arc(r, z) > 1.0, "{} at {r}, {z}", arc(r, z));
    }
}

/// Two functions that agree at all samples are still two functions: a dimple 0.004 wide in a plane.
#[test]
fn functions_that_seem_the_same_prove_nothing() {
    let text = "my_model(x[3], a[1]) { d = (x[1] - 0.03)^2 + (x[2] - 0.02)^2;
        my_model = max(x[3], x[3] + 0.1*exp(0 - 1000000*d)); }";
    let model =
        isoform_field::parts_of(&Model::parse(text, Mode::Default).expect("a model"), &[0.0])
            .expect("parts");
    let options = Options {
        seed_point: Some([0.0, 0.0, 0.0]),
        tolerance: Some(1e-3),
        ..options()
    };
    let made = parameterize_part(&model, &options).expect("a patch");
    // The wall of the dimple is where 0.1 exp(−10⁶ d) = −z, so that at the middle of the dimple the
    // surface is farther than this.
    let hidden = [0.03, 0.02, 0.0];
    let away = (0.1f64 / 0.002).ln().sqrt() * 1e-3;
    assert!(away > 1.9e-3);
    if reached(&made.grown.patch, &[hidden], 1e-9)[0] {
        assert!(
            made.distances.bound.is_none_or(|b| b >= away),
            "{:?}",
            made.distances
        );
    }
}

/// A piece that is constant contributes no surface, regardless of its other functions there: cos(43
/// z) = −0.42 at z = 0.0995, but with max(z, 0.1) in place of z only from z = 0.1927 on.
#[test]
fn nothing_is_proved_of_what_is_constant() {
    let model = parts("cos(43*max(x[3], 0.1)) + 0.42");
    let below = Options {
        tolerance: Some(0.02),
        region: Aabb {
            hi: [0.5, 0.5, 0.15],
            ..CUBE
        },
        ..options()
    };
    for seed_point in [Some([0.1, 0.2, 0.0995]), None] {
        let made = parameterize_part(
            &model,
            &Options {
                seed_point,
                ..below
            },
        );
        assert!(
            made.is_err(),
            "{:?}",
            made.map(|m| (m.grown.seed_point, m.distances))
        );
    }
    assert!(cover_parts(&model, &below, 2).is_err());
}

/// Ball minus another one: at the edge, where the pieces meet at an acute angle, and away from it
/// bounds are at most three times the maximum of closed forms on a grid.
#[test]
fn bounds_at_edges_are_near_the_distance() {
    let ball = |x: f64, p: Point3| (p[0] - x).hypot(p[1]).hypot(p[2]);
    let model = parts(
        "min(0.4 - sqrt(x[1]*x[1]+x[2]*x[2]+x[3]*x[3]), sqrt((x[1]-0.3)*(x[1]-0.3)+x[2]*x[2]+x[3]*x[3]) - 0.3)",
    );
    let seed_point = Some([
        0.0668982084840556,
        -0.10906458225960179,
        -0.15417026849751458,
    ]);
    let made = parameterize_part(
        &model,
        &Options {
            seed_point,
            tolerance: Some(1e-4),
            ..options()
        },
    )
    .expect("a patch");
    let bound = made.distances.bound.expect("a proof");
    // Only the far side of the edge contributes more; patches extend there by less than what is
    // sampled.
    let distance = |k: usize| {
        let p = made
            .grown
            .patch
            .point((k / 49) as f64 / 48.0, (k % 49) as f64 / 48.0);
        (0.4 - ball(0.0, p)).min(ball(0.3, p) - 0.3).abs()
    };
    let most = (0..49 * 49).map(distance).fold(0.0, f64::max);
    assert!(
        most <= bound && bound <= 3.0 * most,
        "{bound:e} of {most:e}"
    );
}

/// A flat face that ends at the straight edge with a round hole is flat up to there: its bound is
/// rounding.
#[test]
fn flat_faces_at_edges_are_exact() {
    let model = parts(
        "min(min(min(0.5 - abs(x[1]), 0.1 - x[2]), 0.2 - abs(x[3])), sqrt((x[1]-0.3)^2 + (x[2]-0.05)^2) - 0.15)",
    );
    let seed_point = Some([-0.2, 0.1, 0.05]);
    let made = parameterize_part(
        &model,
        &Options {
            seed_point,
            ..options()
        },
    )
    .expect("a patch");
    let control = made.grown.patch.control();
    assert!(control.iter().all(|c| (c[1] / c[3] - 0.1).abs() < 1e-15));
    assert!(
        made.distances.bound.is_some_and(|b| b < 1e-13),
        "{:?}",
        made.distances
    );
}
