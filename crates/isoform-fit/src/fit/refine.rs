//! The search once more, by distances: the pieces of a minimum are thrown elsewhere one by one, and
//! led back by the metric residual on more points than the search sees.
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

/// A start with some pieces thrown elsewhere.
struct Throw {
    from: Vec<f64>,
    /// Variables that were not thrown.
    held: Vec<bool>,
}

/// Where a throw ended.
struct End {
    x: Vec<f64>,
    evaluations: usize,
}

/// The best place, and how often it was met.
struct Refinement<'a> {
    task: &'a Task<'a>,
    polish: Polish<'a>,
    points: Vec<Point3>,
    loss: Loss,
    random: fastrand::Rng,
    /// Square of the distance that counts most.
    cut: f64,
    x: Vec<f64>,
    /// Its truncated sum.
    best: f64,
    hits: usize,
    tried: usize,
    /// Throws tried when the place was found.
    since: usize,
    /// Whether the place is another one than at first.
    is_elsewhere: bool,
    evaluations: usize,
}

impl Task<'_> {
    /// Refines a minimum; it is certain when its place was met again and again, or when it was
    /// certain before and there was no better one.
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

    /// Throws pieces until the best place has recurred, which it tells, or there were enough.
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

    /// The k-th of some throws. Every other one moves two pieces: a hole that hides in another one.
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

    /// The metric minimum from a thrown start, its thrown variables first.
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

    /// Compares an end with the best place.
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

    /// Whether every piece had its turns since there was something better, and the place was met
    /// often enough.
    fn has_recurred(&self, groups: usize) -> bool {
        let least = LEAST.max(TURNS * groups);
        self.hits >= HITS && self.tried - self.since >= least
    }
}
