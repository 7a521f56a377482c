//! Profiles: plane points along curves, divided into straight pieces and arcs.
//!
//! The points of a body of revolution lie along curves when they are rotated about its axis into
//! one half plane. Points are ordered along these curves, and the pieces with the shortest
//! description of a whole sequence are found by dynamic programming: narrow faces compete with all
//! others at once, instead of growing from seeds within noise.

use crate::chart::PrimitiveKind;
use crate::choose::least_points;
use crate::segment::MIN_EVIDENCE;
use chains::{ChainLink, chains};
use fillet::fill;
use moments::Moments;
use std::ops::Range;

mod chains;
mod curve;
mod fillet;
mod moments;
mod piece;

pub(crate) use curve::{CurveFamily, PlanePoint, ProfileCurve};
pub(crate) use piece::{Price, ProfilePiece};

/// Divides plane points into pieces of these shapes and kinds with the shortest description, and
/// returns its length, too.
pub(crate) fn pieces(points: &[PlanePoint], price: &Price<'_>) -> (Vec<ProfilePiece>, f64) {
    let (mut pieces, mut length, mut left) = (Vec::new(), 0.0, points.len());
    for chain in chains(points, price.noise) {
        let (mut some, cost) = divided(points, &chain, price);
        fill(points, price, &mut some);
        pieces.extend(some);
        length += cost;
        left -= chain.len();
    }
    (pieces, length + price.cost.most * left as f64)
}

/// Returns the pieces of one chain, and the length of their description.
fn divided(
    points: &[PlanePoint],
    chain: &[ChainLink],
    price: &Price<'_>,
) -> (Vec<ProfilePiece>, f64) {
    let Some((first, last)) = chain.first().zip(chain.last()) else {
        return (Vec::new(), 0.0);
    };
    // Time grows with the square of the number of steps.
    let step = price.noise.max((last.0 - first.0) / 1000.0);
    // The number of points before each step, and sums over them.
    let (mut firsts, mut sums, mut sum) = (vec![0], vec![Moments::default()], Moments::default());
    let mut rest = chain;
    while let Some(first) = rest.first() {
        let (links, others) = rest.split_at(rest.partition_point(|l| l.0 < first.0 + step));
        let of = links.iter().map(|link| points[link.1 as usize]);
        of.for_each(|p| sum.add(p, 1.0));
        sums.push(sum);
        firsts.push(chain.len() - others.len());
        rest = others;
    }
    let mut division = Division {
        price,
        left: vec![0.0; sums.len()],
        sums,
        best: vec![BestDivision::default()],
    };
    (1..firsts.len()).for_each(|to| division.advance(to));
    let pieces = division.pieces();
    let piece = |(steps, kind, curve): (Range<usize>, PrimitiveKind, ProfileCurve)| ProfilePiece {
        kind,
        curve,
        points: (chain[firsts[steps.start]..firsts[steps.end]].iter())
            .map(|link| link.1)
            .collect(),
    };
    let length = division.best.last().map_or(0.0, |best| best.cost);
    (pieces.into_iter().map(piece).collect(), length)
}

/// Shortest description of the first steps of a chain; its last piece begins at `from`.
#[derive(Clone, Copy, Default)]
struct BestDivision {
    cost: f64,
    from: usize,
    piece: Option<(PrimitiveKind, ProfileCurve)>,
}

/// Shortest descriptions of the steps of a chain, by dynamic programming (R. Bellman 1961).
struct Division<'a> {
    price: &'a Price<'a>,
    /// Sums over the points before each step.
    sums: Vec<Moments>,
    /// Shortest description of the points before each step.
    best: Vec<BestDivision>,
    /// Smallest Σ r² of the pieces from each step when they were last fitted; longer pieces leave
    /// no less.
    left: Vec<f64>,
}

