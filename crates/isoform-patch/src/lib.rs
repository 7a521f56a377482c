//! Approximate rational parameterization of implicit surfaces.
//!
//! E. Wurm, B. Jüttler, M.-S. Kim: Approximate Rational Parameterization of Implicitly Defined
//! Surfaces (2003). A rational tensor-product Bézier patch is fitted to a surface F = 0 by
//! minimising S = I + ω_J J + ω_L L + ω_R R + ω_E E, and grown from a small piece of a tangent
//! plane until S reaches a bound. Any [`isoform_geom::Field`] with derivatives will do.
#![forbid(unsafe_code)]

mod cells;
mod compose;
mod cover;
mod depth;
mod distance;
mod exact;
mod feet;
mod fold;
mod grow;
mod grown;
mod least_squares;
mod local;
mod node;
mod normal_form;
mod null;
mod objective;
mod options;
mod parameterized;
mod quadric;
mod single;
mod singular;
mod solver;
mod stretch;
mod surface;
mod terms;
mod torus;
mod unit;
mod whole;

pub use cover::{Cover, Depth, cover, cover_parts};
pub use distance::{Distances, distances, foot_distances, prove, sampled};
pub use feet::reached;
pub use grown::{Grown, Phase, Row};
pub use isoform_control::Control;
pub use isoform_geom::{NormalForm, Quadric, QuadricKind};
pub use objective::{Derivatives, Evaluated, Objective};
pub use options::{Covering, Error, Options, PAPER_LIMIT};
pub use parameterized::Parameterized;
pub use quadric::quadric;
pub use single::{parameterize, parameterize_part};
pub use terms::{Inner, K, Method, Targets, Terms, Weights};

/// The largest degree: beyond it, systems are large and nothing is gained.
pub const MOST_DEGREE: usize = 8;
