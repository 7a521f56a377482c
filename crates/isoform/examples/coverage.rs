//! Coverage of 95 % intervals: fits of built-in templates to clouds with ideal noise.
//!
//! `cargo run --release -p isoform --example coverage [draws]` prints the share of intervals that
//! contain the true value, and the root mean square error in standard deviations of the fit (1 if
//! these are right), by template and noise.

use isoform::FrepTemplate;
use isoform::field::hyperfun::{Mode, Model, Pose};
use isoform::fit::{Control, Options, Template, fit};
use isoform::geom::{Aabb, Frame, Point3};

/// Number of points of a cloud.
const POINTS: usize = 3000;
/// Standard deviations of the noise, as shares of the part's diagonal.
const NOISES: [f64; 3] = [1e-4, 1e-3, 5e-3];
/// Templates and the true values of their parameters.
const PARTS: [(&str, &str, &[f64]); 3] = [
    (
        "box",
        include_str!("../../../examples/templates/box.hf"),
        &[70.0, 45.0, 28.0],
    ),
    (
        "tube",
        include_str!("../../../examples/templates/tube.hf"),
        &[30.0, 20.0, 70.0],
    ),
    (
        "cylinder",
        include_str!("../../../examples/templates/cylinder.hf"),
        &[25.0, 80.0, 1.5],
    ),
];

fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

/// Returns points of the part's surface, uniform by area.
fn surface(template: &FrepTemplate, truth: &[f64], seed: u64) -> Vec<Point3> {
    let distance = template.distance().expect("a template of few pieces");
    let reach = 1.2 * truth.iter().copied().fold(0.0, f64::max);
    let region = Aabb {
        lo: [-reach; 3],
        hi: [reach; 3],
    };
    let feet = distance.area_samples(truth, &Frame::SPACE, region, POINTS, seed);
    feet.iter().take(POINTS).map(|f| f.at).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let draws: u64 = std::env::args().nth(1).map_or(Ok(20), |n| n.parse())?;
    println!("part       noise    inside  rms error / sd  accepted");
    for (name, text, truth) in PARTS {
        let model = Model::parse(text, Mode::Default)?;
        let still = FrepTemplate::with_pose(&model, Pose::None, &[])?;
        for noise in NOISES {
            let (mut inside, mut squares, mut count, mut accepted) = (0, 0.0, 0, 0);
            for draw in 0..draws {
                let exact = surface(&still, truth, draw);
                let size = Aabb::from_points(&exact).diagonal();
                let mut random = fastrand::Rng::with_seed(1000 + draw);
                let points: Vec<Point3> = exact
                    .iter()
                    .map(|p| p.map(|v| v + noise * size * normal(&mut random)))
                    .collect();
                let template = FrepTemplate::new(&model, &points)?;
                let result = fit(&points, &template, &Options::default(), &Control::default())?;
                accepted += u32::from(result.acceptable);
                for (estimate, truth) in result.parameters.iter().zip(truth) {
                    let (Some(sd), Some((lo, hi))) = (estimate.sd, estimate.ci95) else {
                        continue;
                    };
                    count += 1;
                    inside += i32::from((lo..=hi).contains(truth));
                    squares += ((estimate.value - truth) / sd).powi(2);
                }
            }
            println!(
                "{name:10} {noise:<8} {:5.1} %  {:14.2}  {accepted} of {draws}",
                100.0 * f64::from(inside) / f64::from(count),
                (squares / f64::from(count)).sqrt()
            );
        }
    }
    Ok(())
}
