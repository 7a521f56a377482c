//! Making of a block: cut out of the lattice and optimised within its sides.

use super::faces::{OpenFace, open_faces};
use super::plan::Plan;
use super::tetrahedra::{INNER, MergedTetrahedra, Tetrahedra, centroid};
use super::{holds, on_open_faces, within};
use crate::band::{Band, Core};
use crate::error::{MeshError, Warning, WarningKind};
use crate::inside::Inside;
use crate::lattice::{Cells, Lattice};
use crate::mesher::{cut_along, refine};
use crate::optimise::Optimiser;
use crate::options::Options;
use crate::refine::Refiner;
use crate::surface::Surface;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Default number of cells around a block that are cut together with it. Snapping and cutting
/// process neighbours in the order of distances, and decisions depend on earlier ones: for an
/// industrial part and gyroids two cells made all faces match, one did not. A larger halo costs
/// time in proportion to its volume.
pub const DEFAULT_HALO_CELLS: usize = 4;

/// Result of the first step for a block.
#[derive(Clone, Debug, Default)]
pub struct BlockStart {
    /// Finished tetrahedra.
    pub still: Tetrahedra,
    /// Tetrahedra near the block's sides, which later rounds modify.
    pub live: Tetrahedra,
    /// Faces on the sides of the block.
    pub faces: Vec<OpenFace>,
    /// Places where the solid could not be resolved.
    pub warnings: Vec<Warning>,
    /// True if the halo covers the whole lattice, so that it cannot grow.
    pub is_whole: bool,
}

/// Makes block `k` of a plan, with a halo of `halo` cells.
///
/// # Errors
/// Those of [`mesh`](crate::mesh), except that a block may be empty.
pub fn make(
    solid: &dyn Solid,
    plan: &Plan,
    options: &Options,
    k: usize,
    halo: usize,
    control: &Control<'_>,
) -> Result<BlockStart, MeshError> {
    let room = plan.room(0, k);
    let cells = plan.cells(room, halo);
    let count: f64 = cells.iter().map(|c| (c[1] - c[0]) as f64).product();
    // The lattice takes twelve tetrahedra of sixty bytes per cell.
    options.check_memory((count * 720.0) as u64)?;
    within(solid, options, |solid| {
        control.begin("lattice")?;
        let lattice = Lattice::window(solid, plan.grid(), cells, control)?;
        control.check()?;
        let surface = Surface {
            by_place: true,
            apexes: plan.apexes.clone(),
            ..Surface::new(solid, &lattice, plan.region, control)
        };
        if let Some(at) = surface.not_a_number(|_| true) {
            return Err(MeshError::NotANumber { at });
        }
        let block = Block {
            plan,
            options,
            room,
            surface: &surface,
        };
        let (cut, warnings) = block.cut(cells)?;
        let all = block.optimised(cut)?;
        let [live, still] = all.parted(plan.unsettled(1));
        Ok(BlockStart {
            faces: open_faces(&all),
            still,
            live,
            warnings,
            is_whole: cells == plan.grid().all(),
        })
    })
}

/// A block being made.
struct Block<'b> {
    plan: &'b Plan,
    options: &'b Options,
    room: Aabb,
    surface: &'b Surface<'b>,
}

/// Modifiable part of a block, and its core.
struct Cut {
    inside: Inside,
    core: Tetrahedra,
}

impl Block<'_> {
    /// Cuts the lattice over `cells`, and keeps the tetrahedra of the room.
    fn cut(&self, cells: Cells) -> Result<(Cut, Vec<Warning>), MeshError> {
        let (surface, options, control) = (self.surface, self.options, self.surface.control);
        let graded = options.grade.is_some() || options.sizes.is_some();
        let band = Band::new(surface.lattice, true, graded, control);
        let core = core(&band.core, &band.complex.points);
        let mut refiner = Refiner {
            complex: band.complex,
            frozen: band.frozen,
            limit: options.most_tetrahedra(),
            control,
        };
        let crowd = self.plan.crowd(self.plan.box_of(cells));
        let mut warnings = refine(&mut refiner, surface, &[], &crowd, options)?;
        let mut cutter = cut_along(refiner, surface, &[], &mut Vec::new())?;
        let not_cut = cutter.undecided.iter().filter(|p| holds(&self.room, **p));
        let not_cut: Vec<Point3> = not_cut.copied().collect();
        warnings.retain(|w| w.at.is_none_or(|at| holds(&self.room, at)));
        if let Some(&at) = not_cut.first() {
            warnings.push(Warning::at(WarningKind::NotCut(not_cut.len()), at));
        }
        let inside = cutter.inside();
        let kept = cutter.admitted(|corners| holds(&self.room, centroid(corners)));
        let inside = cutter.finish(&inside, &kept);
        let stray = inside.stray.iter().copied();
        warnings.extend(Warning::each(WarningKind::StrayFace, stray));
        Ok((Cut { inside, core }, warnings))
    }

    /// Optimises the modifiable part, with fixed nodes on open faces. Those off the surface are
    /// projected in later rounds; the certificate reports the remaining ones.
    fn optimised(&self, cut: Cut) -> Result<Tetrahedra, MeshError> {
        let control = self.surface.control;
        let Cut { mut inside, core } = cut;
        let on_open = on_open_faces(&inside.complex);
        for (frozen, is_on_open) in inside.frozen.iter_mut().zip(on_open) {
            *frozen |= is_on_open;
        }
        control.begin("optimisation")?;
        let mut optimiser = Optimiser::new(self.surface, inside, self.options.size, control);
        optimiser.improve(self.options);
        control.check()?;
        let mut all = MergedTetrahedra::default();
        all.add(&Tetrahedra::from_complex(&optimiser.complex), |_| true);
        all.add(&core, |c| holds(&self.room, c));
        Ok(all.tetrahedra())
    }
}

/// Converts the core of a band whose vertices are at `band`; shared vertices stay in place.
fn core(core: &Core, band: &[Point3]) -> Tetrahedra {
    Tetrahedra {
        points: band.iter().chain(&core.points).copied().collect(),
        tets: core.tets.clone(),
        labels: vec![[INNER; 4]; core.tets.len()],
    }
}
