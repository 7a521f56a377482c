//! Recognition of the planes, spheres, cylinders, cones and tori that a scan consists of.

mod accuracy;
mod blends;
mod border;
mod chart;
mod choose;
mod cloud;
mod compare;
mod complete;
mod cost;
mod description;
mod entity;
mod faces;
mod facets;
mod features;
mod fit;
mod form;
mod given;
mod grow;
mod hidden;
mod kinds;
mod labels;
mod local;
mod noise;
mod orient;
mod patchwork;
mod patterns;
mod pose;
mod profile;
mod recognize;
mod related;
mod relations;
mod segment;
mod share;
mod simplify;
mod snap;
mod split;
mod start;
mod sweep;
mod symmetry;
mod template;
mod whole;

pub use chart::PrimitiveKind;
pub use entity::{
    Blend, Deviations, Entity, Face, Layout, Pattern, Recognition, Relation, RelationKind,
    Symmetry, SymmetryKind,
};
pub use facets::{FacetRecognition, points_on_facets, recognize_facets};
pub use features::{Feature, FeatureKind, Widening, features};
pub use given::{GivenLabels, LabelFacts, LabelsError, recognize_labelled};
pub use recognize::{Error, Options, recognize};
pub use related::{LabelRelation, RelationDistance};
pub use snap::{Snap, snap};
pub use template::{Gap, Proposal, ProposeError, propose, stand_on};
