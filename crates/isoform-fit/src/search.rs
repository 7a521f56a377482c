//! The global search: Levenberg-Marquardt from many starts on a few hundred points, until the best
//! minimum recurs.
//!
//! The algebraic residual is searched with, because its basins are wide. Start 0 is the caller's;
//! further ones are drawn, in seeded Latin hypercubes, from where the data suggest and (every
//! fourth) from the whole bounds. Once the best minimum has recurred, single primitives are thrown
//! elsewhere, those first that explain the fewest points: the typical false minimum has one piece
//! astray. Candidates of near-equal sums are then compared on more points, by the metric residual.
//!
//! Starts are run in batches of fixed size whose runs see only what earlier batches found, and
//! results are read in the order of starts. So the outcome does not depend on the number of
//! threads.

use crate::objective::Residuals;
use crate::space::Space;
use crate::{Control, Options, Template, lm};
use isoform_geom::Point3;
use rayon::prelude::*;

/// Runs that may go side by side. Larger batches feed more threads, but a lone thread learns later
/// when to stop a hopeless run.
const BATCH: usize = 4;
/// Starts of one Latin hypercube.
const CUBE: usize = 16;
/// Two sums are the same minimum when they differ by less than this share: converged runs agree to
/// 1e-6, distinct minima of the noise differ by more than 2 % on 512 points, and the near-equal
/// ones of nested R-functions (1e-4) are meant to count as one.
const SAME: f64 = 5e-3;
/// Sums below this share of the typical first one are all nought (clean data).
const NOUGHT: f64 = 1e-10;
/// Candidates within this factor of the best sum are compared on more points.
const RIVAL: f64 = 2.0;
/// Most candidates compared.
const CANDIDATES: usize = 4;
/// Throws of single primitives without success before the search ends.
const THROWS: usize = 4;
/// Most throws before further starts.
const MOST_THROWS: usize = 12;
/// A run this near to the best minimum (in units) with a sum below [`NEAR_SUM`] times its own is
/// taken to have arrived.
const NEAR: f64 = 0.01;
/// See [`NEAR`].
const NEAR_SUM: f64 = 1.5;

/// A minimum of the algebraic sum on the search points.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) x: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) hits: usize,
}

/// One line of the convergence history.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Start that the step belongs to; the polish has its own number, one past the last.
    pub start: usize,
    /// Evaluation.
    pub iteration: usize,
    /// Root of the mean square of the residual: algebraic in the search, metric in the polish.
    pub rms: f64,
}

/// What the search found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outcome {
    /// Distinct minima, best first.
    pub(crate) minima: Vec<Found>,
    pub(crate) starts: usize,
    pub(crate) evaluations: usize,
    /// Whether the best minimum recurred as often as asked.
    pub(crate) certain: bool,
    pub(crate) stopped: bool,
    pub(crate) history: Vec<Step>,
}

impl Outcome {
    fn insert(&mut self, x: Vec<f64>, value: f64, nought: f64, counts: bool) -> usize {
        let same = |m: &Found| {
            (m.value - value).abs() <= SAME * m.value.min(value)
                || (m.value <= nought && value <= nought)
        };
        let at = self.minima.iter().position(same);
        if let Some(at) = at {
            let m = &mut self.minima[at];
            m.hits += usize::from(counts);
            if value < m.value {
                (m.x, m.value) = (x, value);
            }
            return at;
        }
        let at = self.minima.partition_point(|m| m.value <= value);
        self.minima.insert(
            at,
            Found {
                x,
                value,
                hits: usize::from(counts),
            },
        );
        at
    }

    fn best(&self) -> f64 {
        self.minima.first().map_or(f64::INFINITY, |m| m.value)
    }
}

/// Everything that a run needs.
pub(crate) struct Search<'a> {
    pub(crate) template: &'a dyn Template,
    pub(crate) space: &'a Space,
    pub(crate) points: &'a [Point3],
    pub(crate) options: &'a Options,
    pub(crate) control: &'a Control<'a>,
}

struct Run {
    x: Vec<f64>,
    value: f64,
    first: f64,
    evaluations: usize,
    history: Vec<Step>,
}

