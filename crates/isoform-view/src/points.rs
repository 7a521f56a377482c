//! Points, and the corners of meshes, as arrays of a page.

use crate::blob::Blobs;
use isoform::geom::{Aabb, Point3, PointCloud};
use serde_json::{Value, json};

/// Up to this many points have coordinates in single precision; more are rounded to steps of a
/// 65535th of their box, which is below a pixel as long as the whole is in view.
const EXACT: usize = 200_000;
/// The number of steps of a rounded coordinate.
const STEPS: f64 = 65535.0;

/// A layer of points. `deviation` is one number for each, positive outside of the model; where it is
/// not given, it is the column of that name.
pub(crate) fn layer(
    name: &str,
    cloud: &PointCloud,
    deviation: Option<&[f64]>,
    blobs: &mut Blobs,
) -> Value {
    let mut layer = json!({
        "kind": "points",
        "name": name,
        "count": cloud.points.len(),
        "positions": positions(&cloud.points, cloud.origin, blobs),
    });
    let column = |name: &str| cloud.columns.iter().find(|c| c.name == name);
    let own = column("deviation").map(|c| c.values.as_slice());
    if let Some(values) = deviation.or(own) {
        layer["deviation"] = numbers(values, blobs);
    }
    if cloud.colors.len() == cloud.points.len() && !cloud.colors.is_empty() {
        layer["colors"] = blobs.u8(cloud.colors.as_flattened());
    }
    layer
}

/// Positions about the middle of their box, which is given in the file's coordinates.
pub(crate) fn positions(points: &[Point3], origin: Point3, blobs: &mut Blobs) -> Value {
    let bounds = Aabb::of(points);
    let bounds = if bounds.is_empty() { Aabb { lo: [0.0; 3], hi: [0.0; 3] } } else { bounds };
    let size = bounds.size();
    let place = |p: Point3| -> Point3 { std::array::from_fn(|k| p[k] + origin[k]) };
    if points.len() <= EXACT {
        let middle = bounds.center();
        let near = points.iter().flat_map(|p| (0..3).map(move |k| p[k] - middle[k]));
        return json!({"array": blobs.f32(near), "from": place(middle), "step": [1.0, 1.0, 1.0],
            "lo": place(bounds.lo), "hi": place(bounds.hi)});
    }
    let step = size.map(|s| if s > 0.0 { s / STEPS } else { 1.0 });
    let rounded: Vec<u16> = points
        .iter()
        .flat_map(|p| (0..3).map(move |k| ((p[k] - bounds.lo[k]) / step[k]).round() as u16))
        .collect();
    json!({"array": blobs.u16(&rounded), "from": place(bounds.lo), "step": step,
        "lo": place(bounds.lo), "hi": place(bounds.hi)})
}

/// One number for each point; of many points rounded like coordinates.
pub(crate) fn numbers(values: &[f64], blobs: &mut Blobs) -> Value {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    let lo = finite.clone().fold(f64::INFINITY, f64::min);
    let hi = finite.fold(f64::NEG_INFINITY, f64::max);
    let is_whole = values.iter().all(|v| v.is_finite());
    if values.len() <= EXACT || !is_whole || lo >= hi {
        return json!({"array": blobs.f32(values.iter().copied()), "from": 0.0, "step": 1.0});
    }
    let step = (hi - lo) / STEPS;
    let rounded: Vec<u16> = values.iter().map(|v| ((v - lo) / step).round() as u16).collect();
    json!({"array": blobs.u16(&rounded), "from": lo, "step": step})
}
