//! Boundary representations of solids, constructed from functions and not from triangles.
//!
//! [`pieces`] finds the surfaces of the parts of a labelled mesh, and divides them where their
//! functions change. [`brep`](brep()) takes the topology from the mesh: components of one surface
//! are faces, chains of mesh edges between them are edges, and nodes where chains meet are
//! vertices. The geometry is that of the surfaces and functions; edges and vertices are their
//! intersections, by Newton's method. Faces are cut if they wrap around, or have no known surface
//! and are not a graph over a plane. [`check`](check()) searches for everything that could be wrong
//! with the result, and measures it without the mesh; [`stands_alone`] shows that it does not
//! depend on the nodes of the mesh. [`facets`](facets()) triangulates it, closed if it is, and
//! [`FaceProjector`] finds the nearest points of its faces.
//!
//! Lengths are in model units, angles in radians unless stated otherwise.
#![forbid(unsafe_code)]

mod alone;
mod arcs;
mod build;
mod charts;
mod check;
mod collapse;
mod contacts;
mod curves;
mod cut;
mod facets;
mod fit;
mod flat;
mod locus;
mod measure;
mod nearest;
mod newton;
mod piece;
mod pieces;
mod place;
mod reading;
mod revolution;
mod seams;
mod shells;
mod stray;
mod surfaces;
mod tolerance;
mod topology;
mod vertices;
mod whole;

pub use alone::stands_alone;
pub use build::{MeshedBrep, brep};
pub use check::{Certificate, Finding, check};
pub use facets::{FacetOptions, Facets, FacetsError, facets};
pub use isoform_control::Control;
pub use locus::Locus;
pub use measure::{Measure, of_face, total};
pub use nearest::FaceProjector;
pub use pieces::{Pieces, pieces};
pub use surfaces::Recognize;

use isoform_control::Stopped;
use isoform_geom::Point3;

/// Reason why a smooth part has no splines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplineRefusal {
    /// A chart still faces directions too different for a height over a plane.
    #[error("turns over even in pieces of a few triangles, where it is cut into {charts} faces")]
    TurnsOver {
        /// Number of charts that it was cut into.
        charts: usize,
    },
    /// All charts are heights over planes, but one has no spline within the tolerance.
    #[error("has no splines that are near enough, even where it is cut into {charts} faces")]
    TooFar {
        /// Number of charts that it was cut into.
        charts: usize,
    },
}

/// Reasons why no boundary representation is made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BrepError {
    /// The mesh has edges that are not between two triangles, or triangles that run against their
    /// neighbours.
    #[error("the mesh is not closed")]
    NotClosed,
    /// A part does not lie on a plane, cylinder, cone, sphere or torus.
    #[error("the part {part} lies on no plane, cylinder, cone, sphere or torus{}", of_kind(*.kind))]
    NoSurface {
        /// Name of the part.
        part: String,
        /// Kind of its surface, if that has a name.
        kind: Option<&'static str>,
    },
    /// A smooth part was cut into charts of a few triangles, and one of them is still not a graph,
    /// or has no spline near enough.
    #[error("the part {part} {why}")]
    NoSpline {
        /// Name of the part.
        part: String,
        /// Reason why its charts do not suffice.
        why: SplineRefusal,
    },
    /// A part has nodes that are off its surface: the mesh is too coarse for it.
    #[error("nodes of the mesh on the part {part} are {by:.1e} away from its {kind}")]
    OffSurface {
        /// Name of the part.
        part: String,
        /// Kind of surface that its function describes.
        kind: &'static str,
        /// Largest distance of the nodes, in model units.
        by: f64,
    },
    /// A part lies on a torus whose tube reaches its axis.
    #[error("the part {part} lies on a torus whose tube reaches its axis")]
    Spindle {
        /// Name of the part.
        part: String,
    },
    /// No curve was found between two faces: they touch without an angle, or features between them
    /// are smaller than the triangles of the mesh.
    #[error(
        "no edge was found between {} and {}, which are nearly parallel there",
        .parts[0], .parts[1]
    )]
    NoCurve {
        /// Names of the parts; equal at a cut.
        parts: [String; 2],
        /// A point between the faces.
        at: Point3,
    },
    /// The surfaces around a vertex of the mesh have no common point near it.
    #[error("the faces at a corner of the mesh have no common point near it")]
    NoVertex {
        /// Position of the vertex.
        at: Point3,
    },
    /// A void lies in no solid.
    #[error("a void lies in no solid")]
    LooseVoid,
    /// The work was stopped.
    #[error("stopped")]
    Stopped,
}

fn of_kind(kind: Option<&str>) -> String {
    kind.map_or_else(String::new, |k| {
        format!(" (it is part of a surface of the kind {k})")
    })
}

impl From<Stopped> for BrepError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}
