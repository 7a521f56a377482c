//! Steps of a mesh in blocks, and its final report.

use super::BlocksError;
use super::store::{read_faces, write_plan};
use super::task::{
    BlockReport, BlockStep, BlockTask, BlockWarning, faces_file, live_file, plan_file,
};
use crate::mesh_model::no_layers;
use crate::{MeshModelOptions, default_size_within};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};
use isoform_io::{process_id, write_pvtu};
use isoform_mesh::MeshError;
use isoform_mesh::blocks::{
    BLOCK_MARGIN_SIZES, BLOCK_ROUNDS, DEFAULT_HALO_CELLS, Interfaces, Plan,
};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Maximum number of times that the halo of blocks that do not match is doubled: to 64 cells. With
/// fewer, more jobs end with [`MeshError::Apart`]; each doubling meshes the blocks again.
const MAX_HALO_DOUBLINGS: u32 = 4;
/// Distance from its room, in sizes, at which tetrahedra of a round may lie. Nodes on the sides of
/// a room do not move, so that only tetrahedra at a side have their centroids beyond it. With less,
/// rooms may miss tetrahedra of their neighbours, which the job reports as an error; with more,
/// tasks read more files.
const MAX_OVERHANG_SIZES: f64 = 3.0;

/// Job that meshes a model in blocks, as steps of independent tasks.
///
/// ```no_run
/// use isoform::{BlocksJob, Control, MeshModelOptions, run_block_task, solid_of, template};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = template("sphere").expect("a template of the gallery").model();
/// let (solid, _) = solid_of(&model, &[0.0, 0.0, 0.0, 1.0])?;
/// let (options, control) = (MeshModelOptions::default(), Control::default());
/// let out = std::path::Path::new("ball.pvtu");
/// let mut job = BlocksJob::new(solid.as_ref(), [2, 2, 2], out, &options, &control)?;
/// let options = job.options().clone();
/// while !job.tasks().is_empty() {
///     // In any process, in parallel, in any order.
///     let done = job.tasks().into_iter();
///     let done = done.map(|t| run_block_task(solid.as_ref(), &options, &t, &control));
///     let reports = done.collect::<Result<Vec<_>, _>>()?;
///     job.advance(reports)?;
/// }
/// let report = job.finish()?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct BlocksJob {
    plan: Plan,
    options: MeshModelOptions,
    out: PathBuf,
    folder: TaskFolder,
    phase: JobPhase,
    /// Number of cells of each block's halo.
    halos: Vec<usize>,
    /// Last report of each block from each of its steps.
    made: Vec<BlockReport>,
    closed: Vec<BlockReport>,
    /// Last round whose tetrahedra are stored.
    round: usize,
    live: usize,
    interfaces: usize,
}

/// Next step of the job.
#[derive(Clone, Debug, PartialEq)]
enum JobPhase {
    /// Meshing of these blocks.
    Make(Vec<usize>),
    Mend,
    Close,
    Done,
}

/// Report of a mesh in blocks. Lengths are in model units, points are `[x, y, z]`.
#[derive(Clone, Debug, Serialize)]
pub struct BlocksReport {
    /// Name of the verb: `mesh`.
    pub verb: &'static str,
    /// Target length of edges.
    pub size: f64,
    /// Lower and upper corner of the box that was meshed.
    pub region: [Point3; 2],
    /// True if interval arithmetic proves that nothing of the solid lies outside of the box.
    pub region_certified: bool,
    /// True if interval arithmetic proves that all feature curves were found.
    pub features_certified: bool,
    /// Number of blocks per axis.
    pub counts: [usize; 3],
    /// Certificate of the whole mesh.
    pub certificate: WholeReport,
    /// Reports of the blocks, with the index in x running fastest.
    pub blocks: Vec<BlockReport>,
    /// Places at which the mesh may differ from the request.
    pub warnings: Vec<BlockWarning>,
}

