//! The state of a fit of points in chunks: the flags of distinct and of fitted points, and a
//! sample.

use super::answer::moments;
use super::bits::Bits;
use super::question::{CellGrid, ChunkQuery, Reading, ResidualRequest, StatisticsQuery};
use super::source::Chunks;
use super::wire::WordReader;
use crate::cells::Cells;
use crate::outliers::{DEVIATION_PER_MEDIAN, MAX_TREE_POINTS};
use crate::polish::Polish;
use crate::report::parts::PartStatistics;
use crate::tally::Tally;
use crate::thresholds::{MAX_BIAS_FEET, MAX_FITTED_POINTS, REPRESENTATIVE_POINTS};
use crate::{FitError, Template};
use isoform_geom::{Aabb, Frame, Point3};

/// A point cloud in chunks, prepared for fits.
pub struct Cloud<'a> {
    chunks: &'a dyn Chunks,
    /// Index of the first point of each chunk among all points.
    starts: Vec<usize>,
    pub(crate) bounds: Aabb,
    /// Flags of the points that do not repeat an earlier one, by chunk.
    distinct: Vec<Bits>,
    count: usize,
    /// Distinct points in the order of their hashes, a random order, at most [`MAX_TREE_POINTS`].
    pub(crate) sample: Vec<Point3>,
    /// Flags of the points that the final fit uses, by chunk.
    fitted: Vec<Bits>,
    n_fitted: usize,
    /// Every n-th of these points in the random order, for the bias.
    pub(crate) strided: Vec<Point3>,
}

/// Robust and ordinary size of residuals.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ResidualSizes {
    /// Robust standard deviation.
    pub(crate) scale: f64,
    /// Root of the sum of the finite squares over the number of all residuals.
    pub(crate) rms: f64,
}

impl ResidualSizes {
    /// Computes the sizes of residuals in memory.
    pub(crate) fn from_residuals(r: &[f64]) -> Self {
        let squares = r.iter().filter(|r| r.is_finite()).map(|r| r * r);
        Self {
            scale: Polish::scale(r),
            rms: (squares.sum::<f64>() / r.len() as f64).sqrt(),
        }
    }
}

impl<'a> Cloud<'a> {
    /// Finds repeated points and draws the sample. `bounds` is the box of all points.
    ///
    /// # Errors
    /// [`FitError::Stopped`] if a chunk does not answer.
    pub fn new(chunks: &'a dyn Chunks, bounds: Aabb, seed: u64) -> Result<Self, FitError> {
        let counts = chunks.counts();
        let mut all = 0;
        let start = |count: &usize| {
            all += count;
            all - count
        };
        let starts = counts.iter().map(start).collect();
        let mut cloud = Self {
            chunks,
            starts,
            bounds,
            distinct: vec![Bits::default(); counts.len()],
            count: all,
            sample: Vec::new(),
            fitted: Vec::new(),
            n_fitted: 0,
            strided: Vec::new(),
        };
        let order = cloud.drop_repeats(seed)?;
        cloud.draw(order)?;
        Ok(cloud)
    }

    /// Returns true if the sample would hold all of `points` points: such a cloud is better read
    /// whole.
    pub fn is_small(points: usize) -> bool {
        points <= MAX_TREE_POINTS
    }

    /// Returns all points of the chunks in order; `None` if a chunk does not answer.
    pub fn gathered(chunks: &dyn Chunks) -> Option<Vec<Point3>> {
        let mut points = Vec::with_capacity(chunks.counts().iter().sum());
        let every = |chunk: usize| (0..chunks.counts()[chunk] as u64).collect();
        let is_whole = chunks.ask(
            None,
            &mut |chunk| Some(ChunkQuery::Points(every(chunk))),
            &mut |_, words| {
                points.extend(words.as_chunks().0.iter().map(|p| p.map(f64::from_bits)));
            },
        );
        is_whole.then_some(points)
    }

    /// Returns the number of distinct points.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Returns the number of points that the final fit uses.
    pub(crate) fn n_fitted(&self) -> usize {
        self.n_fitted
    }

    /// Returns the number of all points, repeated ones included.
    pub(crate) fn n_points(&self) -> usize {
        self.chunks.counts().iter().sum()
    }

    /// Returns the second moments of all points about a centre, row-major; `None` if a chunk does
    /// not answer.
    pub fn moments(chunks: &dyn Chunks, center: Point3) -> Option<[f64; 9]> {
        let mut sums = moments(&[], center);
        let is_whole = ask_all(chunks, None, &ChunkQuery::Moments(center), |mut words| {
            for sum in &mut sums {
                *sum += words.number();
            }
        });
        is_whole.then_some(sums)
    }

