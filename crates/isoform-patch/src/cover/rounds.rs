//! Rounds of covering: patches grown in parallel at open samples.

use super::samples::{SurfaceSample, next_seeds, update_far};
use crate::depth::Border;
use crate::feet::reached;
use crate::options::{Covering, Error, Options};
use crate::parameterized::Parameterized;
use crate::places::{contains, wider};
use crate::single;
use crate::singular::{self, AvoidedPoints};
use crate::surface::{Random, project};
use crate::whole::{GrowthPart, NearSingular, Whole};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, distance_squared, norm, sub};
use rayon::prelude::*;

/// Number of patches grown in parallel; fixed, so that the result does not depend on the number of
/// threads.
const PATCHES_PER_ROUND: usize = 4;
/// Maximum number of seeds without a patch; once it is reached, the samples that are still open are
/// given up.
const MAX_FAILED_SEEDS: usize = 200;
/// Factor on the margin for the required depth of samples. The excess covers points between samples
/// and the radius of the proof's cells; a smaller factor costs more and smaller cells.
const MARGIN_FACTOR: f64 = 1.25;

/// A patch and, by sample, whether it covers that.
pub(super) struct CoveringPatch {
    pub(super) made: Parameterized,
    covers: Vec<bool>,
}

/// State of a cover while patches are added.
pub(super) struct CoverState<'w> {
    pub(super) whole: &'w Whole<'w>,
    /// Options of the patches, whose region is wider than the covered one if there is a margin.
    options: Options,
    pub(super) region: Aabb,
    tolerance: f64,
    covering: &'w Covering,
    pub(super) control: Control<'w>,
    random: Random,
    pub(super) samples: Vec<SurfaceSample>,
    /// Singular points near samples.
    pub(super) singular: Vec<Point3>,
    pub(super) apart: f64,
    /// Regions that patches avoid; `None` until a patch had trouble near a singular point.
    avoided: Option<AvoidedPoints>,
    pub(super) patches: Vec<CoveringPatch>,
    failures: usize,
    pub(super) last_error: Error,
}

impl<'w> CoverState<'w> {
    pub(super) fn new(
        whole: &'w Whole<'w>,
        options: &Options,
        covering: &'w Covering,
        control: Control<'w>,
    ) -> Result<Self, Error> {
        let tolerance = options.tolerance.ok_or(Error::Option {
            name: "the tolerance",
            value: f64::NAN,
        })?;
        let region = options.region;
        let beyond = MARGIN_FACTOR * covering.margin.unwrap_or(0.0);
        let mut work = Self {
            whole,
            options: Options {
                region: wider(&region, beyond),
                ..*options
            },
            region,
            tolerance,
            covering,
            control,
            random: Random::new(options.seed),
            samples: Vec::new(),
            singular: Vec::new(),
            apart: covering.apart.unwrap_or(0.01 * options.edge()),
            avoided: None,
            patches: Vec::new(),
            failures: 0,
            last_error: Error::NoSurface,
        };
        control.report("samples", 0.0);
        work.more_samples();
        control.report("samples", 1.0);
        if work.samples.is_empty() {
            control.check()?;
            return Err(Error::NoSurface);
        }
        if whole.is_single() {
            let points: Vec<Point3> = work.samples.iter().map(|s| s.point).collect();
            work.singular =
                singular::points(whole.field(0), &points, work.apart, region.diagonal());
        }
        Ok(work)
    }

    /// Adds patches until all samples are covered; then, up to `rounds` sets in all, draws another
    /// set of samples and covers that.
    pub(super) fn cover_samples(&mut self, rounds: usize) {
        let mut round = 1;
        while !self.is_over() {
            self.tell();
            if self.samples.iter().any(|s| s.is_open) {
                self.grow_some();
                continue;
            }
            if round == rounds {
                break;
            }
            // Another set detects gaps between the samples of the first.
            round += 1;
            let first = self.samples.len();
            self.more_samples();
            let fresh = &self.samples[first..];
            // The cover ends once less than 0.03 % of a new set was uncovered.
            let missed = fresh.iter().filter(|s| s.is_open).count();
            if (missed as f64) < 3e-4 * fresh.len() as f64 {
                break;
            }
        }
    }

    /// Reports the fraction of samples that are settled as progress.
    fn tell(&self) {
        let open = self.samples.iter().filter(|s| s.is_open).count();
        let done = 1.0 - open as f64 / self.samples.len().max(1) as f64;
        self.control.report("cover", done);
    }

