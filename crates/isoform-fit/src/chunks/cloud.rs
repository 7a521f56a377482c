//! What a fit keeps of points in chunks: which of them count, a sample, and which are fitted.

use super::Chunks;
use super::answer::moments;
use super::bits::Bits;
use super::question::{Asked, Grid, Question, Reading, Telling};
use super::words::Reader;
use crate::bias::{Cells, MOST_FEET};
use crate::outliers::{MOST, NORMAL};
use crate::polish::Polish;
use crate::report::{PartStatistics, SAMPLED, Tally};
use crate::settle::MOST_FITTED;
use crate::{FitError, Template};
use isoform_geom::{Aabb, Frame, Point3};

/// Deviations of such a statistic by which the window around it is wider than the sample says.
const WIDE: f64 = 6.0;

/// Points in chunks, made ready to be fitted.
pub struct Cloud<'a> {
    chunks: &'a dyn Chunks,
    /// The number of the first point of each chunk.
    starts: Vec<usize>,
    pub(crate) bounds: Aabb,
    /// The first point of its kind, by chunk.
    distinct: Vec<Bits>,
    count: usize,
    /// Distinct points in the order of their hashes, a random one, as many as are kept.
    pub(crate) sample: Vec<Point3>,
    /// Points that settle the fit, by chunk.
    fitted: Vec<Bits>,
    n_fitted: usize,
    /// Some of those, as evenly spread in the random order as the bias asks for.
    pub(crate) strided: Vec<Point3>,
}

/// How sizes of residuals are spread.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sizes {
    /// Their robust standard deviation.
    pub(crate) scale: f64,
    /// Root of the sum of the finite squares over the number of all.
    pub(crate) rms: f64,
}

impl Sizes {
    /// Of residuals at hand.
    pub(crate) fn of(r: &[f64]) -> Self {
        let squares = r.iter().filter(|r| r.is_finite()).map(|r| r * r);
        Self {
            scale: Polish::scale(r),
            rms: (squares.sum::<f64>() / r.len() as f64).sqrt(),
        }
    }
}

impl<'a> Cloud<'a> {
    /// Looks for repeated points and draws the sample. `bounds` is the box of all points.
    ///
    /// # Errors
    /// [`FitError::Stopped`] where a chunk does not answer.
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

    /// Whether a cloud of so many points is gathered instead: the sample would hold them all.
    pub fn is_small(points: usize) -> bool {
        points <= MOST
    }

    /// All points of chunks, in order; none where a chunk does not answer.
    pub fn gathered(chunks: &dyn Chunks) -> Option<Vec<Point3>> {
        let mut points = Vec::with_capacity(chunks.counts().iter().sum());
        let every = |chunk: usize| (0..chunks.counts()[chunk] as u64).collect();
        let is_whole = chunks.ask(
            None,
            &mut |chunk| Some(Question::Points(every(chunk))),
            &mut |_, words| {
                points.extend(words.as_chunks().0.iter().map(|p| p.map(f64::from_bits)));
            },
        );
        is_whole.then_some(points)
    }

    /// Distinct points.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Points that settle the fit.
    pub(crate) fn n_fitted(&self) -> usize {
        self.n_fitted
    }

    /// Points, repeated ones included.
    pub(crate) fn n_points(&self) -> usize {
        self.chunks.counts().iter().sum()
    }

    /// Second moments of all points about a centre, by rows; none where a chunk does not answer.
    pub fn moments(chunks: &dyn Chunks, center: Point3) -> Option<[f64; 9]> {
        let mut sums = moments(&[], center);
        let is_whole = ask_all(chunks, None, &Question::Moments(center), |mut words| {
            for sum in &mut sums {
                *sum += words.number();
            }
        });
        is_whole.then_some(sums)
    }

    /// The box of all points along the columns of a rotation.
    pub fn extents(chunks: &dyn Chunks, base: &[Point3; 3]) -> Aabb {
        let mut bounds = Aabb::of(&[]);
        ask_all(chunks, None, &Question::Extents(*base), |words| {
            add_box(&mut bounds, words)
        });
        bounds
    }

