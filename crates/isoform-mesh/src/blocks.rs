//! Meshes of models that are too large for one mesh: block by block, each in its own memory.
//!
//! All blocks share one lattice, that of the whole model, so that common data are identical bit for
//! bit. A [`Plan`] holds it, with other data of the whole model: the box and the features. Then
//!
//! 1. [`make`] cuts each block out of the lattice together with a *halo* of cells around it, keeps
//!    the tetrahedra whose centroids lie in its room, and optimises them while the nodes on its
//!    sides are fixed;
//! 2. [`Interfaces`] compares the faces on both sides of each interface. Cutting decides by nearby
//!    data, so that they match; if a chain of decisions was longer than the halo they differ, and
//!    the blocks concerned are made again with a larger halo;
//! 3. [`mend`] optimises tetrahedra near the sides again, in rooms with sides at other places: in
//!    three further rounds, so that every node was inside a room at least once;
//! 4. [`close`] assembles the labelled mesh of each block, with its surroundings for a certificate.
//!
//! ```text
//!      round 0            rounds 1, 2, 3: the rooms moved by parts of a block
//!    +-----+-----+        +--+-----+--+
//!    |     |     |        |  |     |  |      Only tetrahedra that lie near sides of all the
//!    |     |     |        |  |     |  |      rounds before are worked on: in round 1 those in
//!    +-----+-----+   -->  +--+-----+--+      slabs, in round 2 in strips where slabs cross, in
//!    |     |     |        |  |     |  |      round 3 in spots.
//!    +-----+-----+        +--+-----+--+
//! ```
//!
//! Optimising a set of tetrahedra keeps its boundary inside the solid, so that steps 3 and 4
//! preserve the matching. After each step a block is a value without history: all workers compute
//! equal bits.
//!
//! ```
//! use isoform_field::Pieces;
//! use isoform_field::hyperfun::{Mode, Model};
//! use isoform_mesh::blocks::{MergedTetrahedra, DEFAULT_HALO_CELLS, Interfaces, Plan, close, make};
//! use isoform_mesh::{Control, Options};
//!
//! let program = "ball(x[3], a[1]) { ball = 1 - x[1]^2 - x[2]^2 - x[3]^2; }";
//! let model = Model::parse(program, Mode::Default)?;
//! let solid = Pieces::of_model(&model, &vec![0.0; model.n_params()])?;
//! let (options, control) = (Options { size: 0.2, ..Options::default() }, Control::default());
//!
//! let plan = Plan::new(&solid, [2, 1, 1], &options, &control)?;
//! let mut between = Interfaces::default();
//! let mut all = MergedTetrahedra::default();
//! for k in 0..plan.blocks() {
//!     let made = make(&solid, &plan, &options, k, DEFAULT_HALO_CELLS, &control)?;
//!     between.add(&made.faces);
//!     all.add(&made.still, |_| true);
//!     all.add(&made.live, |_| true);
//! }
//! assert!(between.apart().is_empty() && between.pairs() > 0);
//! let half = close(&solid, &plan, &options, 0, &all.tetrahedra(), &control)?;
//! assert!(half.mesh.tets.len() < half.around.tets.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod closing;
mod faces;
mod making;
mod mending;
mod plan;
mod tetrahedra;

pub use closing::{BlockMesh, close};
pub use faces::{Interfaces, OpenFace, open_faces};
pub use making::{BlockStart, DEFAULT_HALO_CELLS, make};
pub use mending::mend;
pub use plan::{BLOCK_ROUNDS, Plan, PlannedCurve};
pub use tetrahedra::{INNER, MergedTetrahedra, Tetrahedra};

use crate::complex::{Complex, OPEN};
use crate::options::Options;
use isoform_check::Capped;
use isoform_geom::{Aabb, Point3, Solid};

/// Margin around a block's room whose elements are included when it is closed, in sizes: more than
/// the extent of an element.
pub const BLOCK_MARGIN_SIZES: f64 = 2.0;

/// Returns true if a room contains a point; its lower sides belong to it.
pub fn holds(room: &Aabb, p: Point3) -> bool {
    (0..3).all(|i| room.lo[i] <= p[i] && p[i] < room.hi[i])
}

/// Calls `work` with the solid, clipped at the requested box, if any.
fn within<T>(solid: &dyn Solid, options: &Options, work: impl FnOnce(&dyn Solid) -> T) -> T {
    match options.region {
        Some(region) => work(&Capped::new(solid, region)),
        None => work(solid),
    }
}

/// Marks the vertices on open faces.
fn on_open_faces(complex: &Complex) -> Vec<bool> {
    let mut on_open = vec![false; complex.points.len()];
    for t in complex.live() {
        for i in (0..4).filter(|&i| complex.adjacent[t as usize][i] == OPEN) {
            for v in complex.face(t, i) {
                on_open[v as usize] = true;
            }
        }
    }
    on_open
}
