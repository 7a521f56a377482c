//! Rational surfaces with a last look at their triangles.

use isoform_control::Control;
use isoform_geom::Mesh;
use isoform_mesh::check::{self, Place, certify};
use isoform_tess::{
    Analysis, Crossing, Crossings, Map, Patch, Stopped, Surface, TriangulateOptions,
    triangulate_embedded, triangulate_patches,
};

pub use isoform_tess::PatchesError;

/// More pairs of triangles that cross than this are no accident of sheets that are close together.
const MOST: usize = 2000;

/// The triangles of a map's surface in a box, by [`isoform_tess::triangulate_embedded`]: triangles
/// that cross are found exactly.
///
/// # Errors
/// [`Stopped`].
pub fn rational_surface(
    map: &Map,
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Analysis), Stopped> {
    triangulate_embedded(map, options, &crossings, control)
}

/// Patches, each over [0, 1]², as one mesh, by [`isoform_tess::triangulate_patches`]: triangles that
/// cross are found exactly.
///
/// # Errors
/// [`PatchesError`].
pub fn rational_patches(
    patches: &[Patch],
    options: &TriangulateOptions,
    control: &Control<'_>,
) -> Result<(Surface, Vec<(Map, Analysis)>), PatchesError> {
    triangulate_patches(patches, options, &crossings, control)
}

/// The triangles that cross; none if there was no time to look for all of them.
fn crossings(surface: &Surface, control: &Control<'_>) -> Option<Crossings> {
    if control.is_stopped() {
        return None;
    }
    let mesh = Mesh {
        points: surface.points.clone(),
        triangles: surface.triangles.clone(),
        ..Mesh::default()
    };
    let options = check::Options {
        places: MOST,
        pairs: MOST,
        ..check::Options::default()
    };
    let silent = Control {
        progress: None,
        ..*control
    };
    let found = certify(&mesh, None, &options, &silent).intersections?;
    if control.is_stopped() {
        return None;
    }
    let pair = |p: &Place| {
        let triangles = <[u32; 2]>::try_from(p.elements.as_slice()).ok()?;
        Some(Crossing {
            triangles,
            point: Some(p.at),
        })
    };
    let count = found.pairs.count;
    Some(Crossings {
        count: if found.complete {
            count
        } else {
            count.min(MOST)
        },
        is_complete: found.complete,
        pairs: found.pairs.places.iter().filter_map(pair).collect(),
    })
}
