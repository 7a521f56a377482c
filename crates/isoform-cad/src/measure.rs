//! Area, volume and first moments of faces by integrals along their edges.
//!
//! By the theorem of Gauss the volume is the flux of x/3 through the faces, and the first moment
//! along axis k that of xₖ²/2 eₖ. On a face with the parameters u and v a flux is ∬ w du dv, and by
//! the theorem of Green −∮ W du around its loops with W = ∫ w dv, or ∮ W dv with W = ∫ w du. Both
//! integrals use Gauss quadrature between knots; no triangle is involved.

use crate::loops::{FaceChart, Piece, blend};
use crate::trim::{Extent, TrimmedFace};
use isoform_geom::cad::Shape;
use isoform_geom::{Point3, dot, norm, sub};
use isoform_num::gauss_legendre;

/// Number of nodes of the quadrature along a piece of a loop, which turns by 30° at most.
const OUTER_NODES: usize = 8;
/// Number of nodes between two knots, or along a quarter of a turn.
const INNER_NODES: usize = 12;

/// Measures of a face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaceMeasure {
    /// Area.
    pub area: f64,
    /// Volume between the face and the centre that points are taken about; that of a solid if all
    /// of its faces are added.
    pub volume: f64,
    /// First moment ∫ x dV about the centre, over that volume.
    pub moment: Point3,
}

impl FaceMeasure {
    pub(crate) fn add(&mut self, other: &Self, factor: f64) {
        self.area += factor * other.area;
        self.volume += factor * other.volume;
        (0..3).for_each(|k| self.moment[k] += factor * other.moment[k]);
    }
}

/// Returns the measure of a face; `None` for one that goes round in both directions.
pub(crate) fn measured(
    shape: &Shape,
    index: usize,
    face: &TrimmedFace,
    center: Point3,
) -> Option<FaceMeasure> {
    let turns = |k: usize| face.face.loops.iter().any(|l| l.turns[k] != 0);
    let outer = match (turns(0), turns(1)) {
        (true, true) => return None,
        (false, true) => 1,
        _ => 0,
    };
    let work = Quadrature::new(shape, index, face, center, outer);
    let mut sum = FaceMeasure::default();
    for piece in face.face.loops.iter().flat_map(|l| &l.pieces) {
        match piece.edge {
            Some(edge) => work.along(edge, piece, &mut sum),
            None => work.at_pole(piece, &mut sum),
        }
    }
    let sign = if face.face.is_left { 1.0 } else { -1.0 };
    let mut total = FaceMeasure::default();
    total.add(&sum, if outer == 0 { -sign } else { sign });
    work.far_side(&mut total);
    Some(total)
}

struct Quadrature<'a> {
    shape: &'a Shape,
    face: &'a FaceChart,
    trimmed: &'a TrimmedFace,
    center: Point3,
    /// Direction of the outer integral: 0 for u, 1 for v.
    outer: usize,
    /// Start of the inner integrals.
    base: f64,
    /// True if the normal of the face is that of the surface.
    agrees: bool,
    outer_rule: (Vec<f64>, Vec<f64>),
    inner_rule: (Vec<f64>, Vec<f64>),
    /// Knots of both directions.
    breaks: [Vec<f64>; 2],
}

impl<'a> Quadrature<'a> {
    fn new(
        shape: &'a Shape,
        index: usize,
        trimmed: &'a TrimmedFace,
        center: Point3,
        outer: usize,
    ) -> Self {
        let face = &trimmed.face;
        let inner = 1 - outer;
        let surface = &face.chart.surface;
        let breaks = [0, 1].map(|k| surface.breaks(k));
        let mut work = Self {
            shape,
            face,
            trimmed,
            center,
            outer,
            base: 0.0,
            agrees: shape.faces[index].agrees,
            outer_rule: gauss_legendre(OUTER_NODES),
            inner_rule: gauss_legendre(if breaks[inner].len() > 8 {
                OUTER_NODES
            } else {
                INNER_NODES
            }),
            breaks,
        };
        work.base = work.start();
        work
    }

