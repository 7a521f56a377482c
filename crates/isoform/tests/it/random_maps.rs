//! Random maps with small coefficients through the whole library. The test is slow and ignored by
//! default: `ISOFORM_RANDOM_MAPS=10000 ISOFORM_RANDOM_SECONDS=0.5 cargo test --release -p isoform
//! --test it random_maps:: -- --ignored --nocapture` (number of maps, and the time limit of each;
//! `ISOFORM_RANDOM_FIRST` is the number of the first).

use isoform::Control;
use isoform::triangulate_map;
use isoform_algebra::{Exponents, QUADRANTS, RBig};
use isoform_check::{Options, certify};
use isoform_geom::{Mesh, Point3, cross, distance_to_segment, dot, norm, sub};
use isoform_tess::{Budget, Map, MeshOptions, Mode, Surface, TriangulateOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::panic::AssertUnwindSafe;
use std::time::{Duration, Instant};

/// Returns a polynomial of a degree with small coefficients, most of them zero.
fn polynomial(rng: &mut fastrand::Rng, degree: usize) -> String {
    let mut text = String::new();
    for i in 0..=degree {
        for j in 0..=degree - i {
            let c = if rng.u8(0..10) < 4 {
                rng.i32(-3..=3)
            } else {
                0
            };
            if c != 0 {
                text += &format!("{c:+}*s^{i}*t^{j}");
            }
        }
    }
    if text.is_empty() {
        "1".to_owned()
    } else {
        text
    }
}

/// Returns options of a coarse mesh in a box.
fn options(mode: Mode, budget: Budget) -> TriangulateOptions {
    let mesh = MeshOptions {
        tolerance: 0.03,
        longest: 1.0,
        triangles: 100_000,
    };
    TriangulateOptions {
        half_width: RBig::from(HALF_WIDTH as i32),
        domain: None,
        mode,
        mesh,
        budget,
    }
}

/// Limits of the work on a map.
#[derive(Clone, Copy)]
struct MapLimits {
    budget: Budget,
    allowed: Duration,
    /// True if time limits depend on the machine; then maps that they stop are not failures.
    by_clock: bool,
}

impl MapLimits {
    /// Returns limits by time, in seconds per map; the results depend on the machine.
    fn seconds(seconds: f64) -> Self {
        let budget = Budget {
            seconds: 0.5 * seconds,
            ..Budget::default()
        };
        Self {
            budget,
            allowed: Duration::from_secs_f64(seconds),
            by_clock: true,
        }
    }

    /// Returns limits by steps: the degree of the implicit equation bounds the exact work and
    /// [`options`] the triangles, so that any machine certifies the same set of maps. (A closure
    /// that counts its calls would not do: work on several threads calls it once a millisecond.)
    /// The clock only ends work that hangs.
    fn steps(implicit_degree: usize) -> Self {
        let budget = Budget {
            implicit_degree,
            ..Budget::default()
        };
        Self {
            budget,
            allowed: Duration::from_secs(600),
            by_clock: false,
        }
    }
}

/// Returns the requested number of maps, by default 60 with four seconds each.
#[test]
#[ignore = "takes minutes"]
fn random_maps() {
    let asked = |name, default| {
        std::env::var(name)
            .ok()
            .and_then(|n| n.parse().ok())
            .unwrap_or(default)
    };
    let first = asked("ISOFORM_RANDOM_FIRST", 0.0) as u64;
    let cost = MapLimits::seconds(asked("ISOFORM_RANDOM_SECONDS", 4.0));
    let maps = asked("ISOFORM_RANDOM_MAPS", 60.0) as u64;
    let tried = try_maps(first..first + maps, cost);
    assert!(tried.certified > 0, "nothing is certified: {tried:?}");
}

/// Map with walls in its region that are closer to each other than rounding: arcs over a point next
/// to one were once sought in the wrong slab.
#[test]
fn walls_closer_than_rounding() {
    let texts = ["-s^0+t^2-3*s", "t-2*s*t", "3*t", "-t+3*s*t"];
    let map = Map::parse(texts, Default::default()).expect("a map");
    let (surface, _) = triangulate_map(
        &map,
        &options(Mode::Glued, Budget::default()),
        &Control::default(),
    )
    .expect("a surface");
    assert!(!surface.triangles.is_empty());
}

/// Certifies a map with these polynomials, with the default tolerance and edge length, and asserts
/// that it has zero faults.
fn certified(texts: [&str; 4]) -> Surface {
    let map = Map::parse(texts, Default::default()).expect("a map");
    let mut options = options(Mode::Glued, Budget::default());
    (options.mesh.tolerance, options.mesh.longest) = (FINE, 0.25 * HALF_WIDTH);
    let (surface, _) = triangulate_map(&map, &options, &Control::default()).expect("a surface");
    assert!(surface.is_certified(), "{texts:?}: {:?}", surface.findings);
    let found = faults(&map, surface.clone(), Mode::Glued);
    assert!(found.is_empty(), "{texts:?}: {found:?}");
    surface
}

/// Default tolerance in that box.
const FINE: f64 = 5e-4 * HALF_WIDTH;

/// Returns the distance of a point from a triangle: from its foot, or the nearest point of its
/// edges.
fn distance_to(p: Point3, [a, b, c]: [Point3; 3]) -> f64 {
    let to_edge = |a: Point3, b: Point3| distance_to_segment(p, [a, b]);
    let beside = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let normal = cross(sub(b, a), sub(c, a));
    let is_inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|&(a, b)| dot(cross(sub(b, a), sub(p, a)), normal) >= 0.0);
    match is_inside {
        true => (dot(sub(p, a), normal) / norm(normal)).abs(),
        false => beside,
    }
}

