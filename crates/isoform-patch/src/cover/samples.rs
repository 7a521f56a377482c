//! Samples of a surface and their coverage.

use isoform_geom::{KdTree, Point3, distance_squared};

/// A point of the surface.
#[derive(Clone, Copy)]
pub(super) struct SurfaceSample {
    pub(super) point: Point3,
    /// Index of the part on which it lies.
    pub(super) part: usize,
    /// Depth at which it must lie inside a patch.
    pub(super) needs: f64,
    /// True if no patch covers it yet.
    pub(super) is_open: bool,
    /// Squared distance from covered samples and tried seeds, while it is open.
    pub(super) far: f64,
    pub(super) is_left_out: bool,
}

impl SurfaceSample {
    pub(super) fn new(point: Point3, part: usize, needs: f64) -> Self {
        Self {
            point,
            part,
            needs,
            is_open: true,
            far: f64::INFINITY,
            is_left_out: false,
        }
    }
}

/// Updates the distances of open samples from samples that were settled just now.
pub(super) fn update_far(samples: &mut [SurfaceSample], done: impl Iterator<Item = usize>) {
    let done: Vec<Point3> = done
        .map(|i| &samples[i])
        .filter(|s| !s.is_open)
        .map(|s| s.point)
        .collect();
    if done.is_empty() {
        return;
    }
    let tree = KdTree::new(&done);
    for sample in samples.iter_mut().filter(|s| s.is_open) {
        let near = tree.nearest(sample.point).map_or(f64::INFINITY, |n| n.1);
        sample.far = sample.far.min(near);
    }
}

/// Returns open samples, each the farthest from what is covered and from those chosen before it.
pub(super) fn next_seeds(samples: &[SurfaceSample], count: usize) -> Vec<usize> {
    let mut far: Vec<f64> = samples.iter().map(|s| s.far).collect();
    let mut seeds: Vec<usize> = Vec::new();
    for _ in 0..count {
        // Of equal distances the first sample wins.
        let best = (0..samples.len())
            .filter(|&i| samples[i].is_open)
            .max_by(|&a, &b| far[a].total_cmp(&far[b]).then(b.cmp(&a)));
        let Some(best) = best.filter(|b| !seeds.contains(b)) else {
            break;
        };
        seeds.push(best);
        for (f, s) in far.iter_mut().zip(samples) {
            *f = f.min(distance_squared(s.point, samples[best].point));
        }
    }
    seeds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With points on a line and the first one covered, the last is the farthest, then the middle
    /// one.
    #[test]
    fn seeds_are_far_from_what_is_covered_and_from_one_another() {
        let mut samples: Vec<SurfaceSample> = (0..9)
            .map(|i| SurfaceSample::new([f64::from(i), 0.0, 0.0], 0, 0.0))
            .collect();
        samples[0].is_open = false;
        update_far(&mut samples, std::iter::once(0));
        assert_eq!(samples[3].far, 9.0);
        assert_eq!(next_seeds(&samples, 2), [8, 4]);
    }
}
