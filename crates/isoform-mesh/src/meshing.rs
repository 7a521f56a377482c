//! Entry points of the mesher: meshing of a solid in its own box or in a given one, in regions,
//! with layers, and as a unit cell.

use crate::divided::Region;
use crate::error::{MeshError, Warning, WarningKind};
use crate::features::{Extent, extent_within};
use crate::layers::mesh_layered;
use crate::mesher::{Meshed, Model, mesh_within, with_caps};
use crate::names::{AXES, REST};
use crate::options::Options;
use crate::surface::MAX_DIVIDED_LAYERS;
use crate::torus::Torus;
use crate::unit_cell::{Misfit, PeriodicSolid, apart, largest_size, misfit, side_samples};
use isoform_check::Capped;
use isoform_control::Control;
use isoform_geom::{Aabb, Solid};

/// Meshes a solid: tetrahedra with the labelled surface, or the surface alone.
///
/// # Errors
/// If the solid is empty, unbounded or not a number, if an option has no meaning, the memory does
/// not suffice, or on a stop.
pub fn mesh(
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    mesh_regions(solid, &[], options, control)
}

/// Meshes a solid in several regions: each takes the part of the solid that lies in its own solid
/// and in no region before it; the remainder is one more region, called `rest`. Tetrahedra of two
/// regions share the nodes of the faces between them. These faces are triangles of the mesh, too,
/// outward of the region that comes first, on the parts of its solid.
///
/// # Errors
/// Those of [`mesh`], and if two regions have equal names up to case, or one is called like the
/// rest, if there are more than 999 regions, or if `options` request the surface alone.
pub fn mesh_regions(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    options.check()?;
    check_regions(regions, options)?;
    control.begin("extent")?;
    if let Some(layers) = &options.layers {
        return match regions.is_empty() {
            true => mesh_layered(solid, layers, options, control),
            false => Err(MeshError::NoLayers { what: "in regions" }),
        };
    }
    if let Some(region) = options.region.filter(|_| options.periodic.contains(&true)) {
        return mesh_cell(solid, regions, region, options, control);
    }
    if let Some(region) = options.region {
        let capped = Capped::new(solid, region);
        let extent = extent_within(&capped, region, options.size, control)?;
        let meshed = mesh_within(
            Model::new(&capped, regions),
            None,
            &extent,
            options,
            control,
        )?;
        Ok(with_caps(meshed))
    } else {
        let extent = extent_within(solid, options.start, options.size, control)?;
        mesh_within(Model::new(solid, regions), None, &extent, options, control)
    }
}

/// Meshes a unit cell.
fn mesh_cell(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    region: Aabb,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    let torus = Torus::new(region, options.periodic);
    let capped = Capped::new(solid, region);
    let ends = Capped::across(solid, region, options.periodic.map(|repeats| !repeats));
    let whole = PeriodicSolid::new(&ends, torus);
    let wrapped = regions.iter().map(|r| PeriodicSolid::new(r.solid, torus));
    let wrapped: Vec<PeriodicSolid<'_>> = wrapped.collect();
    let divide = regions.iter().zip(&wrapped);
    let divide = divide.map(|(r, solid)| Region {
        name: r.name,
        solid,
    });
    let divide: Vec<Region<'_>> = divide.collect();
    let options = &Options {
        size: options.size.min(largest_size(&torus)),
        ..options.clone()
    };
    let extent = extent_within(&capped, region, options.size, control)?;
    let places = side_samples(&torus, options.size);
    let all = regions.iter().map(|r| (r.name, r.solid));
    for (name, solid) in std::iter::once(("", &ends as &dyn Solid)).chain(all) {
        if let Some((misfit, axis, at)) = misfit(solid, &torus, &places) {
            let axis = AXES[axis];
            let region = name.to_owned();
            return Err(match misfit {
                Misfit::Differs => MeshError::NotPeriodic { axis, at, region },
                Misfit::InSide => MeshError::InSide { axis, at, region },
            });
        }
    }
    let extent = Extent {
        bounds: region,
        ..extent
    };
    let model = Model {
        solid: &whole,
        regions: &divide,
        target: (&capped, regions),
    };
    let mut meshed = mesh_within(model, Some(torus), &extent, options, control)?;
    let solids = std::iter::once(&ends as &dyn Solid).chain(regions.iter().map(|r| r.solid));
    for (axis, at, by) in solids.flat_map(|solid| apart(solid, &torus, &meshed.mesh)) {
        let axis = AXES[axis];
        meshed
            .warnings
            .push(Warning::at(WarningKind::SidesApart { axis, by }, at));
    }
    Ok(with_caps(meshed))
}

/// Checks that a solid can be divided into these regions.
fn check_regions(regions: &[Region<'_>], options: &Options) -> Result<(), MeshError> {
    for (k, region) in regions.iter().enumerate() {
        let before = regions[..k].iter().map(|r| r.name);
        if before
            .chain([REST])
            .any(|name| name.eq_ignore_ascii_case(region.name))
        {
            let name = region.name.to_owned();
            return Err(MeshError::RegionName { name });
        }
    }
    let (wanted, value) = match regions.len() {
        0 => return Ok(()),
        n if n >= MAX_DIVIDED_LAYERS => ("fewer than 1000", n as f64),
        n if options.surface_only => ("none with the surface alone", n as f64),
        _ => return Ok(()),
    };
    let name = "regions";
    Err(MeshError::Option {
        name,
        wanted,
        value,
    })
}
