//! Exact algebra that decides the topology of rational surfaces.
//!
//! - [`Poly`]: polynomials over Q in up to four variables: arithmetic, composition, text, greatest
//!   common divisors, squarefree parts, factors; [`UPoly`]: dense univariate ones over the
//!   integers.
//! - [`resultant`], [`discriminant`], [`Subresultants`]: elimination, proven by bounds on the
//!   number of primes.
//! - [`real_roots`], [`RealRoot`]: real algebraic numbers, compared exactly; [`Fibres`]: the real
//!   roots of f(α, y) with multiplicities.
//! - [`implicit`], [`map_degrees`], [`image_dimension`]: rational maps (s, t) ↦ (X : Y : Z : W).
//! - [`modular`]: residues modulo primes and the way back, on which all of this rests.
//!
//! Results do not depend on chance, time or the order of threads: primes and pseudo-random points
//! are fixed. Functions that may take long take a [`Control`](isoform_control::Control).
//!
//! The real points over the critical values of a curve:
//!
//! ```
//! use isoform_algebra::{Fibres, Poly, real_roots};
//! use isoform_control::Control;
//! let folium = Poly::parse("x^3 + y^3 - 3*x*y", &["x", "y"])?;
//! let fibres = Fibres::new(&folium, 1, &Control::default())?;
//! let discriminant = &fibres.subresultants().expect("degree 3").resultant;
//! let found: Vec<(f64, Vec<usize>)> = real_roots(discriminant)
//!     .iter()
//!     .map(|x| {
//!         let roots = fibres.at(x, &Control::default()).expect("no vertical line").roots;
//!         (x.to_f64(), roots.iter().map(|y| y.multiplicity).collect())
//!     })
//!     .collect();
//! // The node at the origin, whose branch along the y axis makes the root triple, and the vertical
//! // tangent at x³ = 4.
//! assert_eq!(found, [(0.0, vec![3]), (4f64.cbrt(), vec![1, 2])]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod arrangement;
mod ball;
mod compose;
mod factor;
mod fibre;
mod float_roots;
pub mod formula;
mod gcd;
mod implicit;
mod modpoly;
pub mod modular;
mod parse;
mod poly;
mod precision;
mod resultant;
mod roots;
mod topology;
mod upoly;

pub use arrangement::{Arc, Arrangement, ArrangementError, Slab, Wall, WallPoint};
pub use dashu_int::{IBig, UBig};
pub use dashu_ratio::RBig;
pub use factor::FactorError;
pub use fibre::{Fibre, FibreError, FibreRoot, Fibres, count_by_signs};
pub use gcd::coprime_base;
pub use implicit::{
    DEFAULT_MAX_DEGREE, Implicit, MapDegrees, MapError, image_dimension, implicit, map_degrees,
};
pub use parse::{MAX_DEGREE, ParseError, ParseProblem};
pub use poly::{Exponents, MAX_VARS, Poly};
pub use precision::{DOUBLED, Growth, decide, refine_until};
pub use resultant::{ResultantError, Subresultants, discriminant, resultant, resultant_univariate};
pub use roots::{RealRoot, count_roots_between, real_roots, simplest_between};
pub use topology::{CurveTopology, QUADRANTS, curve_topology, in_triangle};
pub use upoly::UPoly;
