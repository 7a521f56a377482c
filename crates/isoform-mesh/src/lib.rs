//! Labelled surface meshes and tetrahedra of any solid that can say its parts.
//!
//! [`mesh`] makes them, [`adapt`] improves a given one, [`features`] finds the edges,
//! corners and the box of a solid. Lengths are in model units, angles in degrees where an option
//! says so and in radians else. What a mesh is worth, the certificate of isoform-check tells.
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
mod divided;
mod error;
pub mod features;
mod inside;
mod lattice;
mod layers;
mod measure;
mod memory;
mod mesher;
mod missed;
mod optimise;
mod options;
mod points;
mod refine;
mod regions;
mod second;
mod surface;
mod torn;
mod torus;

pub use adapt::{adapt, check_nodes, mean_edge, own_sizes};
pub use divided::{Region, RegionSolid};
pub use error::{MeshError, Warning, WarningKind};
pub use isoform_control::Control;
pub use mesher::{Meshed, mesh, mesh_regions};
pub use missed::{Missed, Witness};
pub use options::{Layers, Options, Sizes};
pub use regions::REST;
