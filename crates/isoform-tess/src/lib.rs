//! Rational parametric surfaces (s, t) ↦ (X/W, Y/W, Z/W), analysed exactly for certified
//! triangulation.
//!
//! - [`Map`]: four polynomials with rational coefficients, validated, as forms of equal degree in
//!   (s : t : w).
//! - [`Region`]: the parameters that a map sends into a box; a [`Domain`] restricts them.
//! - [`Patch`]: rational Bézier patches, and the patches of NURBS surfaces, as maps over [0, 1]².
//! - [`base_points`]: the common zeros of the four forms, with the seam curves of all levels of
//!   blow-ups.
//! - [`singular`]: curves along which the surface crosses itself or has cusps, or which are
//!   contracted to a point.
//! - [`analyse`]: all of these, with the degrees, the implicit equation and the pole curve, within
//!   a [`Budget`].
//! - [`Claim`], [`Basis`], [`Finding`]: the claims about a surface, how they were decided, and what
//!   contradicts them.
//! - [`triangulate`], [`triangulate_patches`]: the [`Surface`] of a map in a box, or of patches, by
//!   [`TriangulateOptions`]; [`SurfaceBox`] is a box that contains it.
//! - [`NumberField`], [`Element`], [`Algebraic`]: the exact numbers of all these results.
#![forbid(unsafe_code)]

mod analysis;
mod base;
mod claim;
mod coefficients;
mod complex;
mod complex_seams;
mod cover;
mod deck;
mod dense;
mod domain;
mod double;
mod double_curve;
mod embedded;
mod equation;
mod fan;
mod field;
mod finding;
mod frame;
mod homotopy;
mod joined;
mod map;
mod mesh;
mod orientation;
mod pairs;
mod patch;
mod real_border;
mod region;
mod residues;
mod singular;
mod stepping;
mod surface;
mod surface_box;
mod tangents;
mod triangulate;
mod univariate;
mod winding;
mod zeros;

pub use analysis::{Analysis, Budget, analyse};
pub use base::{BasePoint, BinaryForm, Near, Seam, base_multiplicity, base_points};
pub use claim::{Basis, Certificate, Claim, Verdict};
pub use complex_seams::SeamLine;
pub use domain::{Domain, DomainError, MAX_CORNERS, Parameters, bounds_over};
pub use double::{pinch_points, solitary_arcs};
pub use embedded::{PatchesError, triangulate, triangulate_patches};
pub use field::{Algebraic, Element, NumberField};
pub use finding::{Finding, JoinedCurve, Phase, Unopened};
pub use frame::Frame;
pub use isoform_control::{Control, Stopped};
pub use map::{KEYS, MAX_MAP_DEGREE, Map, MapError, MapOptions, VARIABLES};
pub use patch::{ControlPoint, Patch, patch_bounds};
pub use real_border::RealBorder;
pub use region::{Region, RegionTopology, Triangle};
pub use singular::{
    Contraction, CurveKind, POINTS_DEGREE, RealPart, Singular, SingularCurve, real_part, singular,
};
pub use surface::{
    DoubleArc, MeshOptions, Mode, Point3, Surface, TriangulateError, TriangulateOptions, VertexKind,
};
pub use surface_box::SurfaceBox;
pub use triangulate::{Crossing, Prepared, join_patches, triangulate_once};
pub use winding::{CutCurve, CutEdge, Winding};
pub use zeros::Chart;
