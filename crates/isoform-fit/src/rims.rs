//! Points on rims of pieces, for templates whose best residual is the metric reading.

use crate::Template;
use crate::template::parts_of;
use isoform_geom::{Point3, dot};

/// Returns 0 for points so near to the rim of their piece that noise may have carried them across,
/// else 1; empty if all are 1.
///
/// Minima and maxima of signed distances evaluate a point beyond the rim by the wrong piece, always
/// on one side: at noise of 1/250 of the size, faces move outwards by a whole standard
/// deviation. A point is moved along the gradient to a fixed level inside and outside; if it does
/// not arrive there, another piece is nearer than the level. This depends on the distance to the
/// *other* piece alone, which for crossing faces is independent of the residual: leaving points out
/// adds no bias of its own (a test of whether the other piece lies within some distance of the
/// point would).
pub(crate) fn rims(template: &dyn Template, points: &[Point3], a: &[f64], noise: f64) -> Vec<f64> {
    // The half width of the rim in deviations of the noise; at 3 one point in 700 crosses it.
    let mut is_rim = vec![false; points.len()];
    let level = 2.5 * noise;
    mark_rims(template, points, a, level, &mut is_rim);
    let parts = parts_of(template, points, a);
    let counts = counted(&parts, &is_rim, template.part_names().len());
    let loses = |part: u32| counts.get(part as usize).is_some_and(|c| c.can_lose_rim());
    for (part, is_rim) in parts.iter().zip(&mut is_rim) {
        *is_rim &= loses(*part);
    }
    if !is_rim.contains(&true) {
        return Vec::new();
    }
    is_rim.iter().map(|r| f64::from(u8::from(!r))).collect()
}

/// Number of points of a piece, and of those on its rim.
#[derive(Clone, Copy, Default)]
struct RimCount {
    all: usize,
    rim: usize,
}

impl RimCount {
    /// Returns true if enough points remain without those on the rim. A piece that would lose more
    /// than half of its points keeps them all: a bias is better than no data.
    fn can_lose_rim(self) -> bool {
        self.rim as f64 <= 0.5 * self.all as f64
    }
}

/// Counts points by piece.
fn counted(parts: &[u32], is_rim: &[bool], pieces: usize) -> Vec<RimCount> {
    let mut counts = vec![RimCount::default(); pieces];
    for (part, is_rim) in parts.iter().zip(is_rim) {
        if let Some(c) = counts.get_mut(*part as usize) {
            c.all += 1;
            c.rim += usize::from(*is_rim);
        }
    }
    counts
}

/// Marks points that do not arrive at the levels inside and outside if they are moved there along
/// the gradient.
fn mark_rims(
    template: &dyn Template,
    points: &[Point3],
    a: &[f64],
    level: f64,
    is_rim: &mut [bool],
) {
    let field = template.metric();
    let (mut f, mut g) = (vec![0.0; points.len()], vec![[0.0; 3]; points.len()]);
    field.gradients(points, a, &mut f, &mut g);
    let mut there = vec![0.0; points.len()];
    for level in [level, -level] {
        let places = points.iter().zip(&f).zip(&g);
        let moved: Vec<Point3> = places.map(|((p, f), g)| moved(*p, *f, *g, level)).collect();
        field.values(&moved, a, &mut there);
        for (is_rim, there) in is_rim.iter_mut().zip(&there) {
            // Short of the level, another piece is in between.
            *is_rim |= there / level < 0.9;
        }
    }
}

/// Moves a point along the gradient g to where a linear function of value f would be `level`.
fn moved(p: Point3, f: f64, g: Point3, level: f64) -> Point3 {
    let step = (level - f) / dot(g, g).max(f64::MIN_POSITIVE);
    std::array::from_fn(|i| p[i] + step * g[i])
}
