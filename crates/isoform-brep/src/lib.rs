//! Boundary representations of solids, written from the function and not from triangles.
//!
//! [`pieces`] finds what the parts of a labelled mesh lie on, and divides them where their
//! functions change. [`brep`](brep()) takes the topology from the mesh: components of one surface
//! are faces, chains of edges between them edges, and where these meet are vertices. The geometry
//! is that of the surfaces and functions; edges and vertices are where these meet, by Newton's
//! method. Faces that go round, or are no graph over a plane and have no name, are cut.
//! [`check`](check()) looks for everything that could be wrong with it, and measures it without the
//! mesh; [`stands_alone`] tells where nodes of the mesh do not matter. [`facets`](facets()) are its
//! triangles, closed where it is, and [`Skin`] finds the nearest points of its faces.
//!
//! Lengths are in model units, angles in radians where nothing else is said.
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
mod pieces;
mod place;
mod reading;
mod revolution;
mod seams;
mod shells;
mod stray;
mod surfaces;
mod topology;
mod vertices;
mod whole;

pub use alone::stands_alone;
pub use build::{Built, brep};
pub use check::{Certificate, Finding, check};
pub use facets::{FacetOptions, Facets, FacetsError, facets};
pub use isoform_control::Control;
pub use locus::Locus;
pub use measure::{Measure, of_face, total};
pub use nearest::Skin;
pub use pieces::{Pieces, pieces};
pub use surfaces::Recognize;

use isoform_control::Stopped;
use isoform_geom::Point3;

/// Why there is no boundary representation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BrepError {
    /// The mesh has edges that are not between two triangles, or triangles that run against their
    /// neighbours.
    #[error("the mesh is not closed")]
    NotClosed,
    /// A part lies on no plane, cylinder, cone, sphere or torus.
    #[error("the part {part} lies on no plane, cylinder, cone, sphere or torus{}", of_kind(*.kind))]
    NoSurface {
        /// Its name.
        part: String,
        /// What it lies on, if that has a name.
        kind: Option<&'static str>,
    },
    /// A smooth part was cut into a hundred charts, and still one of them is no graph, or no spline
    /// is near enough to it.
    #[error("no splines were found that are near enough to the part {part}")]
    NoSpline {
        /// Its name.
        part: String,
    },
    /// A part was given nodes that its surface does not hold: the mesh is too coarse for it.
    #[error("nodes of the mesh on the part {part} are {by:.1e} away from its {kind}")]
    OffSurface {
        /// Its name.
        part: String,
        /// What its function describes.
        kind: &'static str,
        /// How far the nodes are away, in model units.
        by: f64,
    },
    /// A part lies on a torus whose tube reaches its axis.
    #[error("the part {part} lies on a torus whose tube reaches its axis")]
    Spindle {
        /// Its name.
        part: String,
    },
    /// No curve was found between two faces: they touch without an angle, or what lies between them
    /// is smaller than the triangles of the mesh.
    #[error(
        "no edge was found between {} and {}, which are nearly parallel there",
        .parts[0], .parts[1]
    )]
    NoCurve {
        /// The names of the parts; the same one twice at a cut.
        parts: [String; 2],
        /// Where.
        at: Point3,
    },
    /// The surfaces around a vertex of the mesh have no point in common near it.
    #[error("the faces at a corner of the mesh have no common point near it")]
    NoVertex {
        /// Where.
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
