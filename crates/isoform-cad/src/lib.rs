//! Shapes of CAD files: triangles, distances and measures of trimmed faces.
//!
//! The faces of a [`Shape`](isoform_geom::cad::Shape) lie on surfaces in parameter form and are
//! trimmed by edges, whose curves are in space. [`PreparedShape`] computes the loops in the
//! parameter plane and the triangles; distances and measures are those of the exact faces.
#![forbid(unsafe_code)]

mod chart;
mod cut;
mod edges;
mod facets;
mod lattice;
mod loops;
mod measure;
mod nearest;
mod plane;
mod prepared;
mod tree;
mod trim;

pub use edges::FacetOptions;
pub use facets::{ShapeError, ShapeFacets};
pub use isoform_control::Control;
pub use measure::FaceMeasure;
pub use nearest::{Feature, NearestPoint, nearest_on_triangle};
pub use prepared::{PreparedShape, ShapeMeasures};
