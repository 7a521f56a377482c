//! Settings of a mesh as the user gives them.

use crate::arguments;
use isoform::geom::Aabb;
use isoform::mesh::Layers;
use std::path::PathBuf;

/// Settings of meshing, shared with `recover`.
#[derive(clap::Args, Clone, Debug, Default)]
#[group(id = "MeshSettings")]
pub(crate) struct Settings {
    /// Length of edges, the largest one where sizes vary [default: a fortieth of the diagonal]
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    pub(crate) size: Option<f64>,
    /// Smaller edges where a face would leave the surface by more than this
    #[arg(
        long, value_name = "LENGTH",
        allow_negative_numbers = true,
        value_parser = arguments::positive
    )]
    pub(crate) grade: Option<f64>,
    /// Smaller edges by place: a table x,y,z,length (of a refinement, or from an error estimate),
    /// or a HyperFun program of the length
    #[arg(long, value_name = "FILE")]
    pub(crate) sizes: Option<PathBuf>,
    /// 2 for elements with nodes in the middles of their edges, on the true surface
    #[arg(long, value_name = "1|2", value_parser = clap::value_parser!(u32).range(1..=2))]
    pub(crate) order: Option<u32>,
    /// Only the surface, as triangles
    #[arg(long)]
    pub(crate) surface_only: bool,
    /// Mesh what lies in this box: x,y,z of the lower and of the upper corner; the cuts are parts
    /// named cap.x_min ...
    #[arg(long = "box", value_name = "NUMBERS", allow_hyphen_values = true, value_parser = arguments::region)]
    pub(crate) region: Option<Aabb>,
    /// Bounds of the dihedral angles, degrees: worked towards, and required in the certificate
    /// [default: 21,149, not required]
    #[arg(long, value_name = "MIN,MAX", value_parser = angles)]
    pub(crate) angles: Option<Angles>,
    /// Refuse a mesh that takes more memory than this many GiB, by estimate [default: 16, or what
    /// the machine has]
    #[arg(long, value_name = "GIB", allow_negative_numbers = true, value_parser = arguments::positive)]
    pub(crate) memory: Option<f64>,
    /// The box in which the solid is sought first.
    #[arg(skip)]
    pub(crate) start: Option<Aabb>,
    /// The axes along which the box is a unit cell.
    #[arg(skip)]
    pub(crate) periodic: [bool; 3],
    /// Layers of wedges along parts of the surface.
    #[arg(skip)]
    pub(crate) layers: Option<Layers>,
}

/// Smallest and largest angle, degrees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Angles(pub(crate) [f64; 2]);

/// Reads the two angles of --angles.
fn angles(text: &str) -> Result<Angles, String> {
    match arguments::numbers(text)?.as_slice() {
        // A regular tetrahedron has 70.5 degrees.
        &[min, max] if (0.0..=70.0).contains(&min) && (71.0..=180.0).contains(&max) => {
            Ok(Angles([min, max]))
        }
        _ => Err(
            "two angles are expected, one of at most 70 and one of at least 71 degrees".to_owned(),
        ),
    }
}