impl Division<'_> {
    /// Finds the shortest description of the points before the next step.
    fn advance(&mut self, to: usize) {
        let last = self.best[to - 1];
        let single = self.sums[to].less(&self.sums[to - 1]);
        let mut least = BestDivision {
            cost: last.cost + self.price.cost.most * single.count,
            from: to - 1,
            piece: None,
        };
        // The last piece mostly continues; its cost rules most others out.
        self.try_from(last.from, to, &mut least);
        for from in (0..to).filter(|from| *from != last.from) {
            self.try_from(from, to, &mut least);
        }
        self.best.push(least);
    }

    /// Tries pieces between two steps.
    fn try_from(&mut self, from: usize, to: usize, least: &mut BestDivision) {
        let Price { noise, cost, .. } = *self.price;
        let before = self.best[from].cost + MIN_EVIDENCE;
        // Σ r² of circles is known only nearly: longer pieces leave at least half of what shorter
        // ones left.
        if before + 0.5 * cost.of_squares(self.left[from]) >= least.cost {
            return;
        }
        let of = self.sums[to].less(&self.sums[from]);
        let (mut left, mut is_whole) = (f64::INFINITY, true);
        for (shape, kind) in self.price.shapes {
            let numbers = shape.numbers() as f64;
            let base = before + numbers * self.price.of_number(of.count as usize);
            let is_enough = of.count >= least_points(*kind, noise) as f64;
            if base >= least.cost || !is_enough {
                is_whole &= is_enough;
                continue;
            }
            let Some((curve, squares)) = of.fitted(*shape) else {
                is_whole = false;
                continue;
            };
            left = left.min(squares);
            let cost = base + cost.of_squares(squares);
            if cost < least.cost
                && of.is_long(&curve, noise)
                && (self.price.is_proper)(*kind, &curve)
            {
                *least = BestDivision {
                    cost,
                    from,
                    piece: Some((*kind, curve)),
                };
            }
        }
        if is_whole && left.is_finite() {
            self.left[from] = left;
        }
    }

    /// Returns the pieces of the shortest description of all steps.
    fn pieces(&self) -> Vec<(Range<usize>, PrimitiveKind, ProfileCurve)> {
        let (mut pieces, mut to) = (Vec::new(), self.best.len() - 1);
        while to > 0 {
            let BestDivision { from, piece, .. } = self.best[to];
            pieces.extend(piece.map(|(kind, curve)| (from..to, kind, curve)));
            to = from;
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::curve::{minus, norm};
    use super::*;
    use isoform_num::Random;
    use std::f64::consts::{FRAC_1_SQRT_2, TAU};

    const SAMPLE_NOISE: f64 = 0.005;
    const SHAPES: [(CurveFamily, PrimitiveKind); 5] = [
        (CurveFamily::Across, PrimitiveKind::Plane),
        (CurveFamily::Along, PrimitiveKind::Cylinder),
        (CurveFamily::Line, PrimitiveKind::Cone),
        (CurveFamily::Centred, PrimitiveKind::Sphere),
        (CurveFamily::Circle, PrimitiveKind::Torus),
    ];

    /// Returns a normal deviate (Box and Muller).
    fn normal(random: &mut Random) -> f64 {
        let (u, turn) = (1.0 - random.unit(), TAU * random.unit());
        (-2.0 * u.ln()).sqrt() * turn.cos()
    }

    /// Returns points of a line with noise across it.
    fn strewn(random: &mut Random, [a, b]: [PlanePoint; 2], count: usize) -> Vec<PlanePoint> {
        let d = minus(b, a);
        let along = d.map(|x| x / norm(d));
        let point = |_| {
            let (t, off) = (random.unit(), SAMPLE_NOISE * normal(random));
            [
                a[0] + t * d[0] - off * along[1],
                a[1] + t * d[1] + off * along[0],
            ]
        };
        (0..count).map(point).collect()
    }

    fn divided_by_kind(points: &[PlanePoint]) -> Vec<(PrimitiveKind, usize)> {
        let is_proper = |_: PrimitiveKind, _: &ProfileCurve| true;
        let (pieces, _) = pieces(points, &Price::new(SAMPLE_NOISE, &SHAPES, &is_proper));
        pieces.iter().map(|p| (p.kind, p.points.len())).collect()
    }

    /// A cylinder, a chamfer ten deviations wide, and a shoulder.
    #[test]
    fn a_profile_is_divided_into_its_faces() {
        let mut random = Random::new(5);
        let width = 10.0 * SAMPLE_NOISE * FRAC_1_SQRT_2;
        let corners = [
            [0.0, 0.5],
            [0.6, 0.5],
            [0.6 + width, 0.5 - width],
            [0.6 + width, 0.1],
        ];
        let mut points = Vec::new();
        for (line, count) in corners.windows(2).zip([3000, 250, 2000]) {
            points.extend(strewn(&mut random, [line[0], line[1]], count));
        }
        let mut found = divided_by_kind(&points);
        found.sort_by_key(|(_, count)| *count);
        let kinds: Vec<PrimitiveKind> = found.iter().map(|f| f.0).collect();
        assert_eq!(
            kinds,
            [
                PrimitiveKind::Cone,
                PrimitiveKind::Plane,
                PrimitiveKind::Cylinder
            ],
            "{found:?}"
        );
        assert!((180..330).contains(&found[0].1), "{found:?}");
    }

    /// Short stretches of noise are wider than long: lines across them follow them well.
    #[test]
    fn a_band_of_noise_is_one_line() {
        let mut random = Random::new(6);
        let points = strewn(&mut random, [[0.0, 0.4], [0.3, 0.4]], 6000);
        let found = divided_by_kind(&points);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].0, PrimitiveKind::Cylinder);
        assert!(found[0].1 > 5900, "{found:?}");
    }

    #[test]
    fn no_points_have_no_pieces() {
        assert!(divided_by_kind(&[]).is_empty());
        assert!(divided_by_kind(&[[0.2, 0.1]; 3]).is_empty());
    }
}