/// Certificate of the whole mesh, combined from those of its blocks.
#[derive(Clone, Debug, Default, Serialize)]
pub struct WholeReport {
    /// True if every block passes its checks, neighbouring blocks match, and the share of the
    /// feature curves with edges is large enough.
    pub ok: bool,
    /// Number of faces shared by two blocks; their nodes are identical to the last bit.
    pub shared_faces: usize,
    /// Number of tetrahedra.
    pub tets: usize,
    /// Number of triangles of the surface.
    pub triangles: usize,
    /// Volume of the tetrahedra, in cubic units.
    pub volume: f64,
    /// Area of the surface, in square units.
    pub area: f64,
    /// Smallest and largest dihedral angle, in degrees; `None` without tetrahedra.
    pub dihedral_angles: Option<[f64; 2]>,
    /// Largest distance of a node of the surface from its part.
    pub node_distance: f64,
    /// Largest distance of a sample of a face from its part.
    pub face_distance: f64,
    /// Share of the length of the feature curves that has edges; 1 without curves.
    pub covered: f64,
    /// Number of defects, and of measures beyond their limits, in all blocks.
    pub failures: usize,
}

impl BlocksReport {
    /// Returns true if the certificate holds, without warnings.
    pub fn is_as_asked(&self) -> bool {
        self.certificate.ok && self.warnings.is_empty()
    }
}