/// Vertices that sheets exchange keep the tolerance: once, points of the first of these surfaces
/// were 18 tolerances from certified triangles, and those of the second 11. Between the midpoints
/// of edges and the centres of triangles, to which `tolerance` applies, a surface may deviate by
/// half as much again.
#[test]
fn matched_vertices_keep_the_tolerance() {
    type Chart = fn(f64, f64) -> [f64; 4];
    let maps: [([&str; 4], Chart); 2] = [
        (["t", "s^2-4*t^2", "-s*t^2+t^2-3", "1+t^2"], |s, t| {
            [t, s * s - 4.0 * t * t, t * t * (1.0 - s) - 3.0, 1.0 + t * t]
        }),
        (["-t^2", "-t+s^2", "s", "-1+t-s^2"], |s, t| {
            [-t * t, s * s - t, s, t - 1.0 - s * s]
        }),
    ];
    for (texts, chart) in maps {
        let surface = certified(texts);
        let (mut looked, step) = (0, isoform_testdata::cases(1, 2));
        let steps = || (0..60).step_by(step);
        for (i, j) in steps().flat_map(|i| steps().map(move |j| (i, j))) {
            let [s, t] = [i, j].map(|k| (f64::from(k) * 0.052 - 1.55).tan());
            let [x, y, z, w] = chart(s, t);
            let p = [x / w, y / w, z / w];
            if p.iter().any(|x| x.abs() >= HALF_WIDTH) {
                continue;
            }
            looked += 1;
            let corners = |t: &[u32; 3]| t.map(|v| surface.points[v as usize]);
            let off = surface.triangles.iter().map(|t| distance_to(p, corners(t)));
            let off = off.fold(f64::INFINITY, f64::min);
            assert!(off < 1.6 * FINE, "{texts:?}: {off} at {s}, {t}");
        }
        assert!(looked * step * step > 500, "{looked} points in the box");
    }
}

/// Sheets with a common tangent plane along a whole double curve, next to which triangles of any
/// size cross: inside of the box, next to pinch points and at its faces. Without the vertices of
/// both sheets in both of them, 25, 140, 33 and 66 pairs of triangles crossed.
#[test]
fn sheets_that_touch_along_a_curve() {
    for texts in [
        ["3*s^2", "1", "-2*s-s*t+2*s^2", "-t^2"],
        ["3+t+3*t^2+3*s^2", "t^2-s^2", "-2+2*t^2-2*s^2", "3*s-3*s^2"],
        ["-3*t^3+s^2*t", "2*s-s^2", "-2*s*t^2+3*s^2*t", "1"],
        [
            "3*t^2+3*s-s*t+3*s^2+2*s^2*t",
            "3-2*t^2",
            "-1-2*t-3*s*t^2+s^2*t",
            "1",
        ],
    ] {
        assert!(!certified(texts).double_curve.is_empty());
    }
}

/// Two points of the double curve lie on one wall: a partner on that wall was once taken for a
/// vertex of an arc that ends in the other point.
#[test]
fn points_of_the_double_curve_on_one_wall() {
    certified([
        "2*t^2-s*t+2*s*t^2+2*s^2*t+2*s^3",
        "2+t^3-s+s*t^2",
        "3*t+3*t^2+2*t^3-2*s+3*s^2",
        "-2*t^2+s*t-2*s*t^2+2*s^3",
    ]);
}

/// Next to a base point with infinitely near ones, a rectangle's edge was once split beyond the arc
/// on a face of the box, and certified.
#[test]
fn nothing_certified_is_outside_of_the_box() {
    let tried = try_maps(2868..2869, MapLimits::steps(16));
    assert_eq!(tried.certified + tried.reported, 2, "{tried:?}");
}

