//! Points on rims of pieces, for templates that know no distance but the metric reading.

use crate::Template;
use isoform_geom::{Point3, dot};

/// Half width of the rim of a piece, in deviations of the noise. At 3 one point in 700 crosses it.
const RIM: f64 = 2.5;
/// A point moved to a level of its piece's distance is there, unless another piece is in between:
/// less than this share of the level.
const STRAIGHT: f64 = 0.9;
/// A piece that would lose more than this share of its points keeps them all: better biased than
/// blind.
const MOST_RIM: f64 = 0.5;

/// 0 for points so near to the rim of their piece that noise may have carried them across, else 1;
/// empty where all are 1.
///
/// min and max of signed distances see a point beyond the rim from the wrong piece, always on the
/// same side: at noise of 1/250 of the size, faces move outwards by a whole standard deviation. A
/// point is moved along the gradient to a fixed level inside and outside; if it is not there then,
/// another piece is nearer than the level. This depends on the distance to the *other* piece alone,
/// which for crossing faces is independent of the residual: leaving out adds no bias of its own
/// (asking whether the other piece lies within some distance of the point's own would).
pub(crate) fn rims(template: &dyn Template, points: &[Point3], a: &[f64], noise: f64) -> Vec<f64> {
    let n = points.len();
    let field = template.metric();
    let (mut f, mut g) = (vec![0.0; n], vec![[0.0; 3]; n]);
    field.gradients(points, a, &mut f, &mut g);
    let mut mask = vec![1.0; n];
    let mut moved = vec![[0.0; 3]; n];
    let mut there = vec![0.0; n];
    for level in [RIM * noise, -RIM * noise] {
        for (((m, p), f), g) in moved.iter_mut().zip(points).zip(&f).zip(&g) {
            let step = (level - f) / dot(*g, *g).max(f64::MIN_POSITIVE);
            *m = std::array::from_fn(|i| p[i] + step * g[i]);
        }
        field.values(&moved, a, &mut there);
        for (m, there) in mask.iter_mut().zip(&there) {
            if there / level < STRAIGHT {
                *m = 0.0;
            }
        }
    }
    let mut parts = vec![0; n];
    template.parts(points, a, &mut parts);
    let mut count = vec![(0_usize, 0_usize); template.part_names().len()];
    for (part, m) in parts.iter().zip(&mask) {
        if let Some(c) = count.get_mut(*part as usize) {
            c.0 += 1;
            c.1 += usize::from(*m == 0.0);
        }
    }
    for (part, m) in parts.iter().zip(&mut mask) {
        if count
            .get(*part as usize)
            .is_none_or(|c| c.1 as f64 > MOST_RIM * c.0 as f64)
        {
            *m = 1.0;
        }
    }
    if mask.iter().all(|m| *m == 1.0) {
        Vec::new()
    } else {
        mask
    }
}
