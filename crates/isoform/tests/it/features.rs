//! Small features of a part: fits that lack one, or have one too many, report it.

use crate::support::normal;
use isoform::FrepTemplate;
use isoform::field::hyperfun::{Mode, Model};
use isoform::fit::{Control, Finding, Fit, Options, Status, Verdict, fit};
use isoform::geom::Point3;
use std::f64::consts::TAU;

/// Half sizes of a plate, and the centre and radius of its hole.
const HALF: Point3 = [50.0, 30.0, 4.0];
const HOLE: [f64; 3] = [20.0, 10.0, 3.0];
const NOISE: f64 = 0.05;

fn is_in_hole(p: &Point3) -> bool {
    (p[0] - HOLE[0]).hypot(p[1] - HOLE[1]) < HOLE[2]
}

/// Returns a random point of the plate with its hole, uniform by area.
fn on_plate(random: &mut fastrand::Rng) -> Point3 {
    let wall = TAU * HOLE[2] * 2.0 * HALF[2];
    let areas: Point3 = std::array::from_fn(|i| 8.0 * HALF[(i + 1) % 3] * HALF[(i + 2) % 3]);
    loop {
        let mut at = random.f64() * (areas.iter().sum::<f64>() + wall);
        let mut p: Point3 = std::array::from_fn(|i| HALF[i] * (2.0 * random.f64() - 1.0));
        let Some(face) = (0..3).find(|i| {
            at -= areas[*i];
            at < 0.0
        }) else {
            let (sin, cos) = (TAU * random.f64()).sin_cos();
            return [HOLE[0] + HOLE[2] * cos, HOLE[1] + HOLE[2] * sin, p[2]];
        };
        p[face] = HALF[face].copysign(p[face]);
        if face < 2 || !is_in_hole(&p) {
            return p;
        }
    }
}

fn scan(count: usize) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(7);
    (0..count)
        .map(|_| on_plate(&mut random).map(|v| v + NOISE * normal(&mut random)))
        .collect()
}

/// Fits a plate with holes that start at given positions.
fn fitted(starts: &[[f64; 2]], points: &[Point3]) -> Fit {
    let n = 3 + 3 * starts.len();
    let mut text = "-- @param a[1] length length min=60%x max=120%x
-- @param a[2] width length min=60%y max=120%y
-- @param a[3] height length min=60%z max=120%z
"
    .to_owned();
    for (k, [x, y]) in starts.iter().enumerate() {
        let first = 4 + 3 * k;
        text += &format!(
            "-- @param a[{first}] radius{k} length min=1 max=12 start=3\n\
             -- @param a[{}] x{k} length min=-45 max=45 start={x}\n\
             -- @param a[{}] y{k} length min=-28 max=28 start={y}\n",
            first + 1,
            first + 2
        );
    }
    text += &format!("my_model(x[3], a[{n}])\n{{\nmy_model = (a[1]/2 - x[1]) & (a[1]/2 + x[1])");
    text += " & (a[2]/2 - x[2]) & (a[2]/2 + x[2]) & (a[3]/2 - x[3]) & (a[3]/2 + x[3])";
    for k in 0..starts.len() {
        let [r, x, y] = [4, 5, 6].map(|i| i + 3 * k);
        text += &format!(" & ((x[1] - a[{x}])^2 + (x[2] - a[{y}])^2 - a[{r}]^2)");
    }
    text += ";\n}\n";
    let model = Model::parse(&text, Mode::Default).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    let template = FrepTemplate::new(&model, points).expect("a template");
    fit(points, &template, &Options::default(), &Control::default()).expect("a fit")
}

#[test]
fn a_plate_with_its_hole_is_accepted() {
    let result = fitted(&[[18.0, 8.0]], &scan(8000));
    assert_eq!(result.verdict, Verdict::Accepted, "{:?}", result.reasons);
    assert!(
        (result.values()[3] - HOLE[2]).abs() < 0.05,
        "{:?}",
        result.values()
    );
}

#[test]
fn a_hole_that_the_template_lacks_makes_a_fit_doubtful() {
    let result = fitted(&[], &scan(8000));
    let is_told = |f: &Finding| matches!(f, Finding::Together { count } if *count > 20);
    assert!(result.findings.iter().any(is_told), "{:?}", result.findings);
    assert_eq!(result.verdict, Verdict::Doubtful);
}

/// Two sides bulge by less than the noise, root mean square; the other faces are flat.
#[test]
fn sides_of_another_shape_make_a_fit_doubtful() {
    let mut random = fastrand::Rng::with_seed(8);
    let mut point = || -> Point3 {
        let mut p = on_plate(&mut random);
        if p[0].abs() == HALF[0] {
            let bulge = 3.0 * NOISE * (0.25 * TAU * p[1] / HALF[1]).cos();
            p[0] += bulge.copysign(p[0]);
        }
        p.map(|v| v + NOISE * normal(&mut random))
    };
    let points: Vec<Point3> = (0..8000).map(|_| point()).collect();
    let result = fitted(&[[18.0, 8.0]], &points);
    let is_told = |f: &Finding| matches!(f, Finding::Misshapen { .. });
    assert!(result.findings.iter().any(is_told), "{:?}", result.findings);
    assert_eq!(result.verdict, Verdict::Doubtful);
}

#[test]
fn a_hole_too_many_is_not_determined() {
    let result = fitted(&[[18.0, 8.0], [-20.0, -10.0]], &scan(8000));
    let is_right = |k: usize| {
        let at = &result.values()[3 + 3 * k..6 + 3 * k];
        (at[1] - HOLE[0]).hypot(at[2] - HOLE[1]) < 1.0 && (at[0] - HOLE[2]).abs() < 0.2
    };
    for k in 0..2 {
        let status = result.parameters[3 + 3 * k].status;
        assert_eq!(
            status == Status::Determined,
            is_right(k),
            "{:?}",
            result.parameters
        );
    }
    assert!(is_right(0) || is_right(1), "{:?}", result.values());
}

/// The walls of a thin tube are nearer to a cylinder between them than real objects are to their
/// models; the fit reports nevertheless that the points lie on two sheets.
#[test]
fn a_thin_tube_is_no_cylinder() {
    let text = "-- @param a[1] radius length min=10%x max=90%x start=45%x\n\
        -- @param a[2] height length min=60%z max=120%z start=98%z\n\
        my_model(x[3], a[2]) { my_model = (a[1] - sqrt(x[1]^2 + x[2]^2)) & (a[2]/2 - x[3]) & \
        (a[2]/2 + x[3]); }";
    let mut random = fastrand::Rng::with_seed(5);
    let mut point = |i: u32| -> Point3 {
        let (sin, cos) = (TAU * random.f64()).sin_cos();
        let r = if i.is_multiple_of(2) { 2.5 } else { 2.25 };
        [r * cos, r * sin, 60.0 * random.f64() - 30.0].map(|v| v + 0.01 * normal(&mut random))
    };
    let points: Vec<Point3> = (0..6000).map(&mut point).collect();
    let model = Model::parse(text, Mode::Default).expect("a program");
    let template = FrepTemplate::new(&model, &points).expect("a template");
    let result = fit(&points, &template, &Options::default(), &Control::default()).expect("a fit");
    let is_told = |f: &Finding| matches!(f, Finding::TwoWalls { .. });
    assert!(result.findings.iter().any(is_told), "{:?}", result.findings);
    assert_eq!(result.verdict, Verdict::Doubtful);
}
