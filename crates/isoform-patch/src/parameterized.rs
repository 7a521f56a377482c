//! A patch with what is known of it.

use crate::distance::Distances;
use crate::grown::Grown;
use crate::options::Options;
use isoform_geom::Quadric;
use std::time::Instant;

/// A patch with what is known of it.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// The patch and the way to it.
    pub grown: Grown,
    /// The part of the surface it lies on; 0 where the surface is one function.
    pub part: usize,
    /// How far it is from the surface.
    pub distances: Distances,
    /// Whether it is proved not to fold over: that it shows one side to where F grows, except
    /// across self-intersections, where its normals turn little.
    pub is_unfolded: bool,
    /// How often it was made shorter until its distance could be proved.
    pub shortenings: usize,
    /// Whether S keeps its bound.
    pub is_within_limit: bool,
    /// Whether the time was over before the patch was as large as it gets.
    pub is_late: bool,
    /// Whether the patch lies on the surface, to rounding.
    pub is_exact: bool,
    /// The quadric or torus on which an exact patch lies, if it lies on one.
    pub quadric: Option<Quadric>,
    /// Seconds by phase.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Parameterized {
    /// Whether it is proved to keep the tolerance and not to fold over.
    pub(crate) fn keeps(&self, options: &Options) -> bool {
        let bound = self.distances.bound;
        self.is_unfolded && bound.is_some_and(|b| options.is_kept_by(b))
    }
}

/// A clock that takes the time of phases.
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
    /// Ends a phase.
    pub(crate) fn phase(&mut self, name: &'static str) {
        self.seconds
            .push((name, self.since.elapsed().as_secs_f64()));
        self.since = Instant::now();
    }
}

/// The times of two runs together, by the phases of the first.
pub(crate) fn both_times(
    a: &[(&'static str, f64)],
    b: &[(&'static str, f64)],
) -> Vec<(&'static str, f64)> {
    let of = |name: &str| b.iter().filter(|p| p.0 == name).map(|p| p.1).sum::<f64>();
    a.iter().map(|p| (p.0, p.1 + of(p.0))).collect()
}
