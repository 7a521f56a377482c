//! A second search, by distances: the pieces of a minimum are perturbed one by one, and polished by
//! the metric residual on more points than the search uses.
//!
//! In sums of squares of R-functions large pieces outweigh small ones: a hole or a countersink with
//! few points hardly changes such a sum, but it changes distances.

use crate::Loss;
use crate::fit::compare::truncated_sum;
use crate::minimum::FitMinimum;
use crate::polish::Polish;
use crate::search::{MinimumSearch, is_low, is_near};
use crate::task::Task;
use isoform_geom::Point3;
use rayon::prelude::*;

/// Number of perturbations that run in parallel. It is fixed, so that the outcome does not depend
/// on the number of threads.
const PARALLEL_PERTURBATIONS: usize = 4;
/// Relative difference of sums of squared distances below which two minima are equal.
const SAME_MINIMUM_SHARE: f64 = 1e-2;

/// A start with some pieces perturbed.
struct Perturbation {
    from: Vec<f64>,
    /// Flags of the variables that were not perturbed.
    held: Vec<bool>,
}

/// Result of a perturbation.
struct PerturbationResult {
    x: Vec<f64>,
    /// Truncated sum of squared distances.
    value: f64,
    /// True if it leads back to the best minimum.
    is_back: bool,
    evaluations: usize,
}

/// The best minimum, and the number of times it was reached.
struct Refinement<'a> {
    task: &'a Task<'a>,
    points: Vec<Point3>,
    loss: Loss,
    random: fastrand::Rng,
    /// Square of the largest distance that counts in full.
    cut: f64,
    x: Vec<f64>,
    /// Truncated sum of the best minimum.
    best: f64,
    hits: usize,
    tried: usize,
    /// Number of perturbations tried when the best minimum was found.
    since: usize,
    /// True if the best minimum is not the initial one.
    is_elsewhere: bool,
    evaluations: usize,
}

impl Task<'_> {
    /// Refines a minimum. It is certain if it was reached repeatedly, or if it was certain before
    /// and no better one was found.
    pub(super) fn refine(&self, search: &MinimumSearch<'_>, found: &mut FitMinimum) {
        let x = std::mem::take(&mut found.x);
        let mut refinement = Refinement::new(self, x, found.loss);
        let has_recurred = refinement.run(search);
        let was_certain = found.outcome.certain;
        found.outcome.certain = has_recurred || (was_certain && !refinement.is_elsewhere);
        found.evaluations += refinement.evaluations;
        found.x = refinement.x;
    }
}

impl<'a> Refinement<'a> {
    fn new(task: &'a Task<'a>, x: Vec<f64>, loss: Loss) -> Self {
        let points = task.some(task.options.confirm_points);
        // A tenth of the diagonal bounds the sum, so that a few points do not dominate it.
        let far = 0.1 * task.size();
        let cut = if loss.is_robust() {
            // Of two minima the one that more points meet is taken, however far the others are. At
            // 4.5 a tie between two floors of a cup was decided by chance.
            // Exact points that are off by several roundings are so by a misplaced piece.
            let scale = Polish::scale(&task.polish(0).residuals(&points, &x));
            (3.0 * scale).max(10.0 * task.rounding()).min(far)
        } else {
            far
        };
        let mut refinement = Self {
            best: f64::INFINITY,
            cut: cut * cut,
            task,
            points,
            loss,
            random: fastrand::Rng::with_seed(task.options.seed ^ 0x9EF1),
            x,
            hits: 1,
            tried: 0,
            since: 0,
            is_elsewhere: false,
            evaluations: 0,
        };
        // The sum after the polish of a perturbation. It differs from that at x, which was polished
        // with another loss.
        let end = refinement.polish_freely(refinement.x.clone());
        refinement.best = end.value;
        refinement.evaluations = end.evaluations;
        refinement
    }

    /// Perturbs pieces until the best minimum has recurred. Returns false if it did not within 80
    /// perturbations.
    fn run(&mut self, search: &MinimumSearch<'_>) -> bool {
        while self.tried < 80 && !self.task.control.is_stopped() {
            let groups = search.groups(&self.x);
            if groups.is_empty() {
                return false;
            }
            let perturbations: Vec<Perturbation> = (0..PARALLEL_PERTURBATIONS)
                .map(|k| self.perturbation(&groups, k))
                .collect();
            let ends: Vec<PerturbationResult> = perturbations
                .into_par_iter()
                .map(|perturbed| self.polish_perturbed(perturbed))
                .collect();
            self.tried += PARALLEL_PERTURBATIONS;
            for end in ends {
                self.take(end);
            }
            if self.has_recurred(groups.len()) {
                return true;
            }
        }
        false
    }