impl BlocksJob {
    /// Plans the blocks of a solid. The file `out` must end in .pvtu; intermediate files lie in a
    /// hidden folder next to it, which is removed with the job.
    ///
    /// # Errors
    /// [`BlocksError`], for the reasons of [`Plan::new`], if the name of the file is wrong, or if
    /// the folder cannot be created.
    pub fn new(
        solid: &dyn Solid,
        counts: [usize; 3],
        out: &Path,
        options: &MeshModelOptions,
        control: &Control<'_>,
    ) -> Result<Self, BlocksError> {
        if !out
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("pvtu"))
        {
            let name = out.display().to_string();
            return Err(BlocksError::Ending { name });
        }
        no_layers(&options.mesh, "in blocks")?;
        let mut options = options.clone();
        options.mesh.size = match options.size {
            Some(size) => size,
            None => default_size_within(solid, &options.mesh, control).map_err(MeshError::from)?,
        };
        options.size = Some(options.mesh.size);
        let plan = Plan::new(solid, counts, &options.mesh, control)?;
        let out = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
        let folder = TaskFolder::next_to(&out)?;
        write_plan(&plan_file(&folder.0), &plan)?;
        let n = plan.blocks();
        Ok(Self {
            plan,
            options,
            out,
            folder,
            phase: JobPhase::Make((0..n).collect()),
            halos: vec![DEFAULT_HALO_CELLS; n],
            made: vec![BlockReport::default(); n],
            closed: Vec::new(),
            round: 0,
            live: 0,
            interfaces: 0,
        })
    }

    /// Returns the options, with the chosen size.
    pub fn options(&self) -> &MeshModelOptions {
        &self.options
    }

    /// Returns the name of the current step.
    pub fn step_name(&self) -> &'static str {
        match self.phase {
            JobPhase::Make(_) => "blocks",
            JobPhase::Mend => "between blocks",
            JobPhase::Close | JobPhase::Done => "certificates",
        }
    }

    /// Returns the tasks of the current step; none if the job is done.
    pub fn tasks(&self) -> Vec<BlockTask> {
        let all = 0..self.plan.blocks();
        match &self.phase {
            JobPhase::Make(blocks) => blocks
                .iter()
                .map(|&k| {
                    self.task(
                        k,
                        BlockStep::Make {
                            halo: self.halos[k],
                        },
                        Vec::new(),
                    )
                })
                .collect(),
            JobPhase::Mend => all.map(|k| self.mending(k)).collect(),
            JobPhase::Close => all.map(|k| self.closing(k)).collect(),
            JobPhase::Done => Vec::new(),
        }
    }

    fn mending(&self, k: usize) -> BlockTask {
        let round = self.round + 1;
        let sources = self.near(self.plan.room(round, k));
        self.task(k, BlockStep::Mend { round }, sources)
    }

    fn closing(&self, k: usize) -> BlockTask {
        let room = self
            .plan
            .room(0, k)
            .widened(BLOCK_MARGIN_SIZES * self.plan.size);
        self.task(k, BlockStep::Close { round: self.round }, self.near(room))
    }

    fn task(&self, block: usize, step: BlockStep, sources: Vec<usize>) -> BlockTask {
        BlockTask {
            step,
            block,
            sources,
            folder: self.folder.0.clone(),
            file: self.out.with_file_name(self.piece(block)),
        }
    }

    /// Returns the rooms of the last round whose tetrahedra may lie in a room.
    fn near(&self, room: Aabb) -> Vec<usize> {
        let wide = room.widened(MAX_OVERHANG_SIZES * self.plan.size);
        let meets = |k: &usize| {
            let other = self.plan.room(self.round, *k);
            (0..3).all(|i| other.lo[i] <= wide.hi[i] && wide.lo[i] <= other.hi[i])
        };
        (0..self.plan.blocks()).filter(meets).collect()
    }

    /// Returns the name of the file of a block.
    fn piece(&self, block: usize) -> String {
        let stem = self.out.file_stem().unwrap_or_default().to_string_lossy();
        format!("{stem}_{block}.vtu")
    }

    /// Takes the reports of all tasks of the step, in any order, and begins the next step.
    ///
    /// # Errors
    /// [`MeshError::Apart`] if blocks do not match with the largest halo; [`BlocksError::Read`] if
    /// files are missing.
    pub fn advance(&mut self, mut reports: Vec<BlockReport>) -> Result<(), BlocksError> {
        reports.sort_by_key(|r| r.block);
        match self.phase {
            JobPhase::Make(_) => self.compare(reports),
            JobPhase::Mend => self.settle(&reports),
            JobPhase::Close => self.conclude(reports),
            JobPhase::Done => Ok(()),
        }
    }

    /// Compares the faces of blocks that were meshed. Blocks that do not match their neighbours are
    /// meshed again, with a larger halo.
    fn compare(&mut self, reports: Vec<BlockReport>) -> Result<(), BlocksError> {
        for report in reports {
            let k = report.block;
            self.made[k] = report;
        }
        let apart = self.apart()?;
        if apart.is_empty() {
            self.live = self.made.iter().map(|r| r.live[1]).sum();
            self.phase = if self.live == 0 {
                JobPhase::Close
            } else {
                JobPhase::Mend
            };
            return Ok(());
        }
        let again: Vec<usize> = (0..self.plan.blocks())
            .filter(|&k| self.may_grow(k) && self.is_at(k, &apart))
            .collect();
        if again.is_empty() {
            let (count, at) = (apart.len(), apart[0]);
            return Err(MeshError::Apart { count, at }.into());
        }
        again
            .iter()
            .for_each(|&k| self.halos[k] = (2 * self.halos[k]).max(1));
        self.phase = JobPhase::Make(again);
        Ok(())
    }

    fn may_grow(&self, k: usize) -> bool {
        self.halos[k] < DEFAULT_HALO_CELLS << MAX_HALO_DOUBLINGS && !self.made[k].is_whole
    }

    /// Returns true if any of the places lies in a block or at its sides.
    fn is_at(&self, k: usize, places: &[Point3]) -> bool {
        let room = self.plan.room(0, k).widened(self.plan.size);
        let is_in = |p: &Point3| (0..3).all(|i| room.lo[i] <= p[i] && p[i] <= room.hi[i]);
        places.iter().any(is_in)
    }

    /// Returns the places of faces between blocks that only one of them has.
    fn apart(&mut self) -> Result<Vec<Point3>, BlocksError> {
        let mut between = Interfaces::default();
        for k in 0..self.plan.blocks() {
            between.add(&read_faces(&faces_file(&self.folder.0, k))?);
        }
        self.interfaces = between.pairs();
        Ok(between.apart())
    }

    /// Ends a round between blocks: every tetrahedron must have been in exactly one room.
    fn settle(&mut self, reports: &[BlockReport]) -> Result<(), BlocksError> {
        let [taken, left] = [0, 1].map(|i| reports.iter().map(|r| r.live[i]).sum::<usize>());
        if taken != self.live {
            return Err(lost(self.live, taken));
        }
        for k in 0..self.plan.blocks() {
            // Files that cannot be removed now are removed with the folder.
            let _ = std::fs::remove_file(live_file(&self.folder.0, self.round, k));
        }
        self.live = left;
        self.round += 1;
        if self.round + 1 == BLOCK_ROUNDS {
            self.phase = JobPhase::Close;
        }
        Ok(())
    }

    /// Compares the faces of the written blocks, and writes the file that joins them.
    fn conclude(&mut self, reports: Vec<BlockReport>) -> Result<(), BlocksError> {
        let apart = self.apart()?;
        if let Some(&at) = apart.first() {
            let count = apart.len();
            return Err(MeshError::Apart { count, at }.into());
        }
        let there = self.live + self.made.iter().map(|r| r.still).sum::<usize>();
        let figures = reports.iter().filter_map(|r| r.figures.as_ref());
        let written = figures.map(|f| f.tets).sum();
        if there != written {
            return Err(lost(there, written));
        }
        if written == 0 {
            let size = self.plan.size;
            return Err(MeshError::TooCoarse { size }.into());
        }
        let pieces: Vec<String> = (0..self.plan.blocks()).map(|k| self.piece(k)).collect();
        write_pvtu(&self.out, &pieces)?;
        self.closed = reports;
        self.phase = JobPhase::Done;
        Ok(())
    }

    /// Returns the report of a job whose steps are all done.
    ///
    /// # Errors
    /// [`MeshError::Stopped`] if steps are left.
    pub fn finish(self) -> Result<BlocksReport, BlocksError> {
        if self.phase != JobPhase::Done {
            return Err(MeshError::Stopped.into());
        }
        let all = self.made.iter().chain(&self.closed);
        let warnings: Vec<BlockWarning> = all.flat_map(|r| r.warnings.clone()).collect();
        Ok(BlocksReport {
            verb: "mesh",
            size: self.plan.size,
            region: [self.plan.region.lo, self.plan.region.hi],
            region_certified: self.plan.region_certified,
            features_certified: self.plan.features_certified,
            counts: self.plan.counts,
            certificate: WholeReport {
                shared_faces: self.interfaces,
                ..WholeReport::from_blocks(&self.closed, self.options.limits.covered)
            },
            blocks: self.closed,
            warnings,
        })
    }
}

