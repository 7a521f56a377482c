//! Approximate rational parameterization of implicit surfaces.
//!
//! E. Wurm, B. Jüttler, M.-S. Kim: Approximate Rational Parameterization of Implicitly Defined
//! Surfaces (2003). A rational tensor-product Bézier patch is fitted to a surface F = 0 by
//! minimising S = I + ω_J J + ω_L L + ω_R R + ω_E E, and grown from a small piece of a tangent
//! plane until S reaches a bound, or its proved distance from the surface a tolerance. Any
//! [`isoform_geom::Field`] with derivatives will do.
//!
//! | what is wanted | function |
//! |---|---|
//! | one patch on a smooth function | [`parameterize`] |
//! | one patch on a surface with sharp edges | [`parameterize_part`] |
//! | patches until the surface is covered | [`cover`](fn@cover), [`cover_parts`] |
//! | the distance of a patch from a surface | [`distances`], [`prove`] |
//! | the name of the quadric that a patch lies on | [`quadric`](fn@quadric) |
//!
//! ```
//! use isoform_field::Polynomial;
//! use isoform_geom::Aabb;
//! use isoform_patch::{Control, Options, parameterize, quadric};
//!
//! // A sphere of radius 1/2, and a patch of degree (2, 2) that lies on it to rounding.
//! let square = [[2, 0, 0], [0, 2, 0], [0, 0, 2]].map(|e| (e, 1.0));
//! let sphere = Polynomial::new(square.into_iter().chain([([0; 3], -0.25)]));
//! let region = Aabb { lo: [-0.6; 3], hi: [0.6; 3] };
//! let options = Options { exact: true, ..Options::paper((2, 2), region) };
//! let made = parameterize(&sphere, &options, &Control::default())?;
//! assert!(made.is_exact);
//! assert_eq!(quadric(&made.grown.patch).map(|q| q.name()), Some("sphere"));
//! # Ok::<(), isoform_patch::Error>(())
//! ```
//!
//! Everything is computed in the unit box, whose origin is the region's centre and whose unit is
//! the region's largest edge. Results depend on the options only, not on the number of threads.

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
mod places;
mod progress;
mod quadric;
mod single;
mod singular;
mod sized;
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
pub use options::{Covering, Error, NODES, Options, PAPER_LIMIT};
pub use parameterized::Parameterized;
pub use quadric::{quadric, quadric_through};
pub use single::{parameterize, parameterize_part};
pub use terms::{Inner, K, Method, Targets, Terms, Weights};

/// Maximum degree of a patch: with larger degrees, systems become large and patches do not become
/// better.
pub const MAX_PATCH_DEGREE: usize = 8;