/// Images in planes and in quadrics that end in folds or in blown-up base points.
#[test]
fn ends_of_the_real_image_are_no_open_edges() {
    for seed in [24, 27, 54] {
        let tried = try_maps(seed..seed + 1, MapLimits::steps(16));
        assert!(tried.certified >= 1, "{seed}: {tried:?}");
    }
}

/// Nine maps in two modes. Of the eighteen surfaces six are above the limit of the implicit
/// equation's degree, the three maps of degree 4, and map 6 is open along two edges in both modes;
/// the other ten are certified.
#[test]
fn a_few_random_maps() {
    let tried = try_maps(0..9, MapLimits::steps(9));
    assert!(tried.certified >= 10, "{tried:?}");
    assert_eq!(tried.certified + tried.reported, 18, "{tried:?}");
}

/// Numbers of surfaces by result, and of invalid maps.
#[derive(Debug, Default, PartialEq)]
struct MapCounts {
    certified: usize,
    reported: usize,
    stopped: usize,
    invalid: usize,
}

/// Half the edge of the box.
const HALF_WIDTH: f64 = 3.0;

/// Lists the faults of a certified surface of a map.
fn faults(map: &Map, surface: Surface, mode: Mode) -> Vec<String> {
    let mut faults = Vec::new();
    let mut say = |n: usize, what: &str| {
        if n > 0 {
            faults.push(format!("{n} {what}"));
        }
    };
    let ends = ends_of_the_image(map, &surface);
    let mesh = Mesh {
        points: surface.points,
        triangles: surface.triangles,
        ..Mesh::default()
    };
    let certificate = certify(&mesh, None, &Options::default(), &Control::default());
    say(certificate.malformed.len(), "elements malformed");
    if mode == Mode::Glued && !mesh.triangles.is_empty() {
        match certificate.intersections {
            Some(i) => say(i.pairs.count, "pairs of triangles that cross"),
            None => say(1, "search for crossings that was not made"),
        }
    }
    let outside = |x: &&f64| x.abs() > HALF_WIDTH * (1.0 + 1e-9);
    say(
        mesh.points.iter().flatten().filter(outside).count(),
        "coordinates outside of the box",
    );
    say(open_edges(&mesh, &ends), "open edges inside of the box");
    let is_crowded = |n: &&usize| match mode {
        Mode::Normalised => **n > 2,
        Mode::Glued => **n > 1 && **n % 2 == 1,
    };
    say(
        edges(&mesh).values().filter(is_crowded).count(),
        "edges with too many triangles",
    );
    faults
}

/// Returns the number of triangles of each edge.
fn edges(mesh: &Mesh) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    edges
}

/// Returns the edges of the listed border of the real image, if the matrix of first derivatives of
/// the map has rank 2 in both corners of a triangle, as along a fold and in a base point; its rank
/// is 3 in the interior of a smooth image.
fn ends_of_the_image(map: &Map, surface: &Surface) -> BTreeSet<[u32; 2]> {
    let bits = |p: &Point3| p.map(f64::to_bits);
    let mut listed = BTreeSet::new();
    for pair in surface.real_border.lines.iter().flat_map(|l| l.windows(2)) {
        let [a, b] = [bits(&pair[0]), bits(&pair[1])];
        listed.extend([[a, b], [b, a]]);
    }
    let derivatives: Vec<[_; 4]> = (0..3)
        .map(|k| map.forms().each_ref().map(|f| f.derivative(k).to_f64()))
        .collect();
    let rank_falls = |triangle: usize, corner: usize| {
        let [u, v] = surface.corners[triangle][corner];
        let [s, t] = QUADRANTS[usize::from(surface.charts[triangle])];
        let local = [s as f64 * u, t as f64 * v, 1.0 - u - v];
        let at = surface
            .frame
            .map_or(local, |f| f.map(|row| dot(row, local)));
        let value = |terms: &Vec<(_, f64)>| {
            let power =
                |e: &Exponents| (0..3).map(|k| at[k].powi(i32::from(e[k]))).product::<f64>();
            terms.iter().map(|(e, c)| c * power(e)).sum::<f64>()
        };
        let rows: Vec<[f64; 4]> = derivatives
            .iter()
            .map(|d| d.each_ref().map(value))
            .collect();
        let size = |row: &[f64; 4]| row.iter().map(|x| x * x).sum::<f64>().sqrt();
        let scale = rows.iter().map(size).fold(0.0, f64::max).powi(3);
        let minor = |skip: usize| {
            let kept = |row: &[f64; 4]| {
                [
                    row[(skip + 1) % 4],
                    row[(skip + 2) % 4],
                    row[(skip + 3) % 4],
                ]
            };
            dot(cross(kept(&rows[0]), kept(&rows[1])), kept(&rows[2])).abs()
        };
        (0..4).all(|skip| minor(skip) <= 1e-9 * scale)
    };
    let mut ends = BTreeSet::new();
    for (i, t) in surface.triangles.iter().enumerate() {
        for [j, k] in [[0, 1], [1, 2], [2, 0]] {
            let [a, b] = [t[j], t[k]];
            let places = [a, b].map(|v| bits(&surface.points[v as usize]));
            if listed.contains(&places) && rank_falls(i, j) && rank_falls(i, k) {
                ends.insert([a.min(b), a.max(b)]);
            }
        }
    }
    ends
}