    /// Returns the start of the inner integrals: the lower end of a face without an edge there.
    fn start(&self) -> f64 {
        let inner = 1 - self.outer;
        let low = self.poles_within(inner).into_iter().find(|p| !p.1);
        if let Some((at, _)) = low {
            return at;
        }
        match self.trimmed.extent {
            Extent::Whole => self.face.chart.surface.domain()[inner][0],
            _ => self.trimmed.bounds()[inner][0],
        }
    }

    /// Returns the poles of a direction within a face that goes round, each with true if it is the
    /// upper end of its parameter.
    fn poles_within(&self, direction: usize) -> Vec<(f64, bool)> {
        if self.trimmed.extent == Extent::Bounded {
            return Vec::new();
        }
        let poles = self.face.chart.poles.iter();
        let poles = poles.filter(|p| p.direction == direction);
        let within = poles.filter(|p| {
            let mut at = match self.trimmed.extent {
                Extent::Round(at) => at,
                _ => [0.0; 2],
            };
            at[direction] = p.at;
            self.trimmed.holds(self.shape, at)
        });
        within
            .map(|p| {
                let own = self.trimmed.bounds()[direction];
                let is_high = if own[0].is_finite() {
                    p.at >= own[1]
                } else {
                    p.at > self.face.chart.surface.domain()[direction][0]
                };
                (p.at, is_high)
            })
            .collect()
    }

    /// Adds what a face has beyond its loops: up to a pole, or all of a closed direction.
    fn far_side(&self, total: &mut FaceMeasure) {
        let (outer, inner) = (self.outer, 1 - self.outer);
        let chart = &self.face.chart;
        let is_free = self.face.loops.iter().all(|l| l.turns == [0; 2]);
        let high = self.poles_within(inner).into_iter().find(|p| p.1);
        let end = match (self.trimmed.extent, chart.periods[inner], high) {
            (Extent::Bounded, ..) => return,
            (_, _, Some((at, _))) => at,
            (_, Some(period), None) if is_free => self.base + period,
            (Extent::Whole, None, None) => chart.surface.domain()[inner][1],
            _ => return,
        };
        let [lo, hi] = match chart.periods[outer] {
            Some(period) => [0.0, period],
            None => chart.surface.domain()[outer],
        };
        self.along_line([lo, hi], end, total);
    }

    /// Adds the integral between two values of the outer parameter, at one of the inner.
    fn along_line(&self, ends: [f64; 2], inner: f64, sum: &mut FaceMeasure) {
        for w in self.pieces(self.outer, ends).windows(2) {
            for (x, weight) in self.inner_rule.0.iter().zip(&self.inner_rule.1) {
                let at = w[0] + x * (w[1] - w[0]);
                sum.add(&self.inner(at, inner), weight * (w[1] - w[0]));
            }
        }
    }

    /// Adds the integral along a pole, where a loop changes its direction.
    fn at_pole(&self, piece: &Piece, sum: &mut FaceMeasure) {
        let [from, to] = piece.at;
        let (outer, inner) = (self.outer, 1 - self.outer);
        if from[outer] != to[outer] {
            self.along_line([from[outer], to[outer]], from[inner], sum);
        }
    }

    /// Adds the integral along a piece.
    fn along(&self, edge: u32, piece: &Piece, sum: &mut FaceMeasure) {
        let edge = &self.shape.edges[edge as usize];
        for shares in self.smooth(piece).windows(2) {
            let length = shares[1] - shares[0];
            for (x, weight) in self.outer_rule.0.iter().zip(&self.outer_rule.1) {
                let share = shares[0] + x * length;
                let [_, way, _] = edge.at(share);
                let at = self.place(piece, share);
                let rate = self.rate(at, way);
                let inner = self.inner(at[self.outer], at[1 - self.outer]);
                sum.add(&inner, rate * weight * length);
            }
        }
    }

    /// Returns the parameters of a share of a piece.
    fn place(&self, piece: &Piece, share: f64) -> [f64; 2] {
        let edge = &self.shape.edges[piece.edge.unwrap_or(0) as usize];
        let t = (share - piece.shares[0]) / (piece.shares[1] - piece.shares[0]);
        self.face.place_on(edge, share, blend(piece.at, t))
    }