    /// Returns true if no further patch may be tried.
    fn is_over(&self) -> bool {
        self.patches.len() >= self.covering.most
            || self.failures >= MAX_FAILED_SEEDS
            || self.control.is_stopped()
    }

    /// Adds random points of the surface in the region.
    fn more_samples(&mut self) {
        let scale = self.region.diagonal();
        let whole = self.whole;
        let relevant = if whole.is_single() {
            vec![0]
        } else {
            whole.relevant()
        };
        // Random points to be projected: 30 000 for each part, at most 150 000 for all parts.
        let places = (150_000 / relevant.len().max(1)).min(30_000);
        let mut fresh = Vec::new();
        for part in relevant {
            for _ in 0..places {
                if self.control.is_stopped() {
                    break;
                }
                let place = self.random.place(&self.region);
                let foot = project(whole.field(part), place, scale)
                    .filter(|p| contains(&self.region, *p))
                    .filter(|p| whole.is_on(part, *p, scale));
                fresh.extend(foot.map(|p| (p, part)));
            }
        }
        self.add(&fresh);
    }

    /// Adds points, each with the index of its part, as samples.
    pub(super) fn add(&mut self, fresh: &[(Point3, usize)]) {
        let first = self.samples.len();
        let samples: Vec<SurfaceSample> = fresh
            .iter()
            .map(|&(p, part)| SurfaceSample::new(p, part, self.needed_depth(p, part)))
            .collect();
        self.samples.extend(samples);
        let mut patches = std::mem::take(&mut self.patches);
        for patch in &mut patches {
            let more = self.covers(&patch.made, first);
            for (sample, covers) in self.samples[first..].iter_mut().zip(&more) {
                sample.is_open &= !covers;
            }
            patch.covers.extend(more);
        }
        self.patches = patches;
        if self.samples.iter().any(|s| s.is_left_out) {
            self.leave_out();
        }
        let count = self.samples.len();
        update_far(&mut self.samples, 0..count);
    }

    /// Returns the depth at which a point must lie inside a patch: 0 near edges, where patches end.
    fn needed_depth(&self, p: Point3, part: usize) -> f64 {
        let depth = MARGIN_FACTOR * self.covering.margin.unwrap_or(0.0);
        let has_edges = depth > 0.0 && !self.whole.is_single();
        let edge = has_edges
            .then(|| self.whole.nearest_edge(part, p, self.region.diagonal()))
            .flatten();
        let is_near = edge.is_some_and(|(q, _)| norm(sub(p, q)) <= depth);
        if is_near { 0.0 } else { depth }
    }

    /// Returns, for each sample from `first` on, whether it lies on a patch and deep enough in it.
    fn covers(&self, made: &Parameterized, first: usize) -> Vec<bool> {
        let patch = &made.grown.patch;
        let samples = &self.samples[first..];
        let points: Vec<Point3> = samples.iter().map(|s| s.point).collect();
        let mut covers = reached(patch, &points, self.tolerance);
        let is_bounded = made.distances.bound.is_some();
        if let Some(margin) = self.covering.margin.filter(|_| is_bounded) {
            let border = Border::new(patch, margin);
            let is_deep = |s: &SurfaceSample| s.needs == 0.0 || border.distance(s.point) >= s.needs;
            for (covers, sample) in covers.iter_mut().zip(samples) {
                *covers = *covers && is_deep(sample);
            }
        }
        covers
    }

    /// Grows some patches in parallel.
    fn grow_some(&mut self) {
        let count = PATCHES_PER_ROUND.min(self.covering.most - self.patches.len());
        let seeds = next_seeds(&self.samples, count);
        let this = &*self;
        let made: Vec<Result<CoveringPatch, Error>> =
            seeds.par_iter().map(|seed| this.grow_at(*seed)).collect();
        let mut done = seeds.clone();
        let was_avoided = self.avoided.is_some();
        for (seed, made) in seeds.into_iter().zip(made) {
            if self.is_hard(&made) && !self.singular.is_empty() {
                self.avoided = Some(AvoidedPoints::new(&self.singular, self.apart));
            }
            // The seed counts as settled even if rounding puts it slightly off the patch.
            self.samples[seed].is_open = false;
            self.samples[seed].far = 0.0;
            match made {
                Ok(patch) if patch.made.keeps(&self.options) && patch.covers.contains(&true) => {
                    done.extend(self.close(&patch.covers));
                    self.patches.push(patch);
                }
                made => {
                    if let Err(error) = made {
                        self.last_error = error;
                    }
                    self.fail(seed, was_avoided);
                }
            }
        }
        update_far(&mut self.samples, done.into_iter());
    }