    /// Returns the box of all points in the coordinates along the columns of a rotation.
    pub fn extents(chunks: &dyn Chunks, base: &[Point3; 3]) -> Aabb {
        let mut bounds = Aabb::from_points(&[]);
        ask_all(chunks, None, &ChunkQuery::Extents(*base), |words| {
            add_box(&mut bounds, words)
        });
        bounds
    }

    /// Clears the flags of points that equal an earlier one, by equal hashes. Returns the indices
    /// of the others in the order of their hashes, as in [`crate::Scan`].
    fn drop_repeats(&mut self, seed: u64) -> Result<Vec<u32>, FitError> {
        let mut hashes = Vec::with_capacity(self.count);
        let is_whole = ask_all(self.chunks, None, &ChunkQuery::Hashes(seed), |words| {
            hashes.extend_from_slice(words.rest());
        });
        if !is_whole {
            return Err(FitError::Stopped);
        }
        let mut order = by_hash(&hashes);
        let mut repeated = Vec::new();
        let mut last = None;
        order.retain(|&number| {
            let hash = Some(hashes[number as usize]);
            let is_new = last != hash;
            last = hash;
            if !is_new {
                repeated.push(number);
            }
            is_new
        });
        self.count = order.len();
        if !repeated.is_empty() {
            let all = self.chunks.counts().iter().map(|n| Bits::all(*n)).collect();
            self.distinct = self.with(all, &repeated, Bits::clear);
        }
        Ok(order)
    }

    /// Flags the fitted points and gathers the sample, both from the front of the order.
    fn draw(&mut self, mut order: Vec<u32>) -> Result<(), FitError> {
        self.n_fitted = self.count.min(MAX_FITTED_POINTS);
        let fitted = &order[..self.n_fitted];
        let stride = self.n_fitted.div_ceil(MAX_BIAS_FEET).max(1);
        let strided: Vec<u32> = fitted.iter().copied().step_by(stride).collect();
        self.fitted = if self.n_fitted == self.count {
            self.distinct.clone()
        } else {
            let none = self
                .chunks
                .counts()
                .iter()
                .map(|n| Bits::none(*n))
                .collect();
            self.with(none, fitted, Bits::set)
        };
        order.truncate(MAX_TREE_POINTS);
        order.shrink_to_fit();
        let kept = order.len();
        order.extend(strided);
        self.sample = self.picked(&order)?;
        self.strided = self.sample.split_off(kept);
        Ok(())
    }

    /// Returns the chunk of the point with this index among all, and its index in the chunk.
    fn place(&self, number: u32) -> (usize, usize) {
        let chunk = self
            .starts
            .partition_point(|start| *start <= number as usize)
            - 1;
        (chunk, number as usize - self.starts[chunk])
    }

    /// Applies a change to the flags of the points with these indices.
    fn with(
        &self,
        mut flags: Vec<Bits>,
        numbers: &[u32],
        change: impl Fn(&mut Bits, usize),
    ) -> Vec<Bits> {
        for number in numbers {
            let (chunk, place) = self.place(*number);
            change(&mut flags[chunk], place);
        }
        flags
    }

    /// Fetches the points with these indices.
    fn picked(&self, numbers: &[u32]) -> Result<Vec<Point3>, FitError> {
        let mut slots: Vec<u32> = (0..numbers.len() as u32).collect();
        slots.sort_unstable_by_key(|slot| numbers[*slot as usize]);
        let mut places: Vec<Vec<u64>> = vec![Vec::new(); self.chunks.counts().len()];
        for slot in &slots {
            let (chunk, place) = self.place(numbers[*slot as usize]);
            places[chunk].push(place as u64);
        }
        let mut points = vec![[0.0; 3]; numbers.len()];
        let mut slots = slots.into_iter();
        let is_whole = self.chunks.ask(
            None,
            &mut |chunk| {
                let places = std::mem::take(&mut places[chunk]);
                (!places.is_empty()).then_some(ChunkQuery::Points(places))
            },
            &mut |_, words| {
                for (p, slot) in words.as_chunks().0.iter().zip(&mut slots) {
                    points[slot as usize] = p.map(f64::from_bits);
                }
            },
        );
        is_whole.then_some(points).ok_or(FitError::Stopped)
    }
}

/// Sorts indices by their hashes; among equal hashes the first index comes first.
pub(crate) fn by_hash(hashes: &[u64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..hashes.len() as u32).collect();
    order.sort_unstable_by_key(|number| (hashes[*number as usize], *number));
    order
}

