//! Layers of wedges along parts of the surface.
//!
//! The *core*, the solid without its layers, is meshed like any solid: pieces with layers are moved
//! inward by the thickness of the layers. The triangles of the core on these pieces are then
//! projected outward onto the pieces themselves, and the gap is filled with wedges between each
//! triangle and its image: tetrahedra are not squeezed, and edges and corners of the core become
//! those of the solid. Where a piece with layers meets one without, the *columns* of nodes stand on
//! the latter, and their sides are quadrilaterals of it.

mod core;
mod grow;

use self::core::Core;
use crate::distance::distance_at;
use crate::error::{MeshError, Warning, WarningKind};
use crate::features::{Extent, extent_within};
use crate::mesher::{Meshed, Model, features_of, mesh_within, with_caps};
use crate::options::{Layers, Options};
use crate::torn::torn;
use crate::unmeshed::find_unmeshed;
use grow::grow;
use isoform_check::Capped;
use isoform_control::Control;
use isoform_geom::{Aabb, Solid};

/// Meshes a solid with layers of wedges along parts of its surface.
pub(crate) fn mesh_layered(
    solid: &dyn Solid,
    layers: &Layers,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    let capped = options.region.map(|region| Capped::new(solid, region));
    let solid = capped.as_ref().map_or(solid, |capped| capped);
    let start = options.region.unwrap_or(options.start);
    let extent = extent_within(solid, start, options.size, control)?;
    let region = extent.bounds;
    check_thickness(layers, region)?;
    let layered = layered(solid, &parts_of(solid, &extent, options, control)?, layers)?;
    let core = Core::new(solid, &layered, layers.thickness(), region)?;
    let made = mesh_within(Model::new(&core, &[]), None, &extent, options, control);
    let mut meshed = made.map_err(|error| match error {
        MeshError::TooCoarse { .. } => MeshError::NoRoom {
            thickness: layers.thickness(),
            at: None,
        },
        error => error,
    })?;
    control.begin("layers")?;
    let grown = grow(&meshed.mesh, solid, &layered, layers, region)?;
    meshed.mesh = grown.mesh;
    if let Some((thickness, at)) = grown.thinnest {
        let share = thickness / layers.thickness();
        // There is room for less than half of the layers.
        if share < 0.5 {
            let (thickness, at) = (layers.thickness(), Some(at));
            return Err(MeshError::NoRoom { thickness, at });
        }
        // Smaller deviations are normal: offsets of a surface with a radius ten times the thickness
        // are 5 % off.
        if share < 0.9 {
            let kind = WarningKind::ThinLayers { thickness };
            meshed.warnings.push(Warning::at(kind, at));
        }
    }
    meshed.features = features_of(solid, region, options, control);
    control.begin("what the mesh misses")?;
    let simplices = meshed.mesh.simplices();
    meshed.missed = find_unmeshed(solid, &simplices, region, options.size, control);
    let apart = torn(|p| distance_at(solid, p), &simplices, options.size, control);
    let missed = meshed.missed.places().next();
    let missed = missed.map(|at| Warning::at(WarningKind::MissedByLayers, at));
    meshed.warnings.extend(missed);
    meshed
        .warnings
        .extend(Warning::each(WarningKind::Torn, apart));
    Ok(with_caps(meshed))
}

/// Checks that layers are thick enough for the rounding of coordinates, and thinner than the
/// solid's box.
fn check_thickness(layers: &Layers, region: Aabb) -> Result<(), MeshError> {
    let corners = region.lo.into_iter().chain(region.hi);
    let largest = corners.fold(0.0, |most: f64, x| most.max(x.abs()));
    let last = layers.first * layers.growth.powi(layers.count as i32 - 1);
    // Rounding, 1e-16 of the largest coordinate, leaves less than four digits of thinner layers.
    if layers.first.min(last) < 1e-12 * largest {
        return Err(MeshError::Option {
            name: "layers' thickness",
            wanted: "above the rounding of coordinates, 1e-12 of the largest",
            value: layers.first.min(last),
        });
    }
    let longest = region.size().into_iter().fold(0.0, f64::max);
    let thickness = layers.thickness();
    match thickness < longest {
        true => Ok(()),
        false => Err(MeshError::NoRoom {
            thickness,
            at: None,
        }),
    }
}

/// Returns the parts of a solid's surface, as far as coarse triangles show them; pieces hidden in a
/// union are excluded.
fn parts_of(
    solid: &dyn Solid,
    extent: &Extent,
    options: &Options,
    control: &Control<'_>,
) -> Result<Vec<String>, MeshError> {
    let coarse = Options {
        // A coarse mesh, with a ninth of the triangles, suffices to tell the parts of the surface.
        size: 3.0 * options.size,
        surface_only: true,
        region: options.region,
        memory: options.memory,
        ..Options::default()
    };
    let quiet = Control {
        progress: None,
        ..*control
    };
    let made = mesh_within(Model::new(solid, &[]), None, extent, &coarse, &quiet);
    control.check()?;
    Ok(match made {
        Ok(made) => made.mesh.parts,
        // Too thin for the coarse mesh: any piece may be on the surface.
        Err(_) => solid.names().to_vec(),
    })
}

/// Returns a flag for each of a solid's pieces: true if it is one of `parts` and has layers.
///
/// # Errors
/// [`MeshError::NoPart`] if a pattern matches none of the parts.
fn layered(solid: &dyn Solid, parts: &[String], layers: &Layers) -> Result<Vec<bool>, MeshError> {
    let names = solid.names();
    let mut found = vec![false; names.len()];
    for pattern in &layers.parts {
        let fitting = |name: &String| fits(pattern, name) && parts.contains(name);
        let pieces: Vec<usize> = (0..names.len()).filter(|&i| fitting(&names[i])).collect();
        if pieces.is_empty() {
            return Err(MeshError::NoPart {
                pattern: pattern.clone(),
                parts: parts.to_vec(),
            });
        }
        for piece in pieces {
            found[piece] = true;
        }
    }
    Ok(found)
}

/// Returns true if a name matches a pattern, in which `*` stands for any characters.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else {
        return false;
    };
    let mut last = None;
    for part in parts {
        if let Some(middle) = last.replace(part) {
            match rest.find(middle) {
                Some(at) => rest = &rest[at + middle.len()..],
                None => return false,
            }
        }
    }
    last.map_or(rest.is_empty(), |end| rest.ends_with(end))
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn stars_stand_for_any_characters() {
        for (pattern, name) in [
            ("wall", "wall"),
            ("*", ""),
            ("*", "wall"),
            ("wall*", "wall"),
            ("wall*", "wall.2"),
            ("*wall", "outer wall"),
            ("*a*a", "aa"),
            ("b*r*e", "bore"),
            ("hf*.x_*", "hfBlock.x_min"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("wall", "wall.2"),
            ("", "wall"),
            ("wall*", "a wall"),
            ("*wall", "wall.2"),
            ("*a*a", "a"),
            ("ab*ba", "aba"),
        ] {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
    }
}