    /// Returns the k-th perturbation of a batch. Every other one moves two pieces, to free a hole
    /// that coincides with another one.
    fn perturbation(&mut self, groups: &[Vec<usize>], k: usize) -> Perturbation {
        let mut perturbed = Perturbation {
            held: vec![true; self.x.len()],
            from: self.x.clone(),
        };
        // An index of 64 bits: one of 32 would be another number.
        let second = self.random.u64(0..groups.len() as u64) as usize;
        let first = (self.tried + k) % groups.len();
        let both = [first, second];
        let thrown = if k.is_multiple_of(2) {
            &both[..1]
        } else {
            &both
        };
        let space = &self.task.space;
        for &i in thrown.iter().flat_map(|g| &groups[*g]) {
            perturbed.from[i] = space.drawn(i, &mut self.random);
            perturbed.held[i] = false;
        }
        space.into_interior(&mut perturbed.from, 1e-3);
        perturbed
    }

    /// Polishes a perturbed start: first the perturbed variables alone, then all.
    fn polish_perturbed(&self, perturbed: Perturbation) -> PerturbationResult {
        let mut polish = self.task.polish(0);
        polish.held = perturbed.held;
        let here = polish.here(&self.points, &[]);
        let first = polish.fine(&here, perturbed.from, Loss::Squares, 1);
        let then = self.polish_freely(first.x);
        PerturbationResult {
            evaluations: first.evaluations + then.evaluations,
            ..then
        }
    }

    /// Polishes all variables in rounds, until a run could not reach the best sum even if each
    /// further round decreased it as much as the last one did. The first round is not judged: the
    /// points of a misplaced piece may all be beyond the cut.
    fn polish_freely(&self, x: Vec<f64>) -> PerturbationResult {
        let polish = self.task.polish(0);
        let here = polish.here(&self.points, &[]);
        // Sums of rounding are equal.
        let nought = self.points.len() as f64 * self.task.rounding().powi(2);
        let sum = |x: &[f64]| {
            let residuals = polish.residuals(&self.points, x);
            truncated_sum(&residuals, self.cut).max(nought)
        };
        let (loss, rounds) = if self.loss.is_robust() {
            (Loss::Cauchy, 5)
        } else {
            (self.loss, 1)
        };
        let mut end = PerturbationResult {
            value: sum(&x),
            x,
            evaluations: 0,
            is_back: false,
        };
        for left in (0..rounds).rev() {
            let round = polish.fine(&here, end.x, loss, 1);
            let value = sum(&round.x);
            let reached = value - left as f64 * (end.value - value);
            end = PerturbationResult {
                x: round.x,
                value,
                evaluations: end.evaluations + round.evaluations,
                is_back: false,
            };
            let is_known = self.best.is_finite();
            end.is_back = is_known && is_low(value, self.best) && is_near(&end.x, &self.x);
            let is_hopeless = left + 1 < rounds && reached > (1.0 + SAME_MINIMUM_SHARE) * self.best;
            if end.is_back || is_hopeless {
                break;
            }
        }
        end
    }

    /// Compares a result with the best minimum.
    fn take(&mut self, end: PerturbationResult) {
        self.evaluations += end.evaluations;
        let value = end.value;
        // A slightly lower sum is taken, even of the known minimum.
        if value < (1.0 - 1e-3) * self.best {
            if value < (1.0 - SAME_MINIMUM_SHARE) * self.best {
                (self.hits, self.since) = (0, self.tried);
                self.is_elsewhere = true;
            }
            (self.x, self.best) = (end.x, value);
            self.hits += 1;
        } else if end.is_back || value < (1.0 + SAME_MINIMUM_SHARE) * self.best {
            self.hits += 1;
        }
    }

    /// Returns true if the best minimum was reached twice, and every piece was perturbed at least
    /// three times since it was found.
    fn has_recurred(&self, groups: usize) -> bool {
        let least = 16_usize.max(3 * groups);
        self.hits >= 2 && self.tried - self.since >= least
    }
}
