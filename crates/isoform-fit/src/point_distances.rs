//! Distances of points from the model, by the template's distance if it has one.

use crate::Template;
use crate::feet::CachedFeet;
use crate::residuals::values;
use crate::template::parts_of;
use isoform_geom::Point3;

/// Signed distances and parts of points.
#[derive(Default)]
pub(crate) struct PointDistances {
    pub(crate) residuals: Vec<f64>,
    /// Parts that meet at the nearest point of the model; the first one is the part of the point.
    pub(crate) pieces: Vec<[u32; 3]>,
    /// Nearest points of the model; the points themselves if the template has no distance.
    /// Neighbours are determined among these, since noise makes points with similar residuals
    /// neighbours.
    pub(crate) at: Vec<Point3>,
}

impl PointDistances {
    /// Returns the part of each point.
    pub(crate) fn parts(&self) -> Vec<u32> {
        self.pieces.iter().map(|met| met[0]).collect()
    }

    /// Returns true for each point whose nearest point is on one of the flagged parts, or on its
    /// rim.
    pub(crate) fn on<'a>(&'a self, flagged: &'a [bool]) -> impl Iterator<Item = bool> + 'a {
        let is_on = |part: &u32| flagged.get(*part as usize) == Some(&true);
        self.pieces.iter().map(move |met| met.iter().any(is_on))
    }

    /// Returns 0 for points on open parts, else 1; empty if all are 1.
    pub(crate) fn mask(&self, open: &[bool]) -> Vec<f64> {
        if !open.contains(&true) {
            return Vec::new();
        }
        self.on(open).map(|o| f64::from(u8::from(!o))).collect()
    }
}

/// Computes distances and parts of points, by the template's distance if it has one.
pub(crate) fn measure_points(
    template: &dyn Template,
    distance: Option<&CachedFeet<'_>>,
    points: &[Point3],
    a: &[f64],
) -> PointDistances {
    let Some(distance) = distance else {
        return by_metric(template, points, a);
    };
    let mut out = PointDistances {
        residuals: Vec::with_capacity(points.len()),
        pieces: Vec::with_capacity(points.len()),
        at: Vec::with_capacity(points.len()),
    };
    // Batches bound the memory.
    for batch in points.chunks(1 << 16) {
        for foot in &distance.at(batch, a).feet {
            out.residuals.push(foot.distance);
            out.pieces.push(foot.pieces);
            out.at.push(foot.at);
        }
    }
    out
}

/// Computes metric residuals and parts of points, which represent their nearest points.
fn by_metric(template: &dyn Template, points: &[Point3], a: &[f64]) -> PointDistances {
    let mut residuals = vec![0.0; points.len()];
    values(template.metric(), points, a, &mut residuals);
    let parts = parts_of(template, points, a).into_iter();
    PointDistances {
        residuals,
        pieces: parts.map(|part| [part; 3]).collect(),
        at: points.to_vec(),
    }
}