/// Counts the edges with one triangle that lie neither in a face of the box nor in an end of the
/// real image.
fn open_edges(mesh: &Mesh, ends: &BTreeSet<[u32; 2]>) -> usize {
    let in_face = |edge: &[u32; 2]| {
        let [p, q] = edge.map(|v| mesh.points[v as usize]);
        (0..3).any(|k| {
            [-HALF_WIDTH, HALF_WIDTH]
                .iter()
                .any(|face| [p[k], q[k]].iter().all(|x| (x - face).abs() <= 1e-9))
        })
    };
    let edges = edges(mesh);
    let is_open = |edge: &[u32; 2]| !in_face(edge) && !ends.contains(edge);
    edges
        .iter()
        .filter(|(edge, n)| **n == 1 && is_open(edge))
        .count()
}

#[test]
fn open_edges_are_seen() {
    let far = HALF_WIDTH;
    let on_box = |z: f64| Mesh {
        points: vec![[far, 0.0, z], [far, 1.0, z], [0.0, 0.0, far]],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    assert_eq!(open_edges(&on_box(0.0), &BTreeSet::new()), 2);
    assert_eq!(open_edges(&on_box(far), &BTreeSet::new()), 0);
}

/// Asserts that there are no panics, the time limit is kept approximately, and certified surfaces
/// have no crossings or open edges.
fn try_maps(seeds: Range<u64>, cost: MapLimits) -> MapCounts {
    let mut why: BTreeMap<String, usize> = BTreeMap::new();
    let mut tried = MapCounts::default();
    // All maps are tried before the test ends: thousands take hours.
    let (mut slow, mut wrong) = (Vec::new(), Vec::new());
    for seed in seeds {
        let mut rng = fastrand::Rng::with_seed(seed);
        let degree = 2 + (seed % 3) as usize;
        let texts: [String; 4] = std::array::from_fn(|_| polynomial(&mut rng, degree));
        let Ok(map) = Map::parse(texts.each_ref().map(String::as_str), Default::default()) else {
            tried.invalid += 1;
            continue;
        };
        println!("{seed} {texts:?}");
        for mode in [Mode::Normalised, Mode::Glued] {
            let clock = Instant::now();
            let control = Control::default().until(clock + cost.allowed);
            let options = options(mode, cost.budget);
            let work = AssertUnwindSafe(|| triangulate_map(&map, &options, &control));
            let made = std::panic::catch_unwind(work);
            let seconds = clock.elapsed().as_secs_f64();
            if seconds > (2.0 * cost.allowed.as_secs_f64()).max(8.0) {
                println!("{seed} {mode:?} {seconds:.1} s, too slow: {texts:?}");
                slow.push((seed, mode, seconds));
            }
            let (surface, _) = match made {
                Ok(Ok(made)) => made,
                Ok(Err(_)) => {
                    tried.stopped += 1;
                    continue;
                }
                Err(_) => {
                    wrong.push((seed, mode, vec!["panicked".to_owned()]));
                    continue;
                }
            };
            println!(
                "{seed} {mode:?} {seconds:.1} s, {} triangles: {:?}",
                surface.triangles.len(),
                surface.findings
            );
            if !surface.is_certified() {
                tried.reported += 1;
                for finding in &surface.findings {
                    let sentence = finding.to_string();
                    let letters = sentence.chars().filter(|c| !c.is_ascii_digit());
                    *why.entry(letters.take(60).collect()).or_default() += 1;
                }
                continue;
            }
            tried.certified += 1;
            let faults = faults(&map, surface, mode);
            if !faults.is_empty() {
                wrong.push((seed, mode, faults));
            }
        }
    }
    println!("{tried:?}");
    let mut why: Vec<_> = why.into_iter().collect();
    why.sort_by_key(|w| std::cmp::Reverse(w.1));
    for (sentence, n) in why {
        println!("{n:4} {sentence}");
    }
    assert!(
        wrong.is_empty(),
        "panics, or certified and wrong: {wrong:?}"
    );
    assert!(slow.is_empty(), "too slow: {slow:?}");
    assert!(cost.by_clock || tried.stopped == 0, "some hang: {tried:?}");
    tried
}
