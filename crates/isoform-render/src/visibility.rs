//! Visible and hidden stretches of curves, and visible points.

use crate::model::Scratch;
use crate::trace::Tracer;
use isoform::geom::Point3;

/// Returns the pixel coordinates of a point; `None` if it is hidden by more than `lift`.
pub(crate) fn visible(
    tracer: &Tracer<'_>,
    p: Point3,
    lift: f64,
    scratch: &mut Scratch,
) -> Option<[f64; 2]> {
    let is_left = tracer.scene.section.is_none_or(|s| s.keeps(p));
    let at = tracer.sight.project(p).filter(|_| is_left)?;
    let depth = tracer.sight.depth(p);
    let seen = tracer.seen(at, scratch);
    // Points on a surface count as in front of it.
    let is_free = seen.is_none_or(|s| s.depth > depth - lift.max(3.0 * s.pixel));
    is_free.then_some(at)
}

/// Returns the visible (or invisible) stretches of a curve, in pixels.
pub(crate) fn runs(tracer: &Tracer<'_>, points: &[Point3], is_seen: bool) -> Vec<Vec<[f64; 2]>> {
    let mut scratch = Scratch::default();
    let mut runs: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut run = Vec::new();
    for pair in points.windows(2) {
        let ends = [pair[0], pair[1]].map(|p| tracer.sight.project(p));
        let [Some(a), Some(b)] = ends else { continue };
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        // Points 1.5 pixels apart.
        let count = ((length / 1.5).ceil() as usize).clamp(1, 10_000);
        for k in 0..=count {
            let share = k as f64 / count as f64;
            let p: Point3 = std::array::from_fn(|i| pair[0][i] + share * (pair[1][i] - pair[0][i]));
            let is_left = tracer.scene.section.is_none_or(|s| s.keeps(p));
            let Some(at) = tracer.sight.project(p).filter(|_| is_left) else {
                runs.push(std::mem::take(&mut run));
                continue;
            };
            if visible(tracer, p, 0.0, &mut scratch).is_some() == is_seen {
                run.push(at);
            } else {
                runs.push(std::mem::take(&mut run));
            }
        }
    }
    runs.push(run);
    let long = runs.into_iter().filter(|r| r.len() > 2);
    long.map(|r| isoform::geom::plane::simplified(&r, 0.05))
        .collect()
}
