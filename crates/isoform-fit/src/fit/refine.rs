//! A second search, by distances: the pieces of a minimum are perturbed one by one, and polished by
//! the metric residual on more points than the search uses.
//!
//! In sums of squares of R-functions large pieces outweigh small ones: a hole or a countersink with
//! few points hardly changes such a sum, but it changes distances.

use crate::Loss;
use crate::fit::candidate::Found;
use crate::fit::compare::truncated_sum;
use crate::polish::Polish;
use crate::search::Search;
use crate::task::Task;
use isoform_geom::Point3;
use rayon::prelude::*;

/// Fewest throws of pieces.
const LEAST: usize = 16;
/// Most throws of pieces.
const MOST: usize = 80;
/// Throws that may run side by side. The number is fixed, so that the outcome does not depend on
/// the number of threads.
const TOGETHER: usize = 4;
/// Turns of each piece, at least.
const TURNS: usize = 3;
/// How often the best place must be met in them.
const HITS: usize = 2;
/// Sums of squared distances that differ by less than this share are one minimum.
const SAME: f64 = 1e-2;
/// A sum lower by this share is taken, even if it is of the minimum that is known.
const BETTER: f64 = 1e-3;
/// Distances count no more than this share of the diagonal in such a sum, so that a bound on the
/// sum is no matter of a few points.
const FAR_SHARE: f64 = 0.1;
/// In a robust sum distances count no more than this many robust deviations: of two places the one
/// that more points meet is taken, however far the others are. At 4.5 a tie of two floors of a cup
/// was decided by chance.
const NEAR_DEVIATIONS: f64 = 3.0;
/// Rounds that lead all variables back after the thrown ones.
const ROUNDS: usize = 5;

/// A start with some pieces perturbed.
struct Throw {
    from: Vec<f64>,
    /// Flags of the variables that were not perturbed.
    held: Vec<bool>,
}

/// Result of a perturbation.
struct End {
    x: Vec<f64>,
    evaluations: usize,
}

/// The best minimum, and the number of times it was reached.
struct Refinement<'a> {
    task: &'a Task<'a>,
    polish: Polish<'a>,
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
    pub(super) fn refine(&self, search: &Search<'_>, found: &mut Found) {
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
        let polish = task.polish(0);
        let residuals = polish.residuals(&points, &x);
        let far = FAR_SHARE * task.size();
        let cut = if loss.is_robust() {
            (NEAR_DEVIATIONS * Polish::scale(&residuals)).min(far)
        } else {
            far
        };
        Self {
            best: truncated_sum(&residuals, cut * cut),
            cut: cut * cut,
            task,
            polish,
            points,
            loss,
            random: fastrand::Rng::with_seed(task.options.seed ^ 0x9EF1),
            x,
            hits: 1,
            tried: 0,
            since: 0,
            is_elsewhere: false,
            evaluations: 0,
        }
    }

    /// Perturbs pieces until the best minimum has recurred. Returns false if it has not after 80
    /// perturbations.
    fn run(&mut self, search: &Search<'_>) -> bool {
        while self.tried < MOST && !self.task.control.is_stopped() {
            let groups = search.groups(&self.x);
            if groups.is_empty() {
                return false;
            }
            let throws: Vec<Throw> = (0..TOGETHER).map(|k| self.throw(&groups, k)).collect();
            let ends: Vec<End> = throws
                .into_par_iter()
                .map(|throw| self.led_back(throw))
                .collect();
            self.tried += TOGETHER;
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
    fn throw(&mut self, groups: &[Vec<usize>], k: usize) -> Throw {
        let mut throw = Throw {
            held: vec![true; self.x.len()],
            from: self.x.clone(),
        };
        let second = self.random.usize(0..groups.len());
        let first = (self.tried + k) % groups.len();
        let both = [first, second];
        let thrown = if k.is_multiple_of(2) {
            &both[..1]
        } else {
            &both
        };
        let space = &self.task.space;
        for &i in thrown.iter().flat_map(|g| &groups[*g]) {
            throw.from[i] = space.drawn(i, &mut self.random);
            throw.held[i] = false;
        }
        space.into_interior(&mut throw.from, 1e-3);
        throw
    }

    /// Polishes a perturbed start: first the perturbed variables alone, then all.
    fn led_back(&self, throw: Throw) -> End {
        let mut polish = self.task.polish(0);
        polish.held = throw.held;
        let here = polish.here(&self.points, &[]);
        let first = polish.fine(&here, throw.from, Loss::Squares, 1);
        polish.held.fill(false);
        let loss = if self.loss.is_robust() {
            Loss::Cauchy
        } else {
            self.loss
        };
        let here = polish.here(&self.points, &[]);
        let then = polish.fine(&here, first.x, loss, ROUNDS);
        End {
            x: then.x,
            evaluations: first.evaluations + then.evaluations,
        }
    }

    /// Compares a result with the best minimum.
    fn take(&mut self, end: End) {
        self.evaluations += end.evaluations;
        let residuals = self.polish.residuals(&self.points, &end.x);
        let value = truncated_sum(&residuals, self.cut);
        if value < (1.0 - BETTER) * self.best {
            if value < (1.0 - SAME) * self.best {
                (self.hits, self.since) = (0, self.tried);
                self.is_elsewhere = true;
            }
            (self.x, self.best) = (end.x, value);
            self.hits += 1;
        } else if value < (1.0 + SAME) * self.best {
            self.hits += 1;
        }
    }

    /// Returns true if the best minimum was reached twice, and every piece was perturbed at least
    /// three times since it was found.
    fn has_recurred(&self, groups: usize) -> bool {
        let least = LEAST.max(TURNS * groups);
        self.hits >= HITS && self.tried - self.since >= least
    }
}