    /// Grows a patch at a sample and determines which samples it covers.
    fn grow_at(&self, seed: usize) -> Result<CoveringPatch, Error> {
        let sample = &self.samples[seed];
        let on = GrowthPart {
            whole: self.whole,
            part: sample.part,
            near_singular: self.near_singular(),
        };
        let silent = Control {
            progress: None,
            ..self.control
        };
        let made = single::at(on, sample.point, &self.options, &silent)?;
        let covers = self.covers(&made, 0);
        Ok(CoveringPatch { made, covers })
    }

    /// Returns true if a patch failed or had to be shortened three times for its proof, which
    /// suggests a singular point nearby: if there are such points, later patches avoid them.
    fn is_hard(&self, made: &Result<CoveringPatch, Error>) -> bool {
        made.as_ref().map_or(true, |p| {
            p.made.shortenings >= 3 || !p.made.keeps(&self.options)
        })
    }

    /// Closes the open samples that are newly covered; returns their indices.
    fn close(&mut self, covers: &[bool]) -> Vec<usize> {
        let is_newly_covered = |i: &usize| self.samples[*i].is_open && covers[*i];
        let closed: Vec<usize> = (0..covers.len()).filter(is_newly_covered).collect();
        for &i in &closed {
            self.samples[i].is_open = false;
        }
        closed
    }

    /// Handles a seed without a patch: near a singular point, uncovered samples around such points
    /// are left out; elsewhere the seed is tried again if the avoidance of singular points began
    /// only now.
    fn fail(&mut self, seed: usize, was_avoided: bool) {
        if self.is_near_singular(self.samples[seed].point) {
            self.leave_out();
        } else if self.avoided.is_some() && !was_avoided {
            self.samples[seed].is_open = true;
        } else {
            self.failures += 1;
        }
    }

    /// Returns the policy for the next patches near singular points.
    fn near_singular(&self) -> NearSingular<'_> {
        match &self.avoided {
            Some(avoided) => NearSingular::Avoid(avoided),
            None if self.singular.is_empty() => NearSingular::Cross,
            None => NearSingular::Try,
        }
    }

    fn is_near_singular(&self, p: Point3) -> bool {
        (self.singular.iter()).any(|s| distance_squared(*s, p) <= self.apart * self.apart)
    }

    /// Leaves out the samples near singular points that lie on no patch.
    fn leave_out(&mut self) {
        for i in 0..self.samples.len() {
            let is_covered = !self.samples[i].is_open && self.is_covered(i);
            if !is_covered && self.is_near_singular(self.samples[i].point) {
                self.samples[i].is_open = false;
                self.samples[i].is_left_out = true;
            }
        }
    }

    /// Returns true if a sample lies on a patch.
    fn is_covered(&self, i: usize) -> bool {
        (self.patches.iter()).any(|p| p.covers.get(i) == Some(&true))
    }

    /// Returns the number of samples that are left out.
    pub(super) fn left_out(&self) -> usize {
        self.samples.iter().filter(|s| s.is_left_out).count()
    }

    /// Returns the number of samples that lie on a patch and are not left out.
    pub(super) fn covered(&self) -> usize {
        (0..self.samples.len())
            .filter(|&i| !self.samples[i].is_left_out && self.is_covered(i))
            .count()
    }

    /// Keeps a subset of the patches that covers as many samples: a greedy set cover that takes the
    /// patch with the most uncovered samples next.
    pub(super) fn keep_needed(&mut self) {
        let mut patches = std::mem::take(&mut self.patches);
        let mut open = vec![true; self.samples.len()];
        loop {
            let gain = |p: &CoveringPatch| {
                let each = p.covers.iter().zip(&open);
                each.filter(|(c, o)| **c && **o).count()
            };
            let best = (0..patches.len())
                .max_by(|&a, &b| gain(&patches[a]).cmp(&gain(&patches[b])).then(b.cmp(&a)));
            let Some(best) = best.filter(|&b| gain(&patches[b]) > 0) else {
                return;
            };
            let patch = patches.remove(best);
            for (o, c) in open.iter_mut().zip(&patch.covers) {
                *o &= !c;
            }
            self.patches.push(patch);
        }
    }
}
