//! Exact algebra.
#![forbid(unsafe_code)]

mod ball;
mod compose;
mod factor;
mod fibre;
mod gcd;
mod implicit;
mod modpoly;
pub mod modular;
mod parse;
mod poly;
mod resultant;
mod roots;
mod upoly;

pub use dashu_int::{IBig, UBig};
pub use dashu_ratio::RBig;
pub use factor::FactorError;
pub use fibre::{Fibre, FibreError, FibreRoot, Fibres, count_by_signs};
pub use implicit::{DEFAULT_MAX_DEGREE, Implicit, MapDegrees, MapError, image_dimension, implicit, map_degrees};
pub use parse::{MAX_DEGREE, ParseError, ParseProblem};
pub use poly::{Exponents, MAX_VARS, Poly};
pub use resultant::{ResultantError, Subresultants, discriminant, resultant, resultant_univariate};
pub use roots::{RealRoot, count_roots_between, real_roots, simplest_between};
pub use upoly::UPoly;
