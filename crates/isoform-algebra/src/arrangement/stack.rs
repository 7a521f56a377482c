//! The stack over a critical value: the numbers v at which curves and sides meet the line over it,
//! and which of them are equal.
//!
//! Two numbers are never compared for equality. How many each pair of curves has in common is known
//! from subresultants; intervals are refined until no more of them touch than are equal.

use super::WallPoint;
use crate::fibre::Fibre;
use crate::resultant::ResultantError;
use crate::roots::RealRoot;
use dashu_ratio::RBig;
use isoform_control::Control;

/// Origin of a number of the stack.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Origin {
    Root { curve: usize, index: usize },
    Lower,
    Upper,
}

/// Roots of a curve over a critical value.
pub(super) enum Roots {
    /// The curve does not depend on v and has no roots.
    None,
    /// The roots between the sides, all simple, proved in floating point.
    Near(Vec<[RBig; 2]>),
    /// All real roots, exactly.
    Exact(Fibre),
}

impl Roots {
    fn count(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Near(ranges) => ranges.len(),
            Self::Exact(fibre) => fibre.roots.len(),
        }
    }
    /// Returns the range of a root, to at most `bits` bits, or as many as are known.
    fn range(
        &mut self,
        index: usize,
        bits: usize,
        control: &Control<'_>,
    ) -> Result<(RBig, RBig), ResultantError> {
        Ok(match self {
            Self::None => unreachable!("roots belong to fibres"),
            Self::Near(ranges) => ranges[index].clone().into(),
            Self::Exact(fibre) => {
                fibre.refine(index, bits, control)?;
                (fibre.roots[index].lo.clone(), fibre.roots[index].hi.clone())
            }
        })
    }
    pub(super) fn is_multiple(&self, index: usize) -> bool {
        match self {
            Self::Exact(fibre) => fibre.roots[index].multiplicity > 1,
            _ => false,
        }
    }
}

/// Number of common points of each two of the curves and the sides, for j < k. After the n curves,
/// the side v = 0 has the index n, the side u + v = 1 the index n + 1.
pub(super) type Common = Vec<Vec<usize>>;

/// Numbers over a critical value.
pub(super) struct Stack {
    fibres: Vec<Roots>,
    origins: Vec<Origin>,
}

/// Numbers of a stack, known to a precision.
pub(super) struct PlacedNumbers {
    ranges: Vec<(RBig, RBig)>,
    /// Group of equal numbers to which each number belongs.
    groups: Vec<usize>,
}

impl Stack {
    pub(super) fn new(fibres: Vec<Roots>) -> Self {
        let mut origins = vec![Origin::Lower, Origin::Upper];
        for (curve, f) in fibres.iter().enumerate() {
            origins.extend((0..f.count()).map(|index| Origin::Root { curve, index }));
        }
        Self { fibres, origins }
    }

    /// Returns the index of a curve or a side.
    fn curve(&self, origin: Origin) -> usize {
        match origin {
            Origin::Root { curve, .. } => curve,
            Origin::Lower => self.fibres.len(),
            Origin::Upper => self.fibres.len() + 1,
        }
    }

    /// Returns the numbers to some bits; `None` if intervals of distinct numbers touch.
    pub(super) fn placed(
        &mut self,
        u: &mut RealRoot,
        bits: usize,
        common: &Common,
        control: &Control<'_>,
    ) -> Result<Option<PlacedNumbers>, ResultantError> {
        let ranges = self.ranges(u, bits, control)?;
        let (meetings, groups) = self.meetings(&ranges);
        Ok((meetings == *common).then_some(PlacedNumbers { ranges, groups }))
    }

    /// Returns the ranges of the numbers, to `bits` bits where that is possible.
    fn ranges(
        &mut self,
        u: &mut RealRoot,
        bits: usize,
        control: &Control<'_>,
    ) -> Result<Vec<(RBig, RBig)>, ResultantError> {
        u.refine(bits);
        let fibres = &mut self.fibres;
        let range = |o: &Origin| match *o {
            Origin::Lower => Ok((RBig::ZERO, RBig::ZERO)),
            Origin::Upper => {
                let (lo, hi) = u.interval();
                Ok((RBig::ONE - hi, RBig::ONE - lo))
            }
            Origin::Root { curve, index } => fibres[curve].range(index, bits, control),
        };
        self.origins.iter().map(range).collect()
    }

    /// Returns the maximum number of common numbers of each two curves and sides, and the group of
    /// possibly equal numbers to which each number belongs. Roots of one curve are distinct, but
    /// their intervals may touch.
    fn meetings(&self, ranges: &[(RBig, RBig)]) -> (Common, Vec<usize>) {
        let n = self.fibres.len();
        let all = &self.origins;
        let mut meetings = vec![vec![0usize; n + 2]; n + 2];
        let mut groups: Vec<usize> = (0..all.len()).collect();
        for a in 0..all.len() {
            for b in 0..a {
                let touch = ranges[a].0 <= ranges[b].1 && ranges[b].0 <= ranges[a].1;
                if !touch {
                    continue;
                }
                let (x, y) = (self.curve(all[a]), self.curve(all[b]));
                meetings[x.min(y)][x.max(y)] += 1;
                let (from, to) = (groups[a], groups[b]);
                let members = groups.iter_mut().filter(|g| **g == from);
                members.for_each(|g| *g = to);
            }
        }
        (meetings, groups)
    }

    /// Returns the points from the lower side to the upper one, with true if a curve touches the
    /// wall in one of them.
    pub(super) fn points(&self, placed: &PlacedNumbers) -> (Vec<WallPoint>, bool) {
        let mut points: Vec<(WallPoint, bool)> = Vec::new();
        let mut done = vec![false; self.origins.len()];
        for first in 0..self.origins.len() {
            if done[first] {
                continue;
            }
            let is_equal = |&m: &usize| placed.groups[m] == placed.groups[first];
            let members: Vec<usize> = (first..self.origins.len()).filter(is_equal).collect();
            members.iter().for_each(|&m| done[m] = true);
            points.push(self.point(&members, &placed.ranges));
        }
        points.sort_by(|a, b| a.0.lo.cmp(&b.0.lo));
        let place = |side: Origin| {
            let mut sides = points.iter();
            let found = sides.position(|p| p.0.curves.contains(&self.curve(side)));
            found.expect("both sides are there")
        };
        let inside = place(Origin::Lower)..=place(Origin::Upper);
        let touches = points[inside.clone()].iter().any(|p| p.1);
        let points = points.drain(inside).map(|p| p.0).collect();
        (points, touches)
    }

    /// Returns the point of equal numbers, with true if it is a multiple root of a curve.
    fn point(&self, members: &[usize], ranges: &[(RBig, RBig)]) -> (WallPoint, bool) {
        let (mut lo, mut hi) = ranges[members[0]].clone();
        let (mut curves, mut touches) = (Vec::new(), false);
        for &m in members {
            lo = lo.max(ranges[m].0.clone());
            hi = hi.min(ranges[m].1.clone());
            let origin = self.origins[m];
            curves.push(self.curve(origin));
            if let Origin::Root { curve, index } = origin {
                touches |= self.fibres[curve].is_multiple(index);
            }
        }
        curves.sort_unstable();
        (WallPoint { lo, hi, curves }, touches)
    }
}
