//! Meshes of huge models in blocks, in files: a .pvtu and one .vtu for each block.
//!
//! A [`BlocksJob`] knows which tasks there are to do, step by step; tasks of one step may be done
//! anywhere in any order, since each reads files of a folder that all share and writes its own.
//! [`mesh_in_blocks`] does them here, one after the other.

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

/// Why a model has no mesh in blocks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlocksError {
    /// There is no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshModelError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The name of the output does not end in .pvtu.
    #[error("{name}: a mesh in blocks is written as .pvtu")]
    Ending {
        /// The name.
        name: String,
    },
    /// There is no place for the files between the steps.
    #[error("cannot make a folder beside {name}: {why}")]
    Folder {
        /// The output.
        name: String,
        /// What the system says.
        why: String,
    },
    /// A file between two steps is not what was written.
    #[error("cannot read the file {file}: {why}")]
    Read {
        /// The file.
        file: String,
        /// What is wrong.
        why: String,
    },
}

impl From<MeshError> for BlocksError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error.into())
    }
}

/// Meshes a model in blocks, one after the other, and writes OUT.pvtu with a file for each block
/// beside it. The memory taken is that for one block.
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
/// [`BlocksError`].
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
