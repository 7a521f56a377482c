//! Meshes of huge models in blocks, written to files: one .pvtu and a .vtu for each block.
//!
//! A [`BlocksJob`] lists the tasks of one step after another. The tasks of a step may be run in any
//! process and in any order, since each reads files of a shared folder and writes its own.
//! [`mesh_in_blocks`] runs all of them in this process.

mod certificate;
mod job;
mod store;
mod task;

pub use certificate::{BlockFailure, BlockFigures};
pub use job::{BlocksJob, BlocksReport, WholeReport};
pub use task::{BlockReport, BlockTask, BlockWarning, run_block_task};

use crate::meshing::meshable;
use crate::{MeshModelError, MeshModelOptions};
use isoform_control::Control;
use isoform_field::hyperfun::Model;
use isoform_io::WriteError;
use isoform_mesh::MeshError;
use std::path::Path;

/// Reason why a model cannot be meshed in blocks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlocksError {
    /// The mesh cannot be computed.
    #[error(transparent)]
    Mesh(#[from] MeshModelError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The name of the output does not end in .pvtu.
    #[error("{name}: a mesh in blocks is written as .pvtu")]
    Ending {
        /// Name of the output.
        name: String,
    },
    /// The folder for intermediate files cannot be created.
    #[error("cannot make a folder beside {name}: {why}")]
    Folder {
        /// Name of the output.
        name: String,
        /// Error of the system.
        why: String,
    },
    /// An intermediate file cannot be read, or is not what a task wrote.
    #[error("cannot read the file {file}: {why}")]
    Read {
        /// Name of the file.
        file: String,
        /// Description of the error.
        why: String,
    },
}

impl From<MeshError> for BlocksError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error.into())
    }
}

/// Meshes a model with the values `a` of its parameters in `counts` blocks per axis, one after the
/// other; writes the .pvtu file `out` and a .vtu file for each block next to it. Memory is needed
/// for one block at a time.
///
/// ```
/// use isoform::{Control, MeshModelOptions, mesh_in_blocks, template};
/// # let folder = std::env::temp_dir().join(format!("isoform-blocks-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let options = MeshModelOptions { size: Some(0.2), ..MeshModelOptions::default() };
/// let out = folder.join("ball.pvtu");
/// let values = [0.0, 0.0, 0.0, 1.0];
/// let report = mesh_in_blocks(&ball, &values, [2, 1, 1], &out, &options, &Control::default())?;
/// assert!(report.is_as_asked() && out.exists());
/// assert!((report.certificate.volume / 4.18879 - 1.0).abs() < 0.03);
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`BlocksError`] if the mesh cannot be computed, or a file cannot be written.
pub fn mesh_in_blocks(
    model: &Model,
    a: &[f64],
    counts: [usize; 3],
    out: &Path,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<BlocksReport, BlocksError> {
    let found = meshable(model, a, options.mesh.region, None, control)?;
    let solid = found.solid.as_ref();
    let mut job = BlocksJob::new(solid, counts, out, options, control)?;
    let options = job.options().clone();
    loop {
        let tasks = job.tasks();
        if tasks.is_empty() {
            return job.finish();
        }
        let (step, count) = (job.step_name(), tasks.len());
        let mut reports = Vec::new();
        for (k, task) in tasks.iter().enumerate() {
            control.report(step, k as f64 / count as f64);
            control.check().map_err(MeshError::from)?;
            let quiet = Control {
                progress: None,
                ..*control
            };
            reports.push(run_block_task(solid, &options, task, &quiet)?);
        }
        job.advance(reports)?;
    }
}
