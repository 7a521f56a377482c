//! Evaluation of a query on the points of a chunk.

use super::bits::Bits;
use super::question::{
    CellGrid, ChunkQuery, LossWeights, Mask, Reading, ResidualRequest, StatisticsQuery,
};
use super::wire::{WordReader, WordWriter};
use crate::feet::CachedFeet;
use crate::point_distances::{PointDistances, measure_points};
use crate::polish::{tukey_sum, weights};
use crate::report::parts::PartStatistics;
use crate::residuals::{normal_equations, sum_of_squares, values};
use crate::tally::Tally;
use crate::template::Template;
use isoform_geom::{Aabb, ParamField, Point3};
use std::borrow::Cow;

/// Evaluates a question about a template on the points of a chunk. Returns the answer as words.
pub fn evaluate_chunk(
    question: &ChunkQuery,
    points: &[Point3],
    template: &dyn Template,
) -> Vec<u64> {
    let mut out = WordWriter::default();
    let chunk = ChunkEvaluator {
        points,
        template,
        distance: template.distance().map(CachedFeet::new),
    };
    match question {
        ChunkQuery::Look => {
            out.count(points.len());
            out.bounds(Aabb::from_points(points));
        }
        ChunkQuery::Hashes(seed) => points.iter().for_each(|p| out.word(hash(p, *seed))),
        ChunkQuery::Points(at) => at.iter().for_each(|i| out.point(points[*i as usize])),
        ChunkQuery::Moments(center) => out.each(&moments(points, *center)),
        ChunkQuery::Extents(base) => out.bounds(box_of(points.iter().map(|p| along(base, p)))),
        ChunkQuery::Within(frame, only) => {
            let chosen = chunk.chosen(only);
            out.bounds(box_of(chosen.iter().map(|p| frame.within(*p))));
        }
        ChunkQuery::Cells(grid, only) => out.cells(&grid.counted(&chunk.chosen(only))),
        ChunkQuery::Sizes(asked, window, limit) => chunk.sizes(asked, *window, *limit, &mut out),
        ChunkQuery::Sum(asked, by, mask) => chunk.sum(asked, by.as_ref(), mask, &mut out),
        ChunkQuery::Normal(asked, by, mask) => chunk.normal(asked, by.as_ref(), mask, &mut out),
        ChunkQuery::Losses(asked, scale, mask) => chunk.losses(asked, *scale, mask, &mut out),
        ChunkQuery::Statistics(telling) => chunk.statistics(telling, &mut out),
    }
    out.0
}

/// Decodes the number and the box of the points of a chunk from its answer to [`ChunkQuery::Look`].
pub fn decode_count_and_bounds(words: &[u64]) -> (usize, Aabb) {
    let mut words = WordReader::new(words);
    let count = words.count();
    let (lo, hi) = (words.point(), words.point());
    (count, Aabb { lo, hi })
}

/// Returns a hash of a point; equal for both zeros.
pub(crate) fn hash(p: &Point3, seed: u64) -> u64 {
    // The finaliser of splitmix64 after each coordinate.
    p.iter().fold(seed ^ 0x9E37_79B9_7F4A_7C15, |hash, v| {
        let mut z = hash ^ (v + 0.0).to_bits();
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)).wrapping_add(0x9E37_79B9_7F4A_7C15)
    })
}

/// Returns Σ (p − c)(p − c)ᵀ, row-major.
pub fn moments(points: &[Point3], center: Point3) -> [f64; 9] {
    let mut moments = [0.0; 9];
    for p in points {
        let d = isoform_geom::sub(*p, center);
        for i in 0..3 {
            for j in 0..3 {
                moments[3 * i + j] += d[i] * d[j];
            }
        }
    }
    moments
}

/// Returns the coordinates of a point along the columns of a rotation.
pub fn along(base: &[Point3; 3], p: &Point3) -> Point3 {
    std::array::from_fn(|j| (0..3).map(|i| base[i][j] * p[i]).sum())
}