    /// Leaves out points that are equal to an earlier one, those with equal hashes; the numbers of
    /// the others in the order of their hashes, as [`crate::Scan`] has it.
    fn drop_repeats(&mut self, seed: u64) -> Result<Vec<u32>, FitError> {
        let mut hashes = Vec::with_capacity(self.count);
        let is_whole = ask_all(self.chunks, None, &Question::Hashes(seed), |words| {
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

    /// Gathers what is kept of the order.
    fn draw(&mut self, mut order: Vec<u32>) -> Result<(), FitError> {
        self.n_fitted = self.count.min(MOST_FITTED);
        let fitted = &order[..self.n_fitted];
        let stride = self.n_fitted.div_ceil(MOST_FEET).max(1);
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
        order.truncate(MOST);
        order.shrink_to_fit();
        let kept = order.len();
        order.extend(strided);
        self.sample = self.picked(&order)?;
        self.strided = self.sample.split_off(kept);
        Ok(())
    }

    /// The chunk and the place in it of a point with this number among all.
    fn place(&self, number: u32) -> (usize, usize) {
        let chunk = self
            .starts
            .partition_point(|start| *start <= number as usize)
            - 1;
        (chunk, number as usize - self.starts[chunk])
    }

    /// Flags that are changed for the points with these numbers.
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

    /// The points with these numbers.
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
                (!places.is_empty()).then_some(Question::Points(places))
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

/// Numbers in the order of their hashes, the first of equal ones first.
pub(crate) fn by_hash(hashes: &[u64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..hashes.len() as u32).collect();
    order.sort_unstable_by_key(|number| (hashes[*number as usize], *number));
    order
}

impl Cloud<'_> {
    /// Asks every chunk about residuals: all that count, or those that are fitted.
    pub(super) fn ask_residuals(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        which: Which,
        question: impl Fn(Asked) -> Question,
        mut each: impl FnMut(Reader<'_>),
    ) -> bool {
        let of_chunk = |chunk: usize| {
            question(Asked {
                reading: asked.0,
                a: asked.1.to_vec(),
                only: self.flags(which)[chunk].clone(),
            })
        };
        self.chunks.ask(
            Some(template),
            &mut |chunk| Some(of_chunk(chunk)),
            &mut |_, words| each(Reader::new(words)),
        )
    }

    fn flags(&self, which: Which) -> &[Bits] {
        match which {
            Which::Distinct => &self.distinct,
            Which::Fitted => &self.fitted,
        }
    }

    /// Robust standard deviation of residuals, and their root mean square. `some` are those of a
    /// sample.
    pub(crate) fn sizes(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        which: Which,
        some: &[f64],
    ) -> Sizes {
        let mut sizes = Sizes::default();
        let median = ranked(
            some,
            0.5,
            |n| n / 2,
            |window| {
                let mut told = SizesTold::default();
                let question = |asked| Question::Sizes(asked, window, f64::INFINITY);
                self.ask_residuals(template, asked, which, question, |words| told.add(words));
                sizes.rms = (told.squares / f64::max(told.all as f64, 1.0)).sqrt();
                told.found
            },
        );
        sizes.scale = NORMAL * median;
        sizes
    }

    /// Sums of squares of residuals beyond a limit and within it.
    pub(crate) fn split(
        &self,
        template: &dyn Template,
        asked: (Reading, &[f64]),
        limit: f64,
    ) -> (f64, f64) {
        let mut told = SizesTold::default();
        // No size is in a window above all of them.
        let none = (f64::INFINITY, f64::INFINITY);
        let question = |asked| Question::Sizes(asked, none, limit);
        self.ask_residuals(template, asked, Which::Distinct, question, |words| {
            told.add(words)
        });
        (told.beyond, told.within)
    }

    /// The box of the fitted points in a frame.
    pub(crate) fn within(&self, frame: &Frame) -> Aabb {
        let mut bounds = Aabb::of(&[]);
        self.chunks.ask(
            None,
            &mut |chunk| Some(Question::Within(*frame, self.fitted[chunk].clone())),
            &mut |_, words| add_box(&mut bounds, Reader::new(words)),
        );
        bounds
    }

    /// The fitted points by cell.
    pub(crate) fn counted(&self, cells: &Cells, frame: &Frame) -> Vec<f64> {
        let grid: Grid = cells.grid(*frame);
        let mut counts = vec![0.0; grid.count.iter().product()];
        self.chunks.ask(
            None,
            &mut |chunk| Some(Question::Cells(grid.clone(), self.fitted[chunk].clone())),
            &mut |_, words| {
                for [cell, count] in words.as_chunks().0 {
                    counts[*cell as usize] += f64::from_bits(*count);
                }
            },
        );
        counts
    }

    /// What a report needs of all points. `telling` says of which; its window is found here, from
    /// the distances of some points used.
    pub(crate) fn told(&self, template: &dyn Template, telling: &Telling, some: &[f64]) -> Tally {
        let mut tally = Tally::default();
        let rank = |n: usize| ((0.95 * n as f64).ceil() as usize).clamp(1, n.max(1)) - 1;
        let p95 = ranked(some, 0.95, rank, |window| {
            tally = Tally::new(template.part_names().len());
            self.chunks.ask(
                Some(template),
                &mut |chunk| {
                    Some(Question::Told(Telling {
                        only: self.distinct[chunk].clone(),
                        window,
                        ..telling.clone()
                    }))
                },
                &mut |_, words| tally.add_words(Reader::new(words)),
            );
            Found {
                count: tally.n - tally.n_outliers,
                below: tally.below,
                inside: std::mem::take(&mut tally.window),
            }
        });
        tally.p95 = p95;
        tally
    }
}

/// Points that are asked about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Which {
    /// All, each once.
    Distinct,
    /// Those that settle the fit.
    Fitted,
}

/// What was found with a window.
#[derive(Default)]
struct Found {
    /// Numbers there are.
    count: usize,
    /// Those below the window.
    below: usize,
    /// Those in it.
    inside: Vec<f64>,
}

/// What chunks say of sizes of residuals.
#[derive(Default)]
struct SizesTold {
    all: usize,
    found: Found,
    /// Sum of the finite squares.
    squares: f64,
    /// Sums of squares beyond and within a limit.
    beyond: f64,
    within: f64,
}

impl SizesTold {
    fn add(&mut self, mut words: Reader<'_>) {
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

/// The number of a rank among many, of which the same share is below it as below a place of
/// `some`: those within a window there are asked for, then all beyond it if they miss it.
fn ranked(
    some: &[f64],
    share: f64,
    rank: impl Fn(usize) -> usize,
    mut ask: impl FnMut((f64, f64)) -> Found,
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
            // Only where chunks did not answer.
            return 0.0;
        }
    }
}

/// Where the number lies that a share of all are below, as some of them say.
fn window(some: &[f64], share: f64) -> (f64, f64) {
    let sizes = some.iter().map(|r| r.abs()).filter(|r| r.is_finite());
    let mut sizes: Vec<f64> = sizes.take(SAMPLED).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let n = sizes.len() as f64;
    let wide = WIDE * (n * share * (1.0 - share)).sqrt() + 2.0;
    let lo = n * share - wide;
    let lo = if lo < 0.0 { 0.0 } else { sizes[lo as usize] };
    let hi = sizes.get((n * share + wide) as usize);
    (lo, hi.copied().unwrap_or(f64::INFINITY))
}

/// Asks every chunk the same.
fn ask_all(
    chunks: &dyn Chunks,
    template: Option<&dyn Template>,
    question: &Question,
    mut each: impl FnMut(Reader<'_>),
) -> bool {
    chunks.ask(
        template,
        &mut |_| Some(question.clone()),
        &mut |_, words| each(Reader::new(words)),
    )
}

/// Adds a box to one.
fn add_box(bounds: &mut Aabb, mut words: Reader<'_>) {
    let (lo, hi) = (words.point(), words.point());
    for i in 0..3 {
        bounds.lo[i] = bounds.lo[i].min(lo[i]);
        bounds.hi[i] = bounds.hi[i].max(hi[i]);
    }
}

impl Tally {
    /// Adds what a chunk told.
    fn add_words(&mut self, mut words: Reader<'_>) {
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
fn add_part(part: &mut PartStatistics, words: &mut Reader<'_>) {
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
                    Found {
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