    /// Returns the derivative of the outer parameter along a tangent.
    fn rate(&self, at: [f64; 2], way: Point3) -> f64 {
        let jet = self.face.chart.surface.at(at);
        let (a, b, c) = (dot(jet.u, jet.u), dot(jet.u, jet.v), dot(jet.v, jet.v));
        let (x, y) = (dot(way, jet.u), dot(way, jet.v));
        let det = a * c - b * b;
        let rate = if self.outer == 0 {
            c * x - b * y
        } else {
            a * y - b * x
        };
        if det > 0.0 { rate / det } else { 0.0 }
    }

    /// Returns the shares that divide a piece where it crosses knots of the outer direction.
    fn smooth(&self, piece: &Piece) -> Vec<f64> {
        let [a, b] = piece.at.map(|at| at[self.outer]);
        let mut shares = vec![piece.shares[0]];
        let period = self.face.chart.periods[self.outer];
        let shifts = period.map_or(vec![0.0], |t| vec![-t, 0.0, t]);
        for knot in &self.breaks[self.outer] {
            for shift in &shifts {
                let knot = knot + shift;
                if (a - knot) * (b - knot) < 0.0 {
                    let [mut s, mut t] = piece.shares;
                    for _ in 0..50 {
                        let half = 0.5 * (s + t);
                        let at = self.place(piece, half)[self.outer];
                        if (at - knot) * (a - knot) > 0.0 {
                            s = half
                        } else {
                            t = half
                        }
                    }
                    shares.push(0.5 * (s + t));
                }
            }
        }
        shares.push(piece.shares[1]);
        let is_forward = piece.shares[0] < piece.shares[1];
        shares.sort_by(|a, b| {
            if is_forward {
                a.total_cmp(b)
            } else {
                b.total_cmp(a)
            }
        });
        shares
    }

    /// Returns values between which the surface is smooth in a direction, both ends included.
    fn pieces(&self, direction: usize, [from, to]: [f64; 2]) -> Vec<f64> {
        let (lo, hi) = (from.min(to), from.max(to));
        let period = self.face.chart.periods[direction];
        let mut all = vec![lo];
        for knot in &self.breaks[direction] {
            let shifts = period.map_or(vec![0.0], |t| vec![-t, 0.0, t]);
            all.extend(
                shifts
                    .iter()
                    .map(|s| knot + s)
                    .filter(|k| *k > lo && *k < hi),
            );
        }
        all.push(hi);
        all.sort_by(f64::total_cmp);
        let longest = period.map_or(f64::INFINITY, |t| 0.25 * t);
        let mut fine = vec![lo];
        for w in all.windows(2) {
            let count = ((w[1] - w[0]) / longest).ceil().clamp(1.0, 16.0);
            fine.extend((1..=count as usize).map(|k| w[0] + (w[1] - w[0]) * k as f64 / count));
        }
        if from > to {
            fine.reverse();
        }
        fine
    }

    /// Returns the integrals over the inner parameter, from the base to `to`.
    fn inner(&self, outer: f64, to: f64) -> FaceMeasure {
        let mut sum = FaceMeasure::default();
        for w in self.pieces(1 - self.outer, [self.base, to]).windows(2) {
            let length = w[1] - w[0];
            for (x, weight) in self.inner_rule.0.iter().zip(&self.inner_rule.1) {
                let t = w[0] + x * length;
                let at = if self.outer == 0 {
                    [outer, t]
                } else {
                    [t, outer]
                };
                sum.add(&self.density(at), weight * length);
            }
        }
        sum
    }

    fn density(&self, at: [f64; 2]) -> FaceMeasure {
        let jet = self.face.chart.surface.at(at);
        let n = jet.normal();
        let out = if self.agrees { n } else { n.map(|v| -v) };
        let x = sub(jet.p, self.center);
        FaceMeasure {
            area: norm(n),
            volume: dot(x, out) / 3.0,
            moment: std::array::from_fn(|k| 0.5 * x[k] * x[k] * out[k]),
        }
    }
}
