//! Solids with known parts: minima and maxima over smooth pieces.
//!
//! Glossary: a *piece* is a smooth function, such as that of a face of a block; the *tree* joins
//! pieces to a solid; the piece that *decides* the value at a point is the one whose value equals
//! that of the tree.

use crate::{Aabb, Field, Point3};
use isoform_num::{Interval, Jet2};

/// Tree that joins pieces to a solid: an intersection is a minimum, a union a maximum.
///
/// ```
/// use isoform_geom::Csg;
///
/// // A half-space with a hole: the intersection of piece 0 and piece 1.
/// let tree = Csg::Min(vec![Csg::Piece(0), Csg::Piece(1)]);
/// let values = [3.0, -1.0];
/// assert_eq!(tree.value_and_piece(&|i| values[i as usize]), (-1.0, 1));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Csg {
    /// Smooth piece, by its index.
    Piece(u32),
    /// Intersection.
    Min(Vec<Self>),
    /// Union.
    Max(Vec<Self>),
}

impl Csg {
    /// Returns the value of the tree if the pieces have the values `v` (by index).
    pub fn value(&self, v: &impl Fn(u32) -> f64) -> f64 {
        self.value_and_piece(v).0
    }

    /// Returns the value, and the piece that decides it; of equal ones the first in the tree. The
    /// value is NaN where a piece is, unless others decide the sign: an intersection is negative
    /// where one child is, a union is not where one child is not (Kleene's logic).
    ///
    /// ```
    /// use isoform_geom::Csg;
    ///
    /// let both = Csg::Min(vec![Csg::Piece(0), Csg::Piece(1)]);
    /// assert_eq!(both.value(&|i| [f64::NAN, -1.0][i as usize]), -1.0);
    /// assert!(both.value(&|i| [1.0, f64::NAN][i as usize]).is_nan());
    /// ```
    pub fn value_and_piece(&self, v: &impl Fn(u32) -> f64) -> (f64, u32) {
        match self {
            Self::Piece(i) => (v(*i), *i),
            Self::Min(children) => Self::first_best(children, v, |a, b| a >= b, |a| a < 0.0),
            Self::Max(children) => Self::first_best(children, v, |a, b| a <= b, |a| a >= 0.0),
        }
    }

    #[inline]
    fn first_best(
        children: &[Self],
        v: &impl Fn(u32) -> f64,
        is_no_better: impl Fn(f64, f64) -> bool,
        decides: impl Fn(f64) -> bool,
    ) -> (f64, u32) {
        let mut best = children[0].value_and_piece(v);
        for child in &children[1..] {
            let next = child.value_and_piece(v);
            if is_no_better(next.0, best.0) {
                continue;
            }
            let is_taken = match (best.0.is_nan(), next.0.is_nan()) {
                (false, false) => true,
                (true, _) => decides(next.0),
                (false, true) => !decides(best.0),
            };
            if is_taken {
                best = next;
            }
        }
        best
    }

    /// Returns a range of the tree's value if the pieces have the ranges `v`.
    pub fn range(&self, v: &impl Fn(u32) -> Interval) -> Interval {
        let fold = |children: &[Self], join: fn(f64, f64) -> f64| {
            let first = children[0].range(v);
            let (mut lo, mut hi) = (first.lo(), first.hi());
            for child in &children[1..] {
                let r = child.range(v);
                (lo, hi) = (join(lo, r.lo()), join(hi, r.hi()));
            }
            Interval::new(lo, hi)
        };
        match self {
            Self::Piece(i) => v(*i),
            Self::Min(children) => fold(children, f64::min),
            Self::Max(children) => fold(children, f64::max),
        }
    }

    /// Removes the pieces that cannot decide the value if the values of the pieces lie in `ranges`:
    /// value, bit for bit, and deciding piece do not change. Values with the range
    /// [`Interval::ALL`] may be NaN, which does not compare.
    ///
    /// ```
    /// use isoform_geom::Csg;
    /// use isoform_num::Interval;
    ///
    /// let union = Csg::Max((0..3).map(Csg::Piece).collect());
    /// let ranges = [Interval::new(0.0, 1.0), Interval::new(-3.0, -1.0), Interval::new(-1.0, 0.0)];
    /// assert_eq!(union.deciding(&|i| ranges[i as usize]).pieces(), [0, 2]);
    /// ```
    #[must_use]
    pub fn deciding(&self, ranges: &impl Fn(u32) -> Interval) -> Self {
        self.deciding_with_range(ranges).0
    }