impl WholeReport {
    /// Combines the figures of all blocks; `least_covered` is the minimum share of the feature
    /// curves with edges.
    fn from_blocks(blocks: &[BlockReport], least_covered: f64) -> Self {
        let mut whole = Self::default();
        let mut curves = [0.0; 2];
        for f in blocks.iter().filter_map(|b| b.figures.as_ref()) {
            whole.tets += f.tets;
            whole.triangles += f.triangles;
            whole.volume += f.volume;
            whole.area += f.area;
            whole.node_distance = whole.node_distance.max(f.node_distance);
            whole.face_distance = whole.face_distance.max(f.face_distance);
            curves = [0, 1].map(|i| curves[i] + f.curves[i]);
            whole.failures += f.failures.iter().map(|f| f.count).sum::<usize>();
            if let Some([lo, hi]) = f.dihedral_angles {
                let [least, most] = whole.dihedral_angles.unwrap_or([lo, hi]);
                whole.dihedral_angles = Some([least.min(lo), most.max(hi)]);
            }
        }
        whole.covered = if curves[0] > 0.0 {
            curves[1] / curves[0]
        } else {
            1.0
        };
        whole.ok = whole.failures == 0 && whole.covered >= least_covered;
        whole
    }
}

/// Returns the error of tetrahedra that are in no room, or in two.
fn lost(there: usize, found: usize) -> BlocksError {
    let what = format!("of {there} tetrahedra {found} were found in blocks");
    MeshError::Internal { what }.into()
}

