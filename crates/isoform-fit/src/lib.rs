//! Fits of templates to points: f(x, y, z; a) = 0 in the least-squares sense, with the uncertainty
//! of every parameter.
//!
//! After Fayolle, Pasko, Kartasheva and Mirenkov, *Shape recovery using functionally represented
//! constructive models* (2004; "paper C"), whose local, annealing and hybrid methods are included.
//! The default differs from it. The search uses the template's own function, R-functions and all,
//! since its basins are wide. The minimum found is polished with a metric reading of the template,
//! close to a signed distance, which alone reaches the statistical limit (measured: the algebraic
//! minimum is 4 to 15 Cramér-Rao deviations off). Global certainty comes from restarts on a few
//! hundred points, not from annealing: with bounds, data units and a reflective trust region a
//! single wide start succeeds in 9 of 10 cases.
//!
//! [`fit`] is the entry point; [`Template`] is its input, [`Fit`] its result. One seed gives one
//! result to the last bit, for any number of threads.
//!
//! # Terms
//! - *template*: a function f(p; a) of space with named parameters a; its zero set is the model;
//! - *variables* x: the free parameters in units of their own ([`Space`]);
//! - *algebraic*, *metric*, *distance*: three readings of the template, from wide basins to the
//!   distance itself ([`Template`]);
//! - *start*: a point at which a search begins; *perturbation*: a minimum with one piece drawn
//!   anew;
//! - *polish*: the final descents, by the metric residual and then by the distance;
//! - *open*: not determined by the data; *bare*: surface of the model without data near it;
//! - *finding*: a reason against a fit, which determines its [`Verdict`]; *warning*: a fact to
//!   know.
//!
//! # A ball from points
//! A template describes its parameters and evaluates its function with derivatives.
//!
//! ```
//! use isoform_fit::{Control, Kind, Options, Parameter, Template, Verdict, fit};
//! use isoform_geom::{ParamField, Point3, norm, sub};
//!
//! /// r − |p − c| with a = (c, r): a signed distance, positive inside.
//! struct Distance;
//!
//! impl ParamField for Distance {
//!     fn dim(&self) -> usize {
//!         4
//!     }
//!     fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
//!         for (p, f) in points.iter().zip(out) {
//!             *f = a[3] - norm(sub(*p, [a[0], a[1], a[2]]));
//!         }
//!     }
//!     fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], g: &mut [Point3]) {
//!         self.values(points, a, out);
//!         for (p, g) in points.iter().zip(g) {
//!             let d = sub(*p, [a[0], a[1], a[2]]);
//!             *g = d.map(|v| -v / norm(d).max(1e-300));
//!         }
//!     }
//!     fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
//!         let mut g = vec![[0.0; 3]; points.len()];
//!         self.gradients(points, a, out, &mut g);
//!         for (row, g) in jac.chunks_exact_mut(4).zip(g) {
//!             row.copy_from_slice(&[-g[0], -g[1], -g[2], 1.0]);
//!         }
//!     }
//! }
//!
//! struct Ball {
//!     parameters: Vec<Parameter>,
//!     names: Vec<String>,
//! }
//!
//! impl Template for Ball {
//!     fn parameters(&self) -> &[Parameter] {
//!         &self.parameters
//!     }
//!     fn algebraic(&self) -> &dyn ParamField {
//!         &Distance
//!     }
//!     fn metric(&self) -> &dyn ParamField {
//!         &Distance
//!     }
//!     fn part_names(&self) -> &[String] {
//!         &self.names
//!     }
//!     fn parts(&self, _: &[Point3], _: &[f64], out: &mut [u32]) {
//!         out.fill(0);
//!     }
//! }
//!
//! let kinds = [("x", Kind::X), ("y", Kind::Y), ("z", Kind::Z), ("radius", Kind::Length)];
//! let ball = Ball {
//!     parameters: kinds.map(|(name, kind)| Parameter::new(name, kind)).into(),
//!     names: vec!["ball".into()],
//! };
//! // 2000 points on a ball of radius 2 about (1, −1, ½), along Fibonacci's spiral.
//! let points: Vec<Point3> = (0..2000)
//!     .map(|k| {
//!         let z = 1.0 - (f64::from(k) + 0.5) / 1000.0;
//!         let (sin, cos) = (2.399_963_229_728_653 * f64::from(k)).sin_cos();
//!         let r = (1.0 - z * z).sqrt();
//!         [1.0 + 2.0 * r * cos, -1.0 + 2.0 * r * sin, 0.5 + 2.0 * z]
//!     })
//!     .collect();
//! let found = fit(&points, &ball, &Options::default(), &Control::default())?;
//! assert_eq!(found.verdict, Verdict::Accepted, "{:?}", found.findings);
//! for (value, truth) in found.values().iter().zip([1.0, -1.0, 0.5, 2.0]) {
//!     assert!((value - truth).abs() < 1e-9);
//! }
//! # Ok::<(), isoform_fit::FitError>(())
//! ```
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate self as isoform_fit;

pub mod annealing;
pub mod bfgs;
mod bias;
mod bounds;
mod by_point;
mod cells;
pub mod chunks;
mod classical;
mod clock;
mod clutter;
mod compose;
mod correlation;
mod deviation;
mod evidence;
mod feet;
mod fit;
mod identify;
mod judge;
pub mod lm;
mod matrix;
mod minimum;
mod objective;
mod options;
mod outliers;
mod phrases;
mod point_distances;
mod polish;
mod report;
mod residuals;
mod rims;
mod scan;
mod search;
mod settle;
mod shuffle;
mod space;
mod tally;
mod task;
mod template;
#[cfg(test)]
mod testing;
mod thresholds;
mod trimmed;
mod vector;

pub use clutter::Clutter;
pub use clutter::kind::ClutterKind;
pub use deviation::{DataToModel, MAX_SURFACE_SAMPLES, ModelToData, surface_samples};
pub use fit::{Candidate, fit, fit_to, search, settle};
pub use isoform_control::Control;
pub use objective::Objective;
pub use options::{FitError, LocalMethod, Loss, Method, Options};
pub use report::{
    Estimate, Evidence, Finding, Fit, OtherMinimum, PartStatistics, Status, UndeterminedGroup,
    Verdict, Warning, Why,
};
pub use residuals::Residuals;
pub use scan::Scan;
pub use search::ConvergenceStep;
pub use space::Space;
pub use template::{Kind, Parameter, Template, Tie};
