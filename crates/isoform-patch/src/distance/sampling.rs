//! Sampled distances: foot points by Newton's method along gradients.

use crate::places::grid;
use crate::surface::SURFACE_DISTANCE_TOLERANCE;
use crate::whole::Whole;
use isoform_geom::{Field, Point3, RationalPatch, norm, sub};
use isoform_num::Jet2;

/// Samples the distance of a patch from the surface on a square grid with `samples` (at least 2)
/// points in each direction; returns the largest distance and the root mean square over the area.
pub fn sampled(field: &dyn Field, patch: &RationalPatch, samples: usize) -> (f64, f64) {
    sampled_by(patch, samples, |points| foot_distances(field, points))
}

/// Does what [`sampled`] does, for a surface of parts; there the distances are correct to first
/// order.
pub(crate) fn sampled_on(whole: &Whole<'_>, patch: &RationalPatch, samples: usize) -> (f64, f64) {
    if whole.is_single() {
        return sampled(whole.field(0), patch, samples);
    }
    let distance = |p: &Point3| whole.first_order(*p).0.abs();
    sampled_by(patch, samples, |points| {
        points.iter().map(distance).collect()
    })
}

fn sampled_by(
    patch: &RationalPatch,
    samples: usize,
    distances: impl Fn(&[Point3]) -> Vec<f64>,
) -> (f64, f64) {
    let at = |i: usize| i as f64 / (samples - 1) as f64;
    // Weights of the trapezoidal rule: half at the border.
    let half = |i: usize| if i == 0 || i == samples - 1 { 0.5 } else { 1.0 };
    let mut points = Vec::with_capacity(samples * samples);
    let mut areas = Vec::with_capacity(samples * samples);
    for i in 0..samples {
        for j in 0..samples {
            let t = patch.tangents(at(i), at(j));
            points.push(t.point);
            areas.push(norm(t.normal()) * half(i) * half(j));
        }
    }
    let distances = distances(&points);
    let (mut most, mut sum, mut area) = (0.0f64, 0.0, 0.0);
    for (d, a) in distances.iter().zip(&areas) {
        most = most.max(*d);
        sum += d * d * a;
        area += a;
    }
    (most, (sum / area).sqrt())
}

/// Returns the distances of points from the surface, measured to foot points: exact where the
/// iteration converges to the nearest foot, too large elsewhere.
pub fn foot_distances(field: &dyn Field, points: &[Point3]) -> Vec<f64> {
    let mut feet = points.to_vec();
    let mut jets = project_all(field, &mut feet);
    let all = feet.iter().zip(points);
    let mut best: Vec<f64> = all.map(|(q, p)| norm(sub(*p, *q))).collect();
    // Corrections of the foot points.
    for _ in 0..2 {
        let each = points.iter().zip(&feet).zip(&jets);
        let mut moved: Vec<Point3> = each
            .map(|((p, q), j)| moved_in_plane(*p, *q, j.g))
            .collect();
        jets = project_all(field, &mut moved);
        for ((b, q), p) in best.iter_mut().zip(&moved).zip(points) {
            *b = b.min(norm(sub(*p, *q)));
        }
        feet = moved;
    }
    best
}

/// Moves the foot q by the tangential component of p − q, which gives a better start point.
fn moved_in_plane(p: Point3, q: Point3, g: Point3) -> Point3 {
    let (d, g2) = (sub(p, q), g.iter().map(|g| g * g).sum::<f64>());
    let along = if g2 > 0.0 {
        (d[0] * g[0] + d[1] * g[1] + d[2] * g[2]) / g2
    } else {
        0.0
    };
    std::array::from_fn(|k| q[k] + d[k] - along * g[k])
}

/// Moves points onto the surface along gradients; returns the jets there.
fn project_all(field: &dyn Field, points: &mut [Point3]) -> Vec<Jet2> {
    let zero = Jet2 {
        v: 0.0,
        g: [0.0; 3],
        h: [0.0; 6],
    };
    let mut jets = vec![zero; points.len()];
    for _ in 0..25 {
        field.jets(points, &mut jets);
        let mut most = 0.0f64;
        for (p, j) in points.iter_mut().zip(&jets) {
            let g2: f64 = j.g.iter().map(|g| g * g).sum();
            let step = j.v / g2;
            if j.v == 0.0 || !step.is_finite() {
                continue;
            }
            most = most.max(step.abs() * g2.sqrt());
            for k in 0..3 {
                p[k] -= step * j.g[k];
            }
        }
        if most <= SURFACE_DISTANCE_TOLERANCE {
            break;
        }
    }
    jets
}

/// Returns the largest absolute coordinate of a patch, from samples: control points may be far
/// away.
pub(super) fn largest_coordinate(patch: &RationalPatch) -> f64 {
    let all = grid(9).flat_map(|(u, v)| patch.point(u, v));
    all.fold(0.0, |m, v| m.max(v.abs()))
}
