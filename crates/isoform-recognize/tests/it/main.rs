//! The integration tests of this crate, as one binary.

mod clouds;
mod faces;
mod facets;
mod features;
mod form;
mod labels;
mod parts;
mod patterns;
mod shafts;
