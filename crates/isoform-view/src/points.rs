//! Points, and the corners of meshes, as arrays of a page.

use crate::blob::Blobs;
use isoform::geom::{Aabb, Point3, PointCloud};
use serde_json::{Value, json};

/// Maximum number of points with coordinates in single precision; more are rounded to steps of
/// 1/65535 of their box, which is less than a pixel while the whole box is in view.
const MAX_SINGLE_POINTS: usize = 200_000;
/// Number of steps of a rounded coordinate: the largest 16-bit integer.
const ROUNDED_STEPS: f64 = 65535.0;

/// Points with their deviations and outliers.
#[derive(Clone, Copy, Debug)]
pub struct ShownPoints<'a> {
    /// Points.
    pub cloud: &'a PointCloud,
    /// Deviations, one for each point, positive outside the model; `None` to use the column
    /// `deviation`.
    pub deviation: Option<&'a [f64]>,
    /// True, by point, for outliers, which statistics ignore; empty if there are none.
    pub outliers: &'a [bool],
    /// Deviation at which the colour scale ends; `None` chooses a round number that 95 % do not
    /// exceed.
    pub limit: Option<f64>,
}

impl<'a> ShownPoints<'a> {
    /// Returns points with the deviations and outliers of their columns, if any.
    pub fn new(cloud: &'a PointCloud) -> Self {
        Self {
            cloud,
            deviation: None,
            outliers: &[],
            limit: None,
        }
    }

    /// Returns the values of a column; `None` if the column does not exist.
    fn column(&self, name: &str) -> Option<&'a [f64]> {
        let column = self.cloud.columns.iter().find(|c| c.name == name);
        column.map(|c| c.values.as_slice())
    }
}

/// Returns a layer of points; missing deviations and outliers are taken from the columns
/// `deviation` and `outlier`.
pub(crate) fn layer(name: &str, points: &ShownPoints<'_>, blobs: &mut Blobs) -> Value {
    let cloud = points.cloud;
    let mut layer = json!({
        "kind": "points",
        "name": name,
        "count": cloud.points.len(),
        "positions": positions(&cloud.points, cloud.origin, blobs),
    });
    if let Some(values) = points.deviation.or(points.column("deviation")) {
        layer["deviation"] = numbers(values, blobs);
        let outliers: Vec<u8> = match points.column("outlier") {
            Some(column) if points.outliers.is_empty() => {
                column.iter().map(|v| u8::from(*v > 0.0)).collect()
            }
            _ => points.outliers.iter().map(|o| u8::from(*o)).collect(),
        };
        if outliers.contains(&1) {
            layer["outliers"] = blobs.u8(&outliers);
        }
        if let Some(limit) = points.limit {
            layer["limit"] = json!(limit);
        }
    }
    if let Some(entities) = points.column("entity").and_then(entities) {
        layer["entities"] = blobs.u16(&entities);
    } else if cloud.colors.len() == cloud.points.len() && !cloud.colors.is_empty() {
        layer["colors"] = blobs.u8(cloud.colors.as_flattened());
    }
    layer
}

/// Returns the entity of each point plus 1, and 0 for points of none; `None` if the column holds
/// other numbers than those of `isoform recognize`.
fn entities(column: &[f64]) -> Option<Vec<u16>> {
    let entity = |v: &f64| {
        let is_entity = v.fract() == 0.0 && (-1.0..f64::from(u16::MAX)).contains(v);
        is_entity.then(|| (v + 1.0) as u16)
    };
    column.iter().map(entity).collect()
}

/// Returns positions relative to a corner or the centre of their box, which is given in the file's
/// coordinates.
pub(crate) fn positions(points: &[Point3], origin: Point3, blobs: &mut Blobs) -> Value {
    let bounds = Aabb::from_points(points);
    let bounds = if bounds.is_empty() {
        Aabb {
            lo: [0.0; 3],
            hi: [0.0; 3],
        }
    } else {
        bounds
    };
    let size = bounds.size();
    let place = |p: Point3| -> Point3 { std::array::from_fn(|k| p[k] + origin[k]) };
    if points.len() <= MAX_SINGLE_POINTS {
        let middle = bounds.center();
        let near = points
            .iter()
            .flat_map(|p| (0..3).map(move |k| p[k] - middle[k]));
        return json!({"array": blobs.f32(near), "from": place(middle), "step": [1.0, 1.0, 1.0],
            "lo": place(bounds.lo), "hi": place(bounds.hi)});
    }
    let step = size.map(|s| if s > 0.0 { s / ROUNDED_STEPS } else { 1.0 });
    let rounded: Vec<u16> = points
        .iter()
        .flat_map(|p| (0..3).map(move |k| ((p[k] - bounds.lo[k]) / step[k]).round() as u16))
        .collect();
    json!({"array": blobs.u16(&rounded), "from": place(bounds.lo), "step": step,
        "lo": place(bounds.lo), "hi": place(bounds.hi)})
}

/// Returns one number for each point, rounded like coordinates if there are many.
pub(crate) fn numbers(values: &[f64], blobs: &mut Blobs) -> Value {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    let lo = finite.clone().fold(f64::INFINITY, f64::min);
    let hi = finite.fold(f64::NEG_INFINITY, f64::max);
    let is_whole = values.iter().all(|v| v.is_finite());
    if values.len() <= MAX_SINGLE_POINTS || !is_whole || lo >= hi {
        return json!({"array": blobs.f32(values.iter().copied()), "from": 0.0, "step": 1.0});
    }
    let step = (hi - lo) / ROUNDED_STEPS;
    let rounded: Vec<u16> = values
        .iter()
        .map(|v| ((v - lo) / step).round() as u16)
        .collect();
    json!({"array": blobs.u16(&rounded), "from": lo, "step": step})
}
