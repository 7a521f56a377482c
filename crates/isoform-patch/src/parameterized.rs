//! Patch with the results of its construction and checks.

use crate::distance::Distances;
use crate::grown::Grown;
use crate::options::Options;
use isoform_geom::Quadric;
use std::time::Instant;

/// Patch with the results of its construction and checks.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// Patch and the history of its growth.
    pub grown: Grown,
    /// Index of the part of the surface on which it lies; 0 if the surface is one function.
    pub part: usize,
    /// Distances from the surface.
    pub distances: Distances,
    /// True if the patch is proved not to fold over: its normal points to one side of the surface,
    /// except across self-intersections, where normals turn little.
    pub is_unfolded: bool,
    /// Number of times that it was shortened until its distance could be proved.
    pub shortenings: usize,
    /// True if S keeps its bound.
    pub is_within_limit: bool,
    /// True if time ran out while the patch could still grow.
    pub is_late: bool,
    /// True if the patch lies on the surface, to rounding.
    pub is_exact: bool,
    /// Quadric or torus on which an exact patch lies; `None` if it lies on neither or is not exact.
    pub quadric: Option<Quadric>,
    /// Computing time by phase, in seconds.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Parameterized {
    /// Returns true if it is proved to keep the tolerance and not to fold over.
    pub(crate) fn keeps(&self, options: &Options) -> bool {
        let bound = self.distances.bound;
        self.is_unfolded && bound.is_some_and(|b| options.is_kept_by(b))
    }
}

/// Clock that records the durations of phases.
pub(crate) struct Clock {
    since: Instant,
    pub(crate) seconds: Vec<(&'static str, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Self {
            since: Instant::now(),
            seconds: Vec::new(),
        }
    }
}

impl Clock {
    /// Ends a phase and records its duration.
    pub(crate) fn phase(&mut self, name: &'static str) {
        self.seconds
            .push((name, self.since.elapsed().as_secs_f64()));
        self.since = Instant::now();
    }
}

/// Adds the times of two runs, for the phases of the first.
pub(crate) fn both_times(
    a: &[(&'static str, f64)],
    b: &[(&'static str, f64)],
) -> Vec<(&'static str, f64)> {
    let of = |name: &str| b.iter().filter(|p| p.0 == name).map(|p| p.1).sum::<f64>();
    a.iter().map(|p| (p.0, p.1 + of(p.0))).collect()
}
