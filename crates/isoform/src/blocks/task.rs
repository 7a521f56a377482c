//! One task: a step of one block, from files to files.

use super::BlocksError;
use super::certificate::{BlockFigures, figures};
use super::store::{read_plan, read_tetrahedra, write_faces, write_tetrahedra};
use crate::MeshModelOptions;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};
use isoform_io::{MeshWriteOptions, write_mesh_path};
use isoform_mesh::blocks::{self, BLOCK_MARGIN_SIZES, Gathered, Plan, Tetrahedra, holds};
use isoform_mesh::{MeshError, Options, Warning};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A step of one block. It can be sent to another process as JSON.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct BlockTask {
    pub(super) step: Step,
    /// The block or room, x fastest.
    pub(super) block: usize,
    /// Rooms of the round before that may hold tetrahedra for this one.
    pub(super) sources: Vec<usize>,
    /// The folder with the files between steps.
    pub(super) folder: PathBuf,
    /// The .vtu to write.
    pub(super) file: PathBuf,
}

/// What is done with a block.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(super) enum Step {
    /// It is made with a halo of so many cells.
    Make {
        /// The cells.
        halo: usize,
    },
    /// What is near the sides of earlier rounds is optimised.
    Mend {
        /// The round, from 1.
        round: usize,
    },
    /// It is written and certified.
    Close {
        /// The round that left the tetrahedra near its sides.
        round: usize,
    },
}

/// What a task says of its block.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct BlockReport {
    /// The block, x fastest.
    pub block: usize,
    /// Tetrahedra that are not near sides.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) still: usize,
    /// Tetrahedra near sides, before and after the step.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) live: [usize; 2],
    /// Whether no larger halo is possible.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(super) is_whole: bool,
    /// Places where the mesh may not be what was asked for.
    pub warnings: Vec<BlockWarning>,
    /// The figures of the block, once it is written.
    pub figures: Option<BlockFigures>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A warning with its place.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct BlockWarning {
    /// What is wrong.
    pub message: String,
    /// Where.
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

/// The files between steps.
pub(super) fn live(folder: &Path, round: usize, block: usize) -> PathBuf {
    folder.join(format!("live-{round}-{block}"))
}
pub(super) fn faces(folder: &Path, block: usize) -> PathBuf {
    folder.join(format!("faces-{block}"))
}
pub(super) fn plan(folder: &Path) -> PathBuf {
    folder.join("plan")
}
fn still(folder: &Path, block: usize) -> PathBuf {
    folder.join(format!("still-{block}"))
}

/// Does a task. `options` are those of the job, with their size.
///
/// # Errors
/// [`BlocksError`]. What is written is whole or not there, so that a task may be done again.
pub fn run_block_task(
    solid: &dyn Solid,
    options: &MeshModelOptions,
    task: &BlockTask,
    control: &Control<'_>,
) -> Result<BlockReport, BlocksError> {
    let plan = read_plan(&plan(&task.folder))?;
    let inner = Options {
        size: plan.size,
        ..options.mesh.clone()
    };
    let worker = Worker {
        solid,
        plan,
        options,
        inner,
        task,
        control,
    };
    match task.step {
        Step::Make { halo } => worker.make(halo),
        Step::Mend { round } => worker.mend(round),
        Step::Close { round } => worker.close(round),
    }
}

/// What a task works with.
struct Worker<'w> {
    solid: &'w dyn Solid,
    plan: Plan,
    options: &'w MeshModelOptions,
    inner: Options,
    task: &'w BlockTask,
    control: &'w Control<'w>,
}

impl Worker<'_> {
    fn make(&self, halo: usize) -> Result<BlockReport, BlocksError> {
        let BlockTask { block, folder, .. } = self.task;
        let (plan, inner) = (&self.plan, &self.inner);
        let made = blocks::make(self.solid, plan, inner, *block, halo, self.control)?;
        write_tetrahedra(&still(folder, *block), &made.still)?;
        write_tetrahedra(&live(folder, 0, *block), &made.live)?;
        write_faces(&faces(folder, *block), &made.faces)?;
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
        write_tetrahedra(&live(&self.task.folder, round, block), &better)?;
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
        let rest = read_tetrahedra(&still(folder, *block))?;
        given.add(&rest, |_| true);
        let given = given.tetrahedra();
        let closed = blocks::close(self.solid, plan, inner, *block, &given, self.control)?;
        write_faces(&faces(folder, *block), &closed.faces)?;
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

    /// The live tetrahedra that a round left in a room.
    fn gathered(&self, room: Aabb, round: usize) -> Result<Gathered, BlocksError> {
        let mut all = Gathered::default();
        for &source in &self.task.sources {
            let more: Tetrahedra = read_tetrahedra(&live(&self.task.folder, round, source))?;
            all.add(&more, |c| holds(&room, c));
        }
        Ok(all)
    }
}
