//! Recognition: which planes, spheres, cylinders, cones and tori a scan consists of.
#![forbid(unsafe_code)]

mod chart;
mod choose;
mod cloud;
mod entity;
mod facets;
mod fit;
mod grow;
mod kinds;
mod local;
mod recognize;
mod relations;
mod segment;
mod share;
mod split;
mod start;

pub use entity::{Deviations, Entity, Recognition, Relation, RelationKind};
pub use facets::{FacetRecognition, recognize_facets};
pub use recognize::{Error, Options, recognize};
