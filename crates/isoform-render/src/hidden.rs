//! Hidden edges: feature curves of models, and edges of meshes where facets meet at an angle.

use crate::layer::{Body, Scene};
use crate::surface::Surface;
use crate::trace::{FOLD_COSINE, Tracer};
use crate::visibility::runs;
use isoform::geom::{Point3, dot};
use isoform::{Control, Stopped};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Returns the invisible stretches of edges, in pixels.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn edges(
    tracer: &Tracer<'_>,
    control: &Control<'_>,
) -> Result<Vec<Vec<[f64; 2]>>, Stopped> {
    control.begin("hidden edges")?;
    let curves = all(tracer.scene, control);
    control.check()?;
    let found: Vec<Vec<Vec<[f64; 2]>>> =
        curves.par_iter().map(|c| runs(tracer, c, false)).collect();
    Ok(found.concat())
}

/// Returns the edges of all layers.
fn all(scene: &Scene, control: &Control<'_>) -> Vec<Vec<Point3>> {
    let of = |layer: &crate::Layer| match &layer.body {
        Body::Model { model, .. } => model.features(control),
        Body::Surface(_) if !layer.curves.is_empty() => {
            layer.curves.iter().map(|c| c.points.clone()).collect()
        }
        Body::Surface(surface) if layer.kind == "mesh" || layer.kind == "solid" => sharp(surface),
        _ => Vec::new(),
    };
    scene.layers.iter().flat_map(of).collect()
}

/// Returns the edges at which facets meet at an angle, or end.
fn sharp(surface: &Surface) -> Vec<Vec<Point3>> {
    let mut around: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (k, t) in surface.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            around
                .entry([a.min(b), a.max(b)])
                .or_default()
                .push(k as u32);
        }
    }
    let normal = |k: u32| crate::camera::unit(crate::exact::facet_normal(surface.corners(k)));
    let is_sharp = |faces: &[u32]| match faces {
        [a, b] => dot(normal(*a), normal(*b)) < FOLD_COSINE,
        _ => true,
    };
    let found = around.into_iter().filter(|(_, faces)| is_sharp(faces));
    found
        .map(|(ends, _)| ends.map(|i| surface.points[i as usize]).to_vec())
        .collect()
}
