//! Task of a block: one step of one block, from files to files.

use super::BlocksError;
use super::certificate::{BlockFigures, figures};
use super::store::{read_plan, read_tetrahedra, write_faces, write_tetrahedra};
use crate::MeshModelOptions;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};
use isoform_io::{MeshWriteOptions, write_mesh_path};
use isoform_mesh::blocks::{self, BLOCK_MARGIN_SIZES, MergedTetrahedra, Plan, Tetrahedra, holds};
use isoform_mesh::{MeshError, Options, Warning};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// One step of one block. It can be sent to another process as JSON.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct BlockTask {
    pub(super) step: BlockStep,
    /// Index of the block or room, with the index in x running fastest.
    pub(super) block: usize,
    /// Rooms of the previous round that may hold tetrahedra for this one.
    pub(super) sources: Vec<usize>,
    /// Folder of the intermediate files.
    pub(super) folder: PathBuf,
    /// The .vtu file to write.
    pub(super) file: PathBuf,
}

/// Step of a block.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(super) enum BlockStep {
    /// Meshing of the block with a halo.
    Make {
        /// Number of cells of the halo.
        halo: usize,
    },
    /// Optimisation of the tetrahedra near the sides of earlier rounds.
    Mend {
        /// Number of the round, from 1.
        round: usize,
    },
    /// Writing and certification of the block.
    Close {
        /// Number of the round that left the tetrahedra near its sides.
        round: usize,
    },
}

/// Report of a task on its block.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct BlockReport {
    /// Index of the block, with the index in x running fastest.
    pub block: usize,
    /// Number of tetrahedra away from the sides.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) still: usize,
    /// Numbers of tetrahedra near the sides, before and after the step.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) live: [usize; 2],
    /// True if the halo cannot be larger.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) is_whole: bool,
    /// Places at which the mesh may differ from the request.
    pub warnings: Vec<BlockWarning>,
    /// Measures of the block; `None` until it is written.
    pub figures: Option<BlockFigures>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Warning with a place.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct BlockWarning {
    /// Description of the problem.
    pub message: String,
    /// Point at which it was met; `None` if it concerns the whole block.
    pub at: Option<Point3>,
}

impl BlockWarning {
    fn new(warning: &Warning) -> Self {
        Self {
            message: warning.kind.to_string(),
            at: warning.at,
        }
    }
}

/// Returns the name of the file of tetrahedra near the sides.
pub(super) fn live_file(folder: &Path, round: usize, block: usize) -> PathBuf {
    folder.join(format!("live-{round}-{block}"))
}
pub(super) fn faces_file(folder: &Path, block: usize) -> PathBuf {
    folder.join(format!("faces-{block}"))
}
pub(super) fn plan_file(folder: &Path) -> PathBuf {
    folder.join("plan")
}
fn still_file(folder: &Path, block: usize) -> PathBuf {
    folder.join(format!("still-{block}"))
}

/// Runs a task. `options` must be those of the job, with their size.
///
/// # Errors
/// [`BlocksError`] if the step fails, or on a stop. Files are written whole or not at all, so that
/// a task may be run again.
pub fn run_block_task(
    solid: &dyn Solid,
    options: &MeshModelOptions,
    task: &BlockTask,
    control: &Control<'_>,
) -> Result<BlockReport, BlocksError> {
    let plan = read_plan(&plan_file(&task.folder))?;
    let inner = Options {
        size: plan.size,
        ..options.mesh.clone()
    };
    let runner = TaskRunner {
        solid,
        plan,
        options,
        inner,
        task,
        control,
    };
    match task.step {
        BlockStep::Make { halo } => runner.make(halo),
        BlockStep::Mend { round } => runner.mend(round),
        BlockStep::Close { round } => runner.close(round),
    }
}

/// Data of a running task.
struct TaskRunner<'w> {
    solid: &'w dyn Solid,
    plan: Plan,
    options: &'w MeshModelOptions,
    inner: Options,
    task: &'w BlockTask,
    control: &'w Control<'w>,
}

impl TaskRunner<'_> {
    fn make(&self, halo: usize) -> Result<BlockReport, BlocksError> {
        let BlockTask { block, folder, .. } = self.task;
        let (plan, inner) = (&self.plan, &self.inner);
        let made = blocks::make(self.solid, plan, inner, *block, halo, self.control)?;
        write_tetrahedra(&still_file(folder, *block), &made.still)?;
        write_tetrahedra(&live_file(folder, 0, *block), &made.live)?;
        write_faces(&faces_file(folder, *block), &made.faces)?;
        Ok(BlockReport {
            block: *block,
            still: made.still.tets.len(),
            live: [0, made.live.tets.len()],
            is_whole: made.is_whole,
            warnings: made.warnings.iter().map(BlockWarning::new).collect(),
            figures: None,
        })
    }

    fn mend(&self, round: usize) -> Result<BlockReport, BlocksError> {
        let block = self.task.block;
        let given = self.gathered(self.plan.room(round, block), round - 1)?;
        let given = given.tetrahedra();
        let (plan, inner) = (&self.plan, &self.inner);
        let better = blocks::mend(self.solid, plan, inner, round, &given, self.control)?;
        write_tetrahedra(&live_file(&self.task.folder, round, block), &better)?;
        Ok(BlockReport {
            block,
            live: [given.tets.len(), better.tets.len()],
            ..BlockReport::default()
        })
    }

    fn close(&self, round: usize) -> Result<BlockReport, BlocksError> {
        let BlockTask { block, folder, .. } = self.task;
        let (plan, inner) = (&self.plan, &self.inner);
        let wide = self
            .plan
            .room(0, *block)
            .widened(BLOCK_MARGIN_SIZES * plan.size);
        let mut given = self.gathered(wide, round)?;
        let rest = read_tetrahedra(&still_file(folder, *block))?;
        given.add(&rest, |_| true);
        let given = given.tetrahedra();
        let closed = blocks::close(self.solid, plan, inner, *block, &given, self.control)?;
        write_faces(&faces_file(folder, *block), &closed.faces)?;
        let figures = figures(
            &closed,
            self.solid,
            plan,
            *block,
            self.options,
            self.control,
        );
        self.control.check().map_err(MeshError::from)?;
        let file = &self.task.file;
        write_mesh_path(
            &closed.mesh,
            file,
            Some("vtu"),
            &MeshWriteOptions::default(),
        )?;
        let name = file.file_name().unwrap_or_default();
        Ok(BlockReport {
            block: *block,
            warnings: closed.warnings.iter().map(BlockWarning::new).collect(),
            figures: Some(BlockFigures {
                file: name.to_string_lossy().into_owned(),
                ..figures
            }),
            ..BlockReport::default()
        })
    }

    /// Reads the tetrahedra near sides that a round left in a room.
    fn gathered(&self, room: Aabb, round: usize) -> Result<MergedTetrahedra, BlocksError> {
        let mut all = MergedTetrahedra::default();
        for &source in &self.task.sources {
            let more: Tetrahedra = read_tetrahedra(&live_file(&self.task.folder, round, source))?;
            all.add(&more, |c| holds(&room, c));
        }
        Ok(all)
    }
}
