//! Rational parametric surfaces (s, t) ↦ (X/W, Y/W, Z/W), analysed exactly for certified triangulation.
//!
//! - [`Map`]: four polynomials with rational coefficients, checked, as forms of one degree in (s : t : w).
#![forbid(unsafe_code)]

mod map;

pub use map::{KEYS, MAX_DEGREE, Map, MapError, Options, VARIABLES};
