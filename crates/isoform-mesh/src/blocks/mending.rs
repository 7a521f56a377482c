//! Mending: tetrahedra near the sides of blocks are optimised again, within other sides.

use super::plan::Plan;
use super::tetrahedra::{MergedTetrahedra, Tetrahedra};
use super::{on_open_faces, within};
use crate::error::MeshError;
use crate::inside::Inside;
use crate::lattice::Lattice;
use crate::optimise::Optimiser;
use crate::options::Options;
use crate::surface::Surface;
use isoform_control::Control;
use isoform_geom::{Aabb, Solid};

/// Optimises the tetrahedra of a room that lie near sides of all earlier rounds; `round` starts at
/// 1. `given` are all unfinished ones of the room.
///
/// # Errors
/// [`MeshError::Stopped`]; [`MeshError::Internal`] if the given tetrahedra are not parts of one
/// mesh.
/// [`MeshError::Stopped`]; [`MeshError::Internal`] if what is given is not part of one mesh.
pub fn mend(
    solid: &dyn Solid,
    plan: &Plan,
    options: &Options,
    round: usize,
    given: &Tetrahedra,
    control: &Control<'_>,
) -> Result<Tetrahedra, MeshError> {
    let [poor, rest] = given.parted(plan.unsettled(round));
    let mut all = MergedTetrahedra::default();
    if !poor.tets.is_empty() {
        let better = within(solid, options, |solid| {
            optimised(solid, plan, options, poor, control)
        })?;
        all.add(&better, |_| true);
    }
    all.add(&rest, |_| true);
    Ok(all.tetrahedra())
}

fn optimised(
    solid: &dyn Solid,
    plan: &Plan,
    options: &Options,
    given: Tetrahedra,
    control: &Control<'_>,
) -> Result<Tetrahedra, MeshError> {
    control.begin("lattice")?;
    // Cells of the lattice around the tetrahedra in which their vertices may be projected.
    let cells = plan.cells(Aabb::from_points(&given.points), 3);
    let lattice = Lattice::window(solid, plan.grid(), cells, control)?;
    control.check()?;
    let surface = Surface {
        apexes: plan.apexes.clone(),
        ..Surface::new(solid, &lattice, plan.region, control)
    };
    let Some(mut complex) = given.complex(control) else {
        let what = "blocks overlap: a face of the surface has tetrahedra on both sides".to_owned();
        return Err(MeshError::Internal { what });
    };
    control.check()?;
    let mut frozen = on_open_faces(&complex);
    for v in complex.separate() {
        frozen.push(frozen[v as usize]);
    }
    let inside = Inside {
        complex,
        frozen,
        number: Vec::new(),
        stray: Vec::new(),
    };
    control.begin("optimisation")?;
    let mut optimiser = Optimiser::new(&surface, inside, options.size, control);
    optimiser.improve(options);
    control.check()?;
    Ok(Tetrahedra::from_complex(&optimiser.complex))
}
