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

/// Where a number of the stack comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Origin {
    Root { curve: usize, index: usize },
    Lower,
    Upper,
}

/// The roots of a curve over a critical value.
pub(super) enum Roots {
    /// The curve has none, as it does not depend on v.
    None,
    /// The roots between the sides, proved in floating point: all of them are simple.
    Near(Vec<[RBig; 2]>),
    /// All real ones.
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
    /// The range of a root, to as many bits as can be had, `bits` at most.
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

/// The number of points that each two of the curves and the sides have in common, for j < k. After
/// the n curves, the side v = 0 has the number n, the side u + v = 1 the number n + 1.
pub(super) type Common = Vec<Vec<usize>>;

/// The numbers over a critical value.
pub(super) struct Stack {
    fibres: Vec<Roots>,
    origins: Vec<Origin>,
}

/// The numbers of a stack, as they are known to some precision.
pub(super) struct Placed {
    ranges: Vec<(RBig, RBig)>,
    /// For each number the group of those that it is equal to.
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

    /// The number of a curve or a side.
    fn curve(&self, origin: Origin) -> usize {
        match origin {
            Origin::Root { curve, .. } => curve,
            Origin::Lower => self.fibres.len(),
            Origin::Upper => self.fibres.len() + 1,
        }
    }

    /// The numbers to some bits, if only those touch that are equal.
    pub(super) fn placed(
        &mut self,
        u: &mut RealRoot,
        bits: usize,
        common: &Common,
        control: &Control<'_>,
    ) -> Result<Option<Placed>, ResultantError> {
        let ranges = self.ranges(u, bits, control)?;
        let (meetings, groups) = self.meetings(&ranges);
        Ok((meetings == *common).then_some(Placed { ranges, groups }))
    }

    /// The ranges of the numbers, to `bits` bits where these can be had.
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

    /// The most numbers that each two curves and sides may have in common, and for each number the
    /// group of those that it may be equal to. Roots of one curve differ, but may still touch.
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

    /// The points from the lower side to the upper one, and whether a curve touches the wall in one
    /// of them.
    pub(super) fn points(&self, placed: &Placed) -> (Vec<WallPoint>, bool) {
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

    /// The point of equal numbers, and whether it is a multiple root of a curve.
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