impl Cloud<'_> {
    /// Asks every chunk about the residuals of a set of its points.
    pub(super) fn ask_residuals(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        which: PointSet,
        question: impl Fn(ResidualRequest) -> ChunkQuery,
        mut each: impl FnMut(WordReader<'_>),
    ) -> bool {
        let of_chunk = |chunk: usize| {
            question(ResidualRequest {
                reading: asked.0,
                a: asked.1.to_vec(),
                only: self.flags(which)[chunk].clone(),
            })
        };
        self.chunks.ask(
            Some(template),
            &mut |chunk| Some(of_chunk(chunk)),
            &mut |_, words| each(WordReader::new(words)),
        )
    }

    fn flags(&self, which: PointSet) -> &[Bits] {
        match which {
            PointSet::Distinct => &self.distinct,
            PointSet::Fitted => &self.fitted,
        }
    }

    /// Returns the robust standard deviation and the root mean square of residuals. `some` are the
    /// residuals of a sample.
    pub(crate) fn sizes(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        which: PointSet,
        some: &[f64],
    ) -> ResidualSizes {
        let mut sizes = ResidualSizes::default();
        let median = ranked(
            some,
            0.5,
            |n| n / 2,
            |window| {
                let mut told = SizeSums::default();
                let question = |asked| ChunkQuery::Sizes(asked, window, f64::INFINITY);
                self.ask_residuals(template, asked, which, question, |words| told.add(words));
                sizes.rms = (told.squares / f64::max(told.all as f64, 1.0)).sqrt();
                told.found
            },
        );
        sizes.scale = DEVIATION_PER_MEDIAN * median;
        sizes
    }

    /// Returns the sums of squared residuals beyond a limit and within it.
    pub(crate) fn split(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        limit: f64,
    ) -> (f64, f64) {
        let mut told = SizeSums::default();
        // An empty window: only the sums are needed.
        let none = (f64::INFINITY, f64::INFINITY);
        let question = |asked| ChunkQuery::Sizes(asked, none, limit);
        self.ask_residuals(template, asked, PointSet::Distinct, question, |words| {
            told.add(words)
        });
        (told.beyond, told.within)
    }

    /// Returns the box of the fitted points in a frame.
    pub(crate) fn within(&self, frame: &Frame) -> Aabb {
        let mut bounds = Aabb::from_points(&[]);
        self.chunks.ask(
            None,
            &mut |chunk| Some(ChunkQuery::Within(*frame, self.fitted[chunk].clone())),
            &mut |_, words| add_box(&mut bounds, WordReader::new(words)),
        );
        bounds
    }

    /// Counts the fitted points by cell.
    pub(crate) fn counted(&self, cells: &Cells, frame: &Frame) -> Vec<f64> {
        let grid = CellGrid::from_cells(cells, *frame);
        let mut counts = vec![0.0; grid.count.iter().product()];
        self.chunks.ask(
            None,
            &mut |chunk| Some(ChunkQuery::Cells(grid.clone(), self.fitted[chunk].clone())),
            &mut |_, words| {
                for [cell, count] in words.as_chunks().0 {
                    counts[*cell as usize] += f64::from_bits(*count);
                }
            },
        );
        counts
    }

    /// Collects the statistics of all points for a report. The window of the query is found here,
    /// from the distances of some used points.
    pub(crate) fn statistics(
        &self,
        template: &dyn Template,
        telling: &StatisticsQuery,
        some: &[f64],
    ) -> Tally {
        let mut tally = Tally::default();
        let rank = |n: usize| ((0.95 * n as f64).ceil() as usize).clamp(1, n.max(1)) - 1;
        let p95 = ranked(some, 0.95, rank, |window| {
            tally = Tally::new(template.part_names().len());
            self.chunks.ask(
                Some(template),
                &mut |chunk| {
                    Some(ChunkQuery::Statistics(StatisticsQuery {
                        only: self.distinct[chunk].clone(),
                        window,
                        ..telling.clone()
                    }))
                },
                &mut |_, words| tally.add_words(WordReader::new(words)),
            );
            WindowCounts {
                count: tally.n - tally.n_outliers,
                below: tally.below,
                inside: std::mem::take(&mut tally.window),
            }
        });
        tally.p95 = p95;
        tally
    }
}

/// A set of points of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PointSet {
    /// All points, each once.
    Distinct,
    /// The points of the final fit.
    Fitted,
}

/// Counts of numbers relative to a window.
#[derive(Default)]
struct WindowCounts {
    /// Number of all numbers.
    count: usize,
    /// Number of those below the window.
    below: usize,
    /// Numbers in the window.
    inside: Vec<f64>,
}

/// Sums of the chunks' answers about sizes of residuals.
#[derive(Default)]
struct SizeSums {
    all: usize,
    found: WindowCounts,
    /// Sum of the finite squares.
    squares: f64,
    /// Sums of squares beyond and within a limit.
    beyond: f64,
    within: f64,
}

impl SizeSums {
    fn add(&mut self, mut words: WordReader<'_>) {
        let mut next = || words.count();
        self.all += next();
        self.found.count += next();
        self.found.below += next();
        let mut next = || words.number();
        self.squares += next();
        self.beyond += next();
        self.within += next();
        self.found.inside.extend(words.numbers());
    }
}