impl Search<'_> {
    /// Searches from `first` (if any) and from as many starts as it takes.
    pub(crate) fn run(&self, first: Option<Vec<f64>>) -> Outcome {
        let mut out = Outcome::default();
        let mut firsts: Vec<f64> = Vec::new();
        let most = self.options.most_starts.max(1);
        let offset = usize::from(first.is_none());
        let mut k = 0;
        'batches: while k < most {
            let size = if k == 0 { 1 } else { BATCH.min(most - k) };
            let known = out.minima.first().cloned();
            let nought = NOUGHT * median(&firsts);
            let starts: Vec<Vec<f64>> = (k..k + size)
                .map(|i| match (&first, i, out.minima.first()) {
                    (Some(x), 0, _) => x.clone(),
                    // After two batches without agreement half of the starts keep part of the best
                    // minimum.
                    (_, i, Some(best)) if i > 2 * BATCH && i % 2 == 0 => self.mixed(&best.x, i),
                    _ => self.drawn(i + offset - 1),
                })
                .collect();
            let one =
                |(i, x): (usize, &Vec<f64>)| self.descend(x.clone(), known.as_ref(), nought, k + i);
            let eager: Vec<Run> = if rayon::current_num_threads() > 1 {
                starts.par_iter().enumerate().map(one).collect()
            } else {
                Vec::new()
            };
            for i in 0..size {
                let lazy;
                let run = match eager.get(i) {
                    Some(run) => run,
                    None => {
                        lazy = one((i, &starts[i]));
                        &lazy
                    }
                };
                out.starts += 1;
                out.evaluations += run.evaluations;
                out.history.extend_from_slice(&run.history);
                if run.value.is_finite() {
                    firsts.push(run.first);
                    out.insert(run.x.clone(), run.value, NOUGHT * median(&firsts), true);
                }
                self.control.report(
                    "search",
                    (out.starts as f64 / self.options.least_starts.max(1) as f64).min(0.99),
                );
                if self.control.is_stopped() {
                    out.stopped = true;
                    break 'batches;
                }
                if self.has_recurred(&out) && self.throw(&mut out, &firsts) {
                    out.certain = true;
                    break 'batches;
                }
            }
            k += size;
        }
        out
    }

    /// The best minimum recurred in independent starts.
    fn has_recurred(&self, out: &Outcome) -> bool {
        out.starts >= self.options.least_starts
            && out
                .minima
                .first()
                .is_some_and(|m| m.hits >= self.options.recurrences)
    }

    /// Throws single primitives of the best minimum elsewhere. True when that keeps leading back
    /// and the rate of return, starts included, promises that a minimum as wide was not missed;
    /// false to go on with starts.
    fn throw(&self, out: &mut Outcome, firsts: &[f64]) -> bool {
        let mut random =
            fastrand::Rng::with_seed(self.options.seed ^ 0x7_4120 ^ ((out.starts as u64) << 32));
        let nought = NOUGHT * median(firsts);
        let mut groups = self.groups(&out.minima[0].x);
        let (mut tried, mut back, mut failures) = (0, 0, 0);
        while tried < MOST_THROWS && !groups.is_empty() && !self.control.is_stopped() {
            let mut x = out.minima[0].x.clone();
            for &i in &groups[failures % groups.len()] {
                x[i] = self.space.start_lo[i]
                    + (self.space.start_hi[i] - self.space.start_lo[i]) * random.f64();
            }
            self.space.into_interior(&mut x, 1e-3);
            let best = out.best();
            let run = self.descend(x, out.minima.first(), nought, out.starts);
            out.evaluations += run.evaluations;
            tried += 1;
            let at = if run.value.is_finite() {
                out.insert(run.x, run.value, nought, false)
            } else {
                usize::MAX
            };
            if at == 0 && best > nought && run.value < best * (1.0 - SAME) {
                // Better: everything found so far was something else.
                (tried, back, failures) = (0, 1, 0);
                out.minima[0].hits = 1;
                groups = self.groups(&out.minima[0].x);
                continue;
            }
            back += usize::from(at == 0);
            failures += 1;
            let total = out.starts + tried;
            let rate = (out.minima[0].hits + back) as f64 / total as f64;
            if failures >= THROWS && (1.0 - rate).powi(total as i32) < self.options.miss {
                return out.minima[0].hits >= 2;
            }
        }
        groups.is_empty()
    }

    /// Free variables by primitive, those of the pieces with the fewest points first: the variables
    /// that a piece's points move.
    pub(crate) fn groups(&self, x: &[f64]) -> Vec<Vec<usize>> {
        let names = self.template.part_names().len();
        let n = self.template.parameters().len();
        let m = self.space.len();
        let mut a = vec![0.0; n];
        self.space.parameters_at(x, &mut a);
        let mut parts = vec![0; self.points.len()];
        self.template.parts(self.points, &a, &mut parts);
        let (mut f, mut jac) = (
            vec![0.0; self.points.len()],
            vec![0.0; self.points.len() * n],
        );
        self.template
            .metric()
            .jacobian(self.points, &a, &mut f, &mut jac);
        let mut count = vec![0_usize; names];
        let mut moved = vec![false; names * m];
        for (p, row) in parts.iter().zip(jac.chunks_exact(n)) {
            let p = *p as usize;
            if p >= names {
                continue;
            }
            count[p] += 1;
            for k in 0..m {
                let d: f64 = self.space.column(k).iter().map(|&(i, c)| c * row[i]).sum();
                moved[p * m + k] |= d.abs() > 1e-6;
            }
        }
        // Variables that move most pieces (a pose) belong to none of them.
        let present = (0..names).filter(|&p| count[p] > 0).count();
        let moves = |k: usize| (0..names).filter(|&p| moved[p * m + k]).count();
        let common: Vec<bool> = (0..m)
            .map(|k| present > 2 && 3 * moves(k) > 2 * present)
            .collect();
        let mut order: Vec<usize> = (0..names).filter(|&p| count[p] > 0).collect();
        order.sort_by_key(|&p| count[p]);
        let mut groups: Vec<Vec<usize>> = Vec::new();
        // Variables that no point moves come first of all: their piece lies away from the data.
        let orphans: Vec<usize> = (0..m).filter(|&k| moves(k) == 0).collect();
        groups.extend(Some(orphans).filter(|o| !o.is_empty()));
        for p in order {
            let group: Vec<usize> = (0..m).filter(|&k| moved[p * m + k] && !common[k]).collect();
            if !group.is_empty() && !groups.contains(&group) {
                groups.push(group);
            }
        }
        groups
    }

    /// One descent; ends early at a minimum that is known, or when it can no longer matter.
    fn descend(&self, x: Vec<f64>, known: Option<&Found>, nought: f64, start: usize) -> Run {
        let mut objective = Residuals::new(self.template.algebraic(), self.points, &[], self.space);
        let (mut first, mut history) = (f64::INFINITY, Vec::new());
        let count = self.points.len().max(1) as f64;
        let mut window = Vec::new();
        let mut arrived = false;
        let settings = lm::Options {
            decrease: 1e-5,
            ..lm::Options::default()
        };
        let mut m = lm::minimize(
            &mut objective,
            x,
            &self.space.lo,
            &self.space.hi,
            &settings,
            &mut |iteration, x, value| {
                if window.is_empty() {
                    first = value;
                }
                window.push(value);
                history.push(Step {
                    start,
                    iteration,
                    rms: (value / count).sqrt(),
                });
                let k = window.len();
                if let Some(known) = known {
                    let is_low = value < NEAR_SUM * known.value
                        || (known.value <= nought && value < 1e-4 * first);
                    arrived = is_low && known.x.iter().zip(x).all(|(u, v)| (u - v).abs() < NEAR);
                    // A run far above the best minimum that has all but stopped falling is not
                    // awaited.
                    if arrived
                        || (k > 10
                            && window[k - 11] - value < 0.02 * value
                            && value > 4.0 * known.value)
                    {
                        return false;
                    }
                }
                value > nought && !self.control.is_stopped()
            },
        );
        if let Some(known) = known.filter(|_| arrived) {
            (m.x, m.value) = (known.x.clone(), known.value);
        }
        Run {
            x: m.x,
            value: m.value,
            first,
            evaluations: m.iterations,
            history,
        }
    }

    /// Start i of the seeded Latin hypercubes: three of four where the data are, one anywhere
    /// within bounds.
    pub(crate) fn drawn(&self, i: usize) -> Vec<f64> {
        let (cube, row) = (i / CUBE, i % CUBE);
        let mut random = fastrand::Rng::with_seed(self.options.seed.wrapping_add(cube as u64));
        let wide = i % 4 == 3;
        let mut order: Vec<usize> = (0..CUBE).collect();
        let mut x: Vec<f64> = (0..self.space.len())
            .map(|k| {
                random.shuffle(&mut order);
                let offsets: [f64; CUBE] = std::array::from_fn(|_| random.f64());
                let u = (order[row] as f64 + offsets[row]) / CUBE as f64;
                let (lo, hi) = if wide {
                    (self.space.lo[k], self.space.hi[k])
                } else {
                    (self.space.start_lo[k], self.space.start_hi[k])
                };
                lo + (hi - lo) * u
            })
            .collect();
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// The best minimum with about half of its primitives thrown elsewhere.
    fn mixed(&self, best: &[f64], i: usize) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(self.options.seed ^ ((i as u64) << 20));
        let mut x = best.to_vec();
        for group in self.groups(best) {
            if random.bool() {
                for k in group {
                    x[k] = self.space.start_lo[k]
                        + (self.space.start_hi[k] - self.space.start_lo[k]) * random.f64();
                }
            }
        }
        self.space.into_interior(&mut x, 1e-3);
        x
    }

    /// The minima worth comparing on more points.
    pub(crate) fn candidates<'o>(&self, out: &'o Outcome) -> &'o [Found] {
        let best = out.best();
        let k = out
            .minima
            .iter()
            .take(CANDIDATES)
            .take_while(|m| m.value <= RIVAL * best)
            .count();
        &out.minima[..k.max(1).min(out.minima.len())]
    }
}

fn median(v: &[f64]) -> f64 {
    if v.is_empty() {
        return 0.0;
    }
    let mut v = v.to_vec();
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}
