//! Point clouds in chunks, of which no process holds all points.
//!
//! A fit needs sums, boxes and order statistics of all its points and, for the search and for
//! everything about neighbours, a sample in a random order. [`Chunks`] evaluate one [`ChunkQuery`]
//! at a time: each chunk does so with [`evaluate_chunk`], on any machine, and the answers are added
//! in the order of the chunks. The sample, the points of the final fit and every decision are equal
//! to those of a fit of the whole cloud; sums differ by rounding, and order statistics are exact.
//!
//! ```text
//!   Cloud ──ChunkQuery──> Chunks ──> evaluate_chunk(query, points of a chunk, template)
//!     ^                                  │
//!     └─── sum in the order of chunks ───┘
//! ```
//!
//! The random order is that of a hash of each point. The sample therefore depends neither on the
//! order of the points nor on their division into chunks. Equal points, also of different chunks,
//! count once; they have equal hashes, of 64 bits. In addition to the sample a cloud keeps twelve
//! bytes per point until the sample is drawn, then one or two bits per point if some of the points
//! are left out.

mod answer;
mod bits;
mod cloud;
mod question;
mod source;
mod sums;
mod wire;

pub(crate) use self::answer::hash;
pub use self::answer::{along, decode_count_and_bounds, evaluate_chunk, moments};
pub use self::bits::Bits;
pub use self::cloud::Cloud;
pub(crate) use self::cloud::{PointSet, ResidualSizes, by_hash};
pub use self::question::{
    CellGrid, ChunkQuery, LossWeights, Mask, Reading, ResidualRequest, StatisticsQuery,
};
pub use self::source::Chunks;
pub(crate) use self::sums::ChunkSums;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Template;
    use crate::polish::{InMemorySums, PolishSums};
    use crate::space::Space;
    use crate::tally::Tally;
    use crate::vector::distance;
    use crate::{Kind, Loss, Objective, Parameter};
    use isoform_geom::{Aabb, ParamField, Point3, norm, sub};

    /// A ball, r − |p − c| with a = (c, r).
    struct Ball {
        parameters: Vec<Parameter>,
        names: Vec<String>,
    }

    impl ParamField for Ball {
        fn dim(&self) -> usize {
            4
        }
        fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
            for (p, f) in points.iter().zip(out) {
                *f = a[3] - norm(sub(*p, [a[0], a[1], a[2]]));
            }
        }
        fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], g: &mut [Point3]) {
            self.values(points, a, out);
            for (p, g) in points.iter().zip(g) {
                let d = sub(*p, [a[0], a[1], a[2]]);
                *g = d.map(|v| -v / norm(d));
            }
        }
        fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
            let mut g = vec![[0.0; 3]; points.len()];
            self.gradients(points, a, out, &mut g);
            for (row, g) in jac.chunks_exact_mut(4).zip(g) {
                row.copy_from_slice(&[-g[0], -g[1], -g[2], 1.0]);
            }
        }
    }

    impl Template for Ball {
        fn parameters(&self) -> &[Parameter] {
            &self.parameters
        }
        fn algebraic(&self) -> &dyn ParamField {
            self
        }
        fn metric(&self) -> &dyn ParamField {
            self
        }
        fn part_names(&self) -> &[String] {
            &self.names
        }
        fn parts(&self, points: &[Point3], _: &[f64], out: &mut [u32]) {
            let upper = |p: &Point3| u32::from(p[2] > 0.0);
            out.iter_mut()
                .zip(points)
                .for_each(|(out, p)| *out = upper(p));
        }
    }

    fn ball() -> Ball {
        let kinds = [
            ("x", Kind::X),
            ("y", Kind::Y),
            ("z", Kind::Z),
            ("r", Kind::Length),
        ];
        Ball {
            parameters: kinds.map(|(name, kind)| Parameter::new(name, kind)).into(),
            names: vec!["lower".into(), "upper".into()],
        }
    }

    /// Points near a ball, some of them far off.
    fn points(count: usize) -> Vec<Point3> {
        let mut random = fastrand::Rng::with_seed(11);
        let mut point = || -> Point3 { std::array::from_fn(|_| 2.0 * random.f64() - 1.0) };
        let mut points = Vec::new();
        while points.len() < count {
            let p = point();
            let (l, k) = (norm(p), points.len() as f64);
            if l > 0.1 && l < 1.0 {
                let r = if points.len() % 50 == 0 {
                    1.3
                } else {
                    1.0 + 0.01 * (k * 0.7).sin()
                };
                points.push(p.map(|v| r * v / l));
            }
        }
        points
    }

    /// Chunks in memory.
    struct Pieces<'a> {
        template: &'a Ball,
        chunks: Vec<Vec<Point3>>,
        counts: Vec<usize>,
    }

    impl<'a> Pieces<'a> {
        /// Cuts points at ascending indices.
        fn new(template: &'a Ball, points: &[Point3], cuts: &[usize]) -> Self {
            let ends = cuts.iter().copied().chain([points.len()]);
            let mut start = 0;
            let chunks: Vec<Vec<Point3>> = ends
                .map(|end| points[std::mem::replace(&mut start, end)..end].to_vec())
                .collect();
            Self {
                template,
                counts: chunks.iter().map(Vec::len).collect(),
                chunks,
            }
        }
    }

    impl Chunks for Pieces<'_> {
        fn counts(&self) -> &[usize] {
            &self.counts
        }
        fn ask(
            &self,
            _: Option<&dyn Template>,
            question: &mut dyn FnMut(usize) -> Option<ChunkQuery>,
            each: &mut dyn FnMut(usize, &[u64]),
        ) -> bool {
            for (k, points) in self.chunks.iter().enumerate() {
                let Some(asked) = question(k) else { continue };
                let sent = ChunkQuery::from_words(&asked.to_words()).expect("what was sent");
                assert_eq!(sent, asked);
                each(k, &evaluate_chunk(&sent, points, self.template));
            }
            true
        }
    }

    const A: [f64; 4] = [0.02, -0.01, 0.03, 1.01];

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-12 * (1.0 + a.abs()), "{a} {b}");
    }

    #[test]
    fn sums_over_any_chunks_are_those_of_the_whole() {
        let (ball, all) = (ball(), points(9000));
        let bounds = Aabb::from_points(&all);
        let space = Space::new(&ball.parameters, &[], bounds).expect("a space");
        let x = space.variables_at(&A);
        let moved = space.variables_at(&[0.0, 0.0, 0.01, 1.0]);
        let here = InMemorySums {
            field: &ball,
            space: &space,
            points: &all,
            mask: &[],
        };
        let some = |a: &[f64]| {
            let mut r = vec![0.0; 500];
            ball.values(&all[..500], a, &mut r);
            r
        };
        for cuts in [&[][..], &[1, 1, 4000], &[3000, 6000, 9000]] {
            let pieces = Pieces::new(&ball, &all, cuts);
            let cloud = Cloud::new(&pieces, bounds, 1).expect("answers");
            let sums = ChunkSums {
                cloud: &cloud,
                template: &ball,
                space: &space,
                mask: Mask::default(),
                some: &some,
            };
            let scale = |seen: Option<f64>| seen.unwrap_or(0.02);
            for is_free in [true, false] {
                let (s, mut whole) = here.reweighted(&x, Loss::Tukey, &scale, is_free);
                let (t, mut parts) = sums.reweighted(&x, Loss::Tukey, &scale, is_free);
                assert_eq!(s, t);
                same_models(&mut *whole, &mut *parts, &moved);
            }
            same_models(&mut *here.squares(), &mut *sums.squares(), &x);
            let (a, b) = (here.losses([&x, &moved]), sums.losses([&x, &moved]));
            (0..2).for_each(|k| near(a[k], b[k]));
        }
    }

    fn same_models<'a>(whole: &'a mut dyn Objective, parts: &'a mut dyn Objective, x: &[f64]) {
        near(whole.value(x), parts.value(x));
        let models = [whole, parts].map(|objective| {
            let (mut g, mut h) = (vec![0.0; 4], vec![0.0; 16]);
            let value = objective.model(x, &mut g, &mut h);
            (value, g, h)
        });
        let [(v, g, h), (w, k, l)] = models;
        near(v, w);
        assert!(distance(&g, &k) < 1e-11 && distance(&h, &l) < 1e-10);
    }

    #[test]
    fn statistics_of_any_chunks_are_those_of_the_whole() {
        let (ball, all) = (ball(), points(9000));
        let mut r = vec![0.0; all.len()];
        ball.values(&all, &A, &mut r);
        let telling = StatisticsQuery {
            a: A.to_vec(),
            only: Bits::default(),
            limit: 0.2,
            far: 0.03,
            size: 1.0,
            window: (0.0, f64::INFINITY),
            minima: vec![A.to_vec(), vec![0.0, 0.0, 0.0, 1.0]],
        };
        let statistics = |cuts: &[usize]| -> Tally {
            let pieces = Pieces::new(&ball, &all, cuts);
            let cloud = Cloud::new(&pieces, Aabb::from_points(&all), 1).expect("answers");
            let sizes = cloud.sizes(&ball, (Reading::Metric, &A), PointSet::Distinct, &r[..300]);
            assert_eq!(sizes.scale, ResidualSizes::from_residuals(&r).scale);
            near(sizes.rms, ResidualSizes::from_residuals(&r).rms);
            cloud.statistics(&ball, &telling, &r[..300])
        };
        let whole = statistics(&[]);
        assert_eq!((whole.n, whole.n_outliers), (9000, 180));
        for cuts in [&[5, 5, 7000][..], &[4500]] {
            let parts = statistics(cuts);
            assert_eq!(parts.far, whole.far);
            assert_eq!(
                (parts.n_outliers, parts.p95, parts.max),
                (180, whole.p95, whole.max)
            );
            near(parts.squares, whole.squares);
            (0..2).for_each(|k| near(parts.algebraic[k], whole.algebraic[k]));
            for (part, its) in parts.parts.iter().zip(&whole.parts) {
                assert_eq!(part.count, its.count);
                near(part.rms, its.rms);
            }
        }
    }

    #[test]
    fn repeats_count_once_and_no_order_decides_who_is_in_the_sample() {
        let (ball, mut all) = (ball(), points(3000));
        // A copy of some points, in another chunk; the two zeros are equal.
        let copied = all[100..200].to_vec();
        all.extend_from_slice(&copied);
        all.extend([[0.0, 1.0, 0.0], [-0.0, 1.0, 0.0]]);
        let sample = |points: &[Point3], cuts: &[usize]| {
            let pieces = Pieces::new(&ball, points, cuts);
            let cloud = Cloud::new(&pieces, Aabb::from_points(points), 1).expect("answers");
            assert_eq!((cloud.n_points(), cloud.count()), (3102, 3001));
            assert_eq!(cloud.strided.len(), 3001);
            cloud.sample
        };
        let whole = sample(&all, &[]);
        assert_eq!(sample(&all, &[150, 2500, 2500, 3050]), whole);
        all.reverse();
        assert_eq!(sample(&all, &[1000]), whole);
    }
}