    /// Returns the tree without the pieces that cannot decide, as [`Csg::deciding`] does, and a range
    /// of its value; [`Interval::ALL`] if the value may be NaN.
    #[must_use]
    pub fn deciding_with_range(&self, ranges: &impl Fn(u32) -> Interval) -> (Self, Interval) {
        let (children, is_min) = match self {
            Self::Piece(i) => return (self.clone(), ranges(*i)),
            Self::Min(children) => (children, true),
            Self::Max(children) => (children, false),
        };
        let parts = children
            .iter()
            .map(|child| child.deciding_with_range(ranges));
        let parts: Vec<(Self, Interval)> = parts.collect();
        // A NaN may decide, as all others may where it does not: all children must be kept.
        if parts.iter().any(|(_, range)| *range == Interval::ALL) {
            let all = parts.into_iter().map(|part| part.0).collect();
            return (Self::join(is_min, all), Interval::ALL);
        }
        // A maximum lies between the largest of the lower ends and the largest of the upper ones.
        let join = if is_min { f64::min } else { f64::max };
        let ends = parts.iter().map(|(_, range)| [range.lo(), range.hi()]);
        let [lo, hi] = ends
            .reduce(|a, b| [join(a[0], b[0]), join(a[1], b[1])])
            .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let may_decide = |range: &Interval| {
            if is_min {
                range.lo() <= hi
            } else {
                range.hi() >= lo
            }
        };
        let kept = parts.into_iter().filter(|(_, range)| may_decide(range));
        let kept = kept.map(|part| part.0).collect();
        (Self::join(is_min, kept), Interval::new(lo, hi))
    }

    /// Returns the minimum or maximum of children; a single child itself.
    fn join(is_min: bool, mut children: Vec<Self>) -> Self {
        match (children.len(), is_min) {
            (1, _) => children.swap_remove(0),
            (_, true) => Self::Min(children),
            (_, false) => Self::Max(children),
        }
    }

    /// Returns the pieces of the tree, in its order.
    pub fn pieces(&self) -> Vec<u32> {
        match self {
            Self::Piece(i) => vec![*i],
            Self::Min(children) | Self::Max(children) => {
                children.iter().flat_map(Self::pieces).collect()
            }
        }
    }
}

/// Solid whose surface consists of smooth pieces: inside, the tree's value is ≥ 0.
///
/// The value of a piece is positive on the side that it keeps, and smooth (C¹) near its zero set,
/// with a gradient that does not vanish there; it need not be a distance. The outward normal is
/// −∇g/|∇g|.
pub trait Solid: Send + Sync {
    /// Returns the names of the pieces, all different.
    fn names(&self) -> &[String];
    /// Returns the tree that joins the pieces.
    fn tree(&self) -> &Csg;
    /// Evaluates some pieces at many points: `out[k * points.len() + i]` is piece `which[k]` at
    /// `points[i]`.
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]);
    /// Returns the value and the gradient of a piece.
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3);
    /// Returns the value, the gradient and the Hessian of a piece.
    fn jet(&self, piece: u32, p: Point3) -> Jet2;
    /// Computes intervals that contain the pieces `which` over the whole region.
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]);
    /// Computes intervals that contain the results of [`Solid::values`] for the pieces `which` at
    /// any point of the region, rounding errors included; [`Interval::ALL`] if a result may be NaN,
    /// and by default.
    ///
    /// [`Solid::bounds`] contains the exact values, and only at points at which the piece is
    /// defined. The intervals here allow removing a piece from a minimum or maximum without
    /// changing a bit of the result.
    fn value_bounds(&self, which: &[u32], _region: Aabb, out: &mut [Interval]) {
        out[..which.len()].fill(Interval::ALL);
    }
    /// Returns intervals that contain a piece's gradient over the whole region; `None` by default.
    fn slopes(&self, _piece: u32, _region: Aabb) -> Option<[Interval; 3]> {
        None
    }
    /// Evaluates the defining function of the solid at many points, for checks: it has the sign of
    /// the tree, and need not be a distance.
    fn sign_values(&self, points: &[Point3], out: &mut [f64]);
}

/// Solid of one smooth piece, for a [`Field`] without parts.
#[derive(Debug)]
pub struct OnePiece<F> {
    field: F,
    names: Vec<String>,
    tree: Csg,
}

impl<F: Field> OnePiece<F> {
    /// Returns the solid of a field, with a name for its surface.
    pub fn new(field: F, name: &str) -> Self {
        Self {
            field,
            names: vec![name.to_owned()],
            tree: Csg::Piece(0),
        }
    }
}

impl<F: Field> Solid for OnePiece<F> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for out in out.chunks_mut(points.len().max(1)).take(which.len()) {
            self.field.values(points, out);
        }
    }
    fn gradient(&self, _: u32, p: Point3) -> (f64, Point3) {
        let j = self.field.jet(p);
        (j.v, j.g)
    }
    fn jet(&self, _: u32, p: Point3) -> Jet2 {
        self.field.jet(p)
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        out[..which.len()].fill(self.field.bounds(region));
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        self.field.values(points, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_ranges_of_a_tree() {
        // min(0, max(1, 2))
        let tree = Csg::Min(vec![
            Csg::Piece(0),
            Csg::Max(vec![Csg::Piece(1), Csg::Piece(2)]),
        ]);
        let v = |i: u32| [3.0, 1.0, 2.0][i as usize];
        assert_eq!(tree.value_and_piece(&v), (2.0, 2));
        assert_eq!(tree.pieces(), [0, 1, 2]);
        let r = tree.range(&|i| Interval::new(v(i) - 1.5, v(i) + 1.0));
        assert_eq!((r.lo(), r.hi()), (0.5, 3.0));
    }
}