/// Folder of intermediate files, which is removed when dropped.
#[derive(Debug)]
struct TaskFolder(PathBuf);

impl TaskFolder {
    /// Creates a new, hidden folder next to a file.
    fn next_to(out: &Path) -> Result<Self, BlocksError> {
        /// Number of folders that this process has named.
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let name = out.file_name().unwrap_or_default().to_string_lossy();
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!(".{name}.{}-{number}.blocks", process_id());
        let path = out.with_file_name(name);
        let made = std::fs::create_dir(&path).map(|()| path);
        made.map(Self).map_err(|e| BlocksError::Folder {
            name: out.display().to_string(),
            why: e.to_string(),
        })
    }
}

impl Drop for TaskFolder {
    fn drop(&mut self) {
        // A folder that cannot be removed does no harm.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{run_block_task, solid_of};
    use isoform_field::hyperfun::{Mode, Model};

    /// Runs the tasks of one step.
    fn step(job: &mut BlocksJob, solid: &dyn Solid) -> Result<(), BlocksError> {
        let options = job.options().clone();
        let tasks = job.tasks();
        let done = tasks
            .iter()
            .map(|t| run_block_task(solid, &options, t, &Control::default()));
        let reports = done.collect::<Result<Vec<_>, _>>()?;
        job.advance(reports)
    }

    /// Blocks with too small a halo do not match at an interface and are meshed again; if no larger
    /// halo is allowed, that is an error, and no files remain.
    #[test]
    fn blocks_that_do_not_meet_are_made_again() {
        let program = "m(x[3], a[1]) { m = (4 - x[1]^2) & (1 - x[2]^2) & (1 - x[3]^2) \
            & (x[1]^2 + x[2]^2 - 0.3); }";
        let model = Model::parse(program, Mode::Default).expect("a program");
        let (solid, _) = solid_of(&model, &[0.0]).expect("a solid");
        let folder = std::env::temp_dir().join(format!("isoform-job-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let options = MeshModelOptions {
            size: Some(0.12),
            ..MeshModelOptions::default()
        };
        let new = || {
            let out = folder.join("m.pvtu");
            let control = Control::default();
            let mut job =
                BlocksJob::new(solid.as_ref(), [3, 1, 1], &out, &options, &control).expect("a job");
            job.halos = vec![1, 0, DEFAULT_HALO_CELLS];
            job
        };
        let mut job = new();
        step(&mut job, solid.as_ref()).expect("blocks");
        let JobPhase::Make(again) = job.phase.clone() else {
            panic!("the halo was wide enough")
        };
        assert!(again.contains(&1));
        while !job.tasks().is_empty() {
            step(&mut job, solid.as_ref()).expect("blocks that meet");
        }
        let report = job.finish().expect("a mesh");
        assert!(report.is_as_asked() && report.certificate.shared_faces > 0);

        let mut job = new();
        let tasks = job.tasks();
        let made = tasks.iter().map(|t| {
            let control = Control::default();
            let report = run_block_task(solid.as_ref(), &options, t, &control).expect("a block");
            BlockReport {
                is_whole: true,
                ..report
            }
        });
        let error = job.advance(made.collect()).expect_err("apart");
        assert!(error.to_string().contains("have no partner"), "{error}");
        drop(job);
        let left = std::fs::read_dir(&folder).expect("the folder").flatten();
        let hidden = left.filter(|f| f.file_name().to_string_lossy().starts_with('.'));
        assert_eq!(hidden.count(), 0);
        std::fs::remove_dir_all(&folder).expect("the folder");
    }
}
