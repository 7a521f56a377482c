//! Recognition: which planes, spheres, cylinders, cones and tori a scan consists of.
#![forbid(unsafe_code)]

mod blends;
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
mod snap;
mod split;
mod start;
mod template;

pub use entity::{Blend, Deviations, Entity, Recognition, Relation, RelationKind};
pub use facets::{FacetRecognition, recognize_facets};
pub use recognize::{Error, Options, recognize};
pub use snap::{Snap, snap};
pub use template::{Gap, Proposal, ProposeError, propose};
