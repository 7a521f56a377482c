//! Rational patches in a page: their control points, which the page evaluates itself.

use crate::blob::Blobs;
use isoform::geom::{Aabb, Point3, RationalPatch};
use serde_json::{Value, json};

/// Number of intervals between sample points along each side of a patch, from which its box is
/// computed.
const BOX_SAMPLES: usize = 12;

/// Patch with its name and distance.
#[derive(Clone, Debug)]
pub struct ShownPatch {
    /// Patch.
    pub patch: RationalPatch,
    /// Name of the patch.
    pub name: String,
    /// Largest distance from the surface that it approximates; `None` if unknown.
    pub distance: Option<f64>,
}

/// Returns a layer of patches.
pub(crate) fn layer(name: &str, patches: &[ShownPatch], blobs: &mut Blobs) -> Value {
    let mut control = Vec::new();
    let mut list = Vec::new();
    for shown in patches {
        let (m, n) = shown.patch.degree();
        control.extend(shown.patch.control().as_flattened());
        list.push(json!({"name": shown.name, "degree": [m, n], "distance": shown.distance}));
    }
    let points: Vec<Point3> = patches.iter().flat_map(samples).collect();
    let bounds = Aabb::from_points(&points);
    json!({
        "kind": "patches",
        "name": name,
        "count": patches.len(),
        "control": blobs.f64(&control),
        "patches": list,
        "bounds": [bounds.lo, bounds.hi],
    })
}

/// Returns the finite points of a patch on a grid.
fn samples(shown: &ShownPatch) -> impl Iterator<Item = Point3> + '_ {
    let side = BOX_SAMPLES + 1;
    (0..side * side)
        .map(move |k| {
            let at = |i: usize| i as f64 / BOX_SAMPLES as f64;
            shown.patch.point(at(k / side), at(k % side))
        })
        .filter(|p| p.iter().all(|v| v.is_finite()))
}