/// Returns the order statistic with a rank among many numbers. `some` is a sample of them, in which
/// the share `share` is below the wanted number: the numbers in a window around it are fetched
/// first, then all numbers on the side that it turned out to lie on.
fn ranked(
    some: &[f64],
    share: f64,
    rank: impl Fn(usize) -> usize,
    mut ask: impl FnMut((f64, f64)) -> WindowCounts,
) -> f64 {
    let mut window = window(some, share);
    loop {
        let mut found = ask(window);
        let at = rank(found.count);
        if found.count == 0 {
            return 0.0;
        }
        if at < found.below {
            window = (0.0, window.0);
        } else if at - found.below < found.inside.len() {
            let inside = found
                .inside
                .select_nth_unstable_by(at - found.below, f64::total_cmp);
            return *inside.1;
        } else if window.1 < f64::INFINITY {
            window = (window.1, f64::INFINITY);
        } else {
            // Reached only if chunks did not answer.
            return 0.0;
        }
    }
}

/// Returns an interval that contains the quantile `share` of all numbers, estimated from a sample,
/// with six standard deviations of its rank on both sides.
fn window(some: &[f64], share: f64) -> (f64, f64) {
    let sizes = some.iter().map(|r| r.abs()).filter(|r| r.is_finite());
    let mut sizes: Vec<f64> = sizes.take(REPRESENTATIVE_POINTS).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let n = sizes.len() as f64;
    let wide = 6.0 * (n * share * (1.0 - share)).sqrt() + 2.0;
    let lo = n * share - wide;
    let lo = if lo < 0.0 { 0.0 } else { sizes[lo as usize] };
    let hi = sizes.get((n * share + wide) as usize);
    (lo, hi.copied().unwrap_or(f64::INFINITY))
}

/// Asks every chunk one question.
fn ask_all(
    chunks: &dyn Chunks,
    template: Option<&dyn Template>,
    question: &ChunkQuery,
    mut each: impl FnMut(WordReader<'_>),
) -> bool {
    chunks.ask(
        template,
        &mut |_| Some(question.clone()),
        &mut |_, words| each(WordReader::new(words)),
    )
}

/// Extends a box by one that was read.
fn add_box(bounds: &mut Aabb, mut words: WordReader<'_>) {
    let (lo, hi) = (words.point(), words.point());
    for i in 0..3 {
        bounds.lo[i] = bounds.lo[i].min(lo[i]);
        bounds.hi[i] = bounds.hi[i].max(hi[i]);
    }
}

impl Tally {
    /// Adds the answer of a chunk.
    fn add_words(&mut self, mut words: WordReader<'_>) {
        let mut next = || words.count();
        self.n += next();
        self.n_outliers += next();
        self.n_outliers_of_all += next();
        self.below += next();
        let mut next = || words.number();
        self.squares += next();
        self.max = self.max.max(next());
        self.squares_of_all += next();
        self.window.extend(words.numbers());
        let sums = words.numbers();
        self.algebraic.resize(sums.len(), 0.0);
        self.algebraic
            .iter_mut()
            .zip(sums)
            .for_each(|(sum, v)| *sum += v);
        words.word();
        for part in &mut self.parts {
            add_part(part, &mut words);
        }
        words.word();
        for [x, y, z, r] in words.rest().as_chunks().0 {
            let p = [*x, *y, *z].map(f64::from_bits);
            self.far.push((p, f64::from_bits(*r)));
        }
    }
}

/// Adds the sums of a part.
fn add_part(part: &mut PartStatistics, words: &mut WordReader<'_>) {
    part.count += words.count();
    part.rms += words.number();
    part.mean += words.number();
    part.max = part.max.max(words.number());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rank_is_found_wherever_the_sample_says_it_is() {
        let mut random = fastrand::Rng::with_seed(3);
        let all: Vec<f64> = (0..100_000).map(|_| random.f64().powi(3)).collect();
        let mut sorted = all.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        for some in [&all[..20_000], &[0.9; 2000], &[1e-9; 2000], &[], &[0.3]] {
            for share in [0.5, 0.95] {
                let rank = |n: usize| (share * n as f64) as usize;
                let mut rounds = 0;
                let found = ranked(some, share, rank, |(lo, hi)| {
                    rounds += 1;
                    let inside = all.iter().copied().filter(|v| *v >= lo && *v <= hi);
                    WindowCounts {
                        count: all.len(),
                        below: all.iter().filter(|v| **v < lo).count(),
                        inside: inside.collect(),
                    }
                });
                assert_eq!(found, sorted[rank(all.len())]);
                assert!(rounds <= 2, "{rounds}");
            }
        }
    }
}
