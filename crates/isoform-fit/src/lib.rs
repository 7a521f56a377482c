//! Templates fitted to points: f(x, y, z; a) = 0 in the least-squares sense, with what the data say
//! about every parameter.
//!
//! After Fayolle, Pasko, Kartasheva and Mirenkov, *Shape recovery using functionally represented
//! constructive models* (2004), whose local, annealing and hybrid methods are here too. The default
//! departs from it. The template's own function, R-functions and all, is searched with: its basins
//! are wide. What is found is polished with a metric reading of the same template, close to a
//! signed distance, which alone is at the statistical limit (measured: the algebraic minimum lies 4
//! to 15 Cramér-Rao deviations off). Global certainty comes from restarts on a few hundred points,
//! not from annealing: bounds, data units and a reflective trust region make a single wide start
//! succeed in 9 of 10 cases.
//!
//! [`fit`] is the way in; [`Template`] is what it needs, [`Fit`] what it gives. Same seed, same
//! bits, for any number of threads.
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate self as isoform_fit;

pub mod annealing;
pub mod bfgs;
mod bias;
mod bounds;
mod classical;
mod clock;
mod clutter;
mod correlation;
mod deviation;
mod evidence;
mod feet;
mod fit;
mod identify;
mod judge;
pub mod lm;
mod objective;
mod options;
mod outliers;
mod polish;
mod report;
mod rims;
mod scan;
mod search;
mod settle;
mod space;
mod task;
mod template;
#[cfg(test)]
mod testing;
mod trimmed;
mod vector;
mod words;

pub use clutter::{Beside, Clutter};
pub use deviation::{DataToModel, ModelToData, surface_samples};
pub use evidence::Evidence;
pub use fit::{Candidate, fit, search, settle};
pub use isoform_control::Control;
pub use judge::{Finding, Verdict, Warning};
pub use objective::{Objective, Residuals};
pub use options::{FitError, Local, Loss, Method, Options};
pub use report::{Estimate, Fit, Open, OtherMinimum, PartStatistics, Status, Why};
pub use scan::Scan;
pub use search::Step;
pub use space::Space;
pub use template::{Kind, Parameter, Template, Tie};
