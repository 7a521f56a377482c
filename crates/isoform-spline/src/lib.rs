//! Implicit B-spline surfaces through points.

mod basis;
mod bspline;
mod components;
mod energy;
mod expansion;
mod feet;
mod global;
mod implicitize;
mod keys;
mod level;
mod matrix;
mod outliers;
mod points;
mod sample;
mod schwarz;
mod sides;
mod smoothing;
mod solve;
mod surface;

pub use bspline::MAX_DEGREE;
pub use components::Components;
pub use feet::Distances;
pub use global::{MAX_GLOBAL_DEGREE, PolynomialFit, implicitize_globally};
pub use implicitize::{Error, Fineness, Options, SplineFit, implicitize};
pub use sample::{SampleAccuracy, SampleError, sample_function};
pub use sides::{NormalReport, NormalSource, Normals};
pub use surface::{DataError, ImplicitSpline};
