//! Labelled surface meshes and tetrahedra of any solid that can say its parts.
#![forbid(unsafe_code)]

mod adapt;
mod cap;
pub mod check;
mod complex;
mod crowd;
mod cut;
pub mod decide;
pub mod features;
mod lattice;
mod measure;
mod mesher;
mod optimise;
pub mod quality;
mod refine;
mod second;
mod surface;

pub use adapt::{adapt, mean_edge, own_sizes};
pub use isoform_control::Control;
pub use mesher::{MeshError, Meshed, Options, Sizes, Warning, mesh};
