//! Labelled surface meshes and tetrahedra of any solid that can say its parts.
#![forbid(unsafe_code)]

mod adapt;
mod assemble;
mod band;
mod complex;
mod crowd;
mod cut;
pub mod decide;
mod error;
pub mod features;
mod inside;
mod lattice;
mod measure;
mod mesher;
mod optimise;
mod options;
mod points;
mod refine;
mod second;
mod surface;

pub use adapt::{adapt, mean_edge, own_sizes};
pub use error::{MeshError, Warning};
pub use isoform_control::Control;
pub use mesher::{Meshed, mesh};
pub use options::{Options, Sizes};
