//! Exact algebra.
#![forbid(unsafe_code)]

mod compose;
mod gcd;
mod modpoly;
pub mod modular;
mod parse;
mod poly;
mod resultant;
mod upoly;

pub use dashu_int::{IBig, UBig};
pub use dashu_ratio::RBig;
pub use parse::{MAX_DEGREE, ParseError, ParseProblem};
pub use poly::{Exponents, MAX_VARS, Poly};
pub use resultant::{ResultantError, Subresultants, discriminant, resultant, resultant_univariate};
pub use upoly::UPoly;
