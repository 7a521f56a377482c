//! Labelled surface meshes and tetrahedra of any solid that names its pieces.
//!
//! [`mesh`] creates meshes, [`adapt`] improves a given one, [`features`] finds the edges, corners
//! and the box of a solid. Lengths are in model units; angles are in degrees where an option says
//! so and in radians otherwise. The certificate of isoform-check tells how good a mesh is.
//!
//! ```
//! use isoform_field::Pieces;
//! use isoform_field::hyperfun::{Mode, Model};
//! use isoform_mesh::{Control, Options, mesh};
//!
//! // The upper half of a ball: two parts that meet in a circle of radius 1.
//! let program = "half(x[3], a[1]) { half = (1 - x[1]^2 - x[2]^2 - x[3]^2) & x[3]; }";
//! let model = Model::parse(program, Mode::Default)?;
//! let solid = Pieces::of_model(&model, &vec![0.0; model.n_params()])?;
//!
//! let options = Options { size: 0.3, ..Options::default() };
//! let made = mesh(&solid, &options, &Control::default())?;
//! assert_eq!((made.mesh.parts.len(), made.mesh.curves.len()), (2, 1));
//! for edge in &made.mesh.edges {
//!     let [x, y, z] = made.mesh.points[edge[0] as usize];
//!     assert!((x.hypot(y) - 1.0).abs() < 1e-12 && z.abs() < 1e-12);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod adapt;
mod assemble;
mod band;
pub mod blocks;
mod complex;
mod crowd;
mod cut;
pub mod decide;
mod distance;
mod divided;
mod error;
pub mod features;
mod inside;
mod lattice;
mod layers;
mod measure;
mod memory;
mod mesher;
mod meshing;
mod names;
mod optimise;
mod options;
mod points;
mod refine;
mod regions;
mod second;
mod surface;
mod torn;
mod torus;
mod unit_cell;
mod unmeshed;

pub use adapt::{adapt, check_nodes, mean_edge, own_sizes};
pub use divided::{Region, RegionSolid};
pub use error::{MeshError, Warning, WarningKind};
pub use isoform_control::Control;
pub use mesher::Meshed;
pub use meshing::{mesh, mesh_regions};
pub use names::REST;
pub use options::{Layers, Options, Sizes};
pub use unmeshed::{UnmeshedSurface, Witness};
