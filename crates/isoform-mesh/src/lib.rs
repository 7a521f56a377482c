//! Labelled surface meshes and tetrahedra of any solid that can say its parts.
#![forbid(unsafe_code)]

pub mod check;
pub mod decide;
pub mod features;
