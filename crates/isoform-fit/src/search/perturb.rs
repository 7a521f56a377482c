//! Perturbation of single primitives of a minimum: a typical false minimum has one misplaced piece.

use super::minima::{RunResult, SAME_SUM_SHARE, SearchOutcome};
use super::problem::MinimumSearch;
use crate::residuals::{MOVING_DERIVATIVE, jacobian};
use crate::template::parts_of;

/// The pieces of a template at the points of the search.
struct PieceMoves {
    /// Number of points by piece.
    count: Vec<usize>,
    /// True if a variable moves a point of a piece, by piece and variable.
    moved: Vec<Vec<bool>>,
}

impl PieceMoves {
    /// Returns the pieces with points.
    fn present(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.count.len()).filter(|&p| self.count[p] > 0)
    }

    /// Returns the number of pieces that variable k moves.
    fn moves(&self, k: usize) -> usize {
        self.moved.iter().filter(|moved| moved[k]).count()
    }

    /// Returns true if variable k moves most pieces, as a pose does: it belongs to none of them.
    fn is_common(&self, k: usize) -> bool {
        let present = self.present().count();
        present > 2 && 3 * self.moves(k) > 2 * present
    }
}

/// Counts of perturbations.
#[derive(Default)]
struct PerturbationTally {
    tried: usize,
    /// Number of perturbations that led back to the best minimum.
    back: usize,
    failures: usize,
}

impl MinimumSearch<'_> {
    /// Perturbs single primitives of the best minimum. Returns true if this keeps leading back and
    /// the rate of return, starts included, makes it improbable that a minimum as wide was missed;
    /// false to continue with starts.
    pub(super) fn perturb_pieces(&self, out: &mut SearchOutcome) -> bool {
        let seed = self.options.seed ^ 0x7_4120 ^ ((out.starts as u64) << 32);
        let mut random = fastrand::Rng::with_seed(seed);
        let nought = out.nought();
        let mut groups = self.groups(&out.minima[0].x);
        let mut tally = PerturbationTally::default();
        while tally.tried < 12 && !groups.is_empty() && !self.control.is_stopped() {
            let group = &groups[tally.failures % groups.len()];
            let x = self.throw_group(&out.minima[0].x, group, &mut random);
            let run = self.descend(x, out.minima.first(), nought, out.starts);
            out.evaluations += run.evaluations;
            if tally.count(run, out, nought) {
                groups = self.groups(&out.minima[0].x);
            } else if self.is_enough(&tally, out) {
                return out.minima[0].hits >= 2;
            }
        }
        groups.is_empty()
    }

    /// Returns true after four perturbations without success, if the rate of return makes it
    /// improbable enough that a minimum was missed.
    fn is_enough(&self, tally: &PerturbationTally, out: &SearchOutcome) -> bool {
        let total = out.starts + tally.tried;
        let rate = (out.minima[0].hits + tally.back) as f64 / total as f64;
        tally.failures >= 4 && (1.0 - rate).powi(total as i32) < self.options.miss
    }

    /// Returns a point with some variables drawn anew.
    pub(crate) fn throw_group(
        &self,
        x: &[f64],
        group: &[usize],
        random: &mut fastrand::Rng,
    ) -> Vec<f64> {
        let mut x = x.to_vec();
        for &k in group {
            x[k] = self.space.drawn(k, random);
        }
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// Returns the best minimum with about half of its primitives drawn anew.
    pub(super) fn mixed(&self, best: &[f64], i: usize) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ ((i as u64) << 20));
        let mut x = best.to_vec();
        for group in self.groups(best) {
            if random.bool() {
                for k in group {
                    x[k] = self.space.drawn(k, &mut random);
                }
            }
        }
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// Groups the free variables by primitive: the variables that a piece's points move. Pieces
    /// with the fewest points come first, and before them the variables that move no point: their
    /// piece is away from the data.
    pub(crate) fn groups(&self, x: &[f64]) -> Vec<Vec<usize>> {
        let pieces = self.pieces(x);
        let variables = 0..self.space.len();
        let orphans: Vec<usize> = variables
            .clone()
            .filter(|&k| pieces.moves(k) == 0)
            .collect();
        let own: Vec<usize> = variables.filter(|&k| !pieces.is_common(k)).collect();
        let mut order: Vec<usize> = pieces.present().collect();
        order.sort_by_key(|&p| pieces.count[p]);
        let mut groups: Vec<Vec<usize>> = vec![orphans];
        for p in order {
            let moved = own.iter().copied().filter(|&k| pieces.moved[p][k]);
            let group: Vec<usize> = moved.collect();
            if !groups.contains(&group) {
                groups.push(group);
            }
        }
        groups.retain(|group| !group.is_empty());
        groups
    }

    /// Determines which variables move the points of which piece.
    fn pieces(&self, x: &[f64]) -> PieceMoves {
        let names = self.template.part_names().len();
        let a = self.space.parameters(x);
        let parts = parts_of(self.template, self.points, &a);
        let jac = jacobian(self.template.metric(), self.points, &a);
        let mut pieces = PieceMoves {
            count: vec![0; names],
            moved: vec![vec![false; self.space.len()]; names],
        };
        for (p, row) in parts.iter().zip(jac.chunks_exact(a.len())) {
            let Some(moved) = pieces.moved.get_mut(*p as usize) else {
                continue;
            };
            pieces.count[*p as usize] += 1;
            for (k, moved) in moved.iter_mut().enumerate() {
                *moved |= self.space.derivative(k, row).abs() > MOVING_DERIVATIVE;
            }
        }
        pieces
    }
}

impl PerturbationTally {
    /// Adds a perturbation. Returns true if it led to something better: then all minima found so
    /// far are others.
    fn count(&mut self, run: RunResult, out: &mut SearchOutcome, nought: f64) -> bool {
        self.tried += 1;
        let best = out.best();
        let value = run.value;
        let is_back = value.is_finite() && out.insert(run.x, value, nought, false) == 0;
        if is_back && best > nought && value < best * (1.0 - SAME_SUM_SHARE) {
            *self = Self {
                back: 1,
                ..Self::default()
            };
            out.minima[0].hits = 1;
            return true;
        }
        self.back += usize::from(is_back);
        self.failures += 1;
        false
    }
}