/// Returns the bounding box of points without storing them.
fn box_of(points: impl Iterator<Item = Point3>) -> Aabb {
    let mut bounds = Aabb::from_points(&[]);
    for p in points {
        for i in 0..3 {
            bounds.lo[i] = bounds.lo[i].min(p[i]);
            bounds.hi[i] = bounds.hi[i].max(p[i]);
        }
    }
    bounds
}

impl WordWriter {
    fn bounds(&mut self, bounds: Aabb) {
        self.point(bounds.lo);
        self.point(bounds.hi);
    }

    /// Writes the indices and counts of the cells that are not empty.
    fn cells(&mut self, counts: &[f64]) {
        for (cell, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            self.count(cell);
            self.number(*count);
        }
    }
}

/// A chunk with the template of a question.
struct ChunkEvaluator<'a> {
    points: &'a [Point3],
    template: &'a dyn Template,
    distance: Option<CachedFeet<'a>>,
}

impl ChunkEvaluator<'_> {
    /// Returns the flagged points.
    fn chosen(&self, only: &Bits) -> Cow<'_, [Point3]> {
        if *only == Bits::default() {
            return Cow::Borrowed(self.points);
        }
        Cow::Owned(only.chosen(self.points.to_vec()))
    }

    fn field(&self, reading: Reading) -> &dyn ParamField {
        match (reading, &self.distance) {
            (Reading::Algebraic, _) => self.template.algebraic(),
            (Reading::Distance, Some(distance)) => distance,
            (Reading::Metric | Reading::Distance, _) => self.template.metric(),
        }
    }

    fn measured(&self, points: &[Point3], a: &[f64]) -> PointDistances {
        measure_points(self.template, self.distance.as_ref(), points, a)
    }

    fn residuals(&self, reading: Reading, points: &[Point3], a: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; points.len()];
        values(self.field(reading), points, a, &mut r);
        r
    }

    /// Returns 0 for points on open parts and 1 for others; empty if all are 1.
    fn masked(&self, points: &[Point3], mask: &Mask) -> Vec<f64> {
        if !mask.open.contains(&true) {
            return Vec::new();
        }
        self.measured(points, &mask.a).mask(&mask.open)
    }

    /// Returns a weight per point; empty if all are 1.
    fn weights(
        &self,
        points: &[Point3],
        reading: Reading,
        by: Option<&LossWeights>,
        mask: &Mask,
    ) -> Vec<f64> {
        let mask = self.masked(points, mask);
        match by {
            None => mask,
            Some(by) => {
                let r = self.residuals(reading, points, &by.a);
                weights(&r, by.scale, by.loss, &mask)
            }
        }
    }

    fn sizes(&self, asked: &ResidualRequest, window: (f64, f64), limit: f64, out: &mut WordWriter) {
        let points = self.chosen(&asked.only);
        let r = self.residuals(asked.reading, &points, &asked.a);
        let finite = || r.iter().map(|r| r.abs()).filter(|r| r.is_finite());
        let (mut strays, mut others) = (0.0, 0.0);
        for r in r.iter().filter(|r| !r.is_nan()) {
            let sum = if r.abs() > limit {
                &mut strays
            } else {
                &mut others
            };
            *sum += r * r;
        }
        out.count(r.len());
        out.count(finite().count());
        out.count(finite().filter(|r| *r < window.0).count());
        out.number(finite().map(|r| r * r).sum());
        out.number(strays);
        out.number(others);
        let inside: Vec<f64> = finite().filter(|r| is_in(*r, window)).collect();
        out.numbers(&inside);
    }

    fn sum(
        &self,
        asked: &ResidualRequest,
        by: Option<&LossWeights>,
        mask: &Mask,
        out: &mut WordWriter,
    ) {
        let points = self.chosen(&asked.only);
        let weights = self.weights(&points, asked.reading, by, mask);
        let field = self.field(asked.reading);
        out.number(sum_of_squares(field, &points, &weights, &asked.a));
    }

    fn normal(
        &self,
        asked: &ResidualRequest,
        by: Option<&LossWeights>,
        mask: &Mask,
        out: &mut WordWriter,
    ) {
        let points = self.chosen(&asked.only);
        let weights = self.weights(&points, asked.reading, by, mask);
        let field = self.field(asked.reading);
        let n = field.dim();
        let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * n]);
        let sum = normal_equations(field, &points, &weights, &asked.a, &mut g, &mut h);
        out.number(sum);
        out.numbers(&g);
        out.numbers(&h);
    }

    fn losses(&self, asked: &ResidualRequest, scale: f64, mask: &Mask, out: &mut WordWriter) {
        let points = self.chosen(&asked.only);
        let r = self.residuals(asked.reading, &points, &asked.a);
        out.number(tukey_sum(&r, &self.masked(&points, mask), scale));
    }

    fn statistics(&self, telling: &StatisticsQuery, out: &mut WordWriter) {
        let mut tally = Tally::new(self.template.part_names().len());
        tally.algebraic.resize(telling.minima.len(), 0.0);
        // Blocks bound the memory for nearest points.
        let size = 1 << 14;
        for (block, points) in self.points.chunks(size).enumerate() {
            let is_asked = |i: usize| telling.only.is_set(block * size + i);
            self.add_block(points, &is_asked, telling, &mut tally);
        }
        out.tally(&tally);
    }

    /// Adds the statistics of a block of points.
    fn add_block(
        &self,
        points: &[Point3],
        is_asked: &dyn Fn(usize) -> bool,
        telling: &StatisticsQuery,
        tally: &mut Tally,
    ) {
        let measured = self.measured(points, &telling.a);
        let is_outlier = |r: f64| !r.is_finite() || r.abs() > telling.limit;
        let mut used = Vec::with_capacity(points.len());
        let all = points.iter().zip(&measured.residuals).zip(&measured.pieces);
        for (i, ((p, r), met)) in all.enumerate() {
            let is_out = is_outlier(*r);
            tally.n_outliers_of_all += usize::from(is_out);
            if !is_asked(i) {
                continue;
            }
            tally.add(*r, is_out, met[0], telling.size);
            if r.abs() > telling.far || !r.is_finite() {
                tally.far.push((*p, *r));
            }
            if !is_out {
                used.push(*p);
                tally.below += usize::from(r.abs() < telling.window.0);
                tally
                    .window
                    .extend(Some(r.abs()).filter(|r| is_in(*r, telling.window)));
            }
        }
        let field = self.template.algebraic();
        for (sum, a) in tally.algebraic.iter_mut().zip(&telling.minima) {
            *sum += sum_of_squares(field, &used, &[], a);
        }
    }
}

/// Returns true if a number is in a closed interval.
fn is_in(v: f64, window: (f64, f64)) -> bool {
    v >= window.0 && v <= window.1
}

impl WordWriter {
    fn tally(&mut self, tally: &Tally) {
        let counts = [
            tally.n,
            tally.n_outliers,
            tally.n_outliers_of_all,
            tally.below,
        ];
        counts.into_iter().for_each(|count| self.count(count));
        self.each(&[tally.squares, tally.max, tally.squares_of_all]);
        self.numbers(&tally.window);
        self.numbers(&tally.algebraic);
        self.count(tally.parts.len());
        for PartStatistics {
            count,
            rms,
            mean,
            max,
            ..
        } in &tally.parts
        {
            self.count(*count);
            self.each(&[*rms, *mean, *max]);
        }
        self.count(tally.far.len());
        for (p, r) in &tally.far {
            self.point(*p);
            self.number(*r);
        }
    }
}

impl CellGrid {
    /// Counts points by cell.
    fn counted(&self, points: &[Point3]) -> Vec<f64> {
        let cells = self.cells();
        let within: Vec<Point3> = points.iter().map(|p| self.frame.within(*p)).collect();
        cells.counted(&within)
    }
}
