//! A solid clipped by a box: its intersection with six half-spaces.
//!
//! Its function is the minimum of the solid's function and of x − x_min, x_max − x, and so on. Each
//! side is linear, so its gradient and its bounds are exact.

use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::{Interval, Jet2, Real};

/// Intersection of a solid with a box, whose sides are six additional pieces named `cap.x_min` to
/// `cap.z_max`.
///
/// ```
/// use isoform_check::Capped;
/// use isoform_geom::{Aabb, Csg, OnePiece, Solid};
/// # use isoform_geom::{Field, Point3};
/// # use isoform_num::Jet2;
/// # struct Everywhere;
/// # impl Field for Everywhere {
/// #     fn value(&self, _: Point3) -> f64 { 1.0 }
/// #     fn jet(&self, _: Point3) -> Jet2 { Jet2 { v: 1.0, g: [0.0; 3], h: [0.0; 6] } }
/// # }
/// // All of space, cut off at the unit cube.
/// let all = OnePiece::new(Everywhere, "space");
/// let cube = Capped::new(&all, Aabb { lo: [0.0; 3], hi: [1.0; 3] });
/// assert_eq!(cube.names()[1..3], ["cap.x_min", "cap.x_max"]);
/// let mut signs = [0.0; 2];
/// cube.sign_values(&[[0.5; 3], [0.5, 0.5, 1.5]], &mut signs);
/// assert!(signs[0] > 0.0 && signs[1] < 0.0);
/// ```
pub struct Capped<'s> {
    solid: &'s dyn Solid,
    region: Aabb,
    /// True for each axis across which the sides of the box clip the solid.
    axes: [bool; 3],
    /// Number of pieces of the solid itself.
    n: u32,
    names: Vec<String>,
    tree: Csg,
}

impl<'s> Capped<'s> {
    /// Clips the solid at all sides of the region.
    pub fn new(solid: &'s dyn Solid, region: Aabb) -> Self {
        Self::across(solid, region, [true; 3])
    }

    /// Clips the solid at the sides of the region across the axes that are true. Sides across the
    /// other axes are pieces as well, but the tree does not contain them.
    pub fn across(solid: &'s dyn Solid, region: Aabb, axes: [bool; 3]) -> Self {
        let n = solid.names().len() as u32;
        let sides = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"];
        let names = solid
            .names()
            .iter()
            .cloned()
            .chain(sides.iter().map(|s| format!("cap.{s}")))
            .collect();
        let cut = (n..n + 6).filter(|&piece| axes[(piece - n) as usize / 2]);
        let tree = Csg::Min(
            std::iter::once(solid.tree().clone())
                .chain(cut.map(Csg::Piece))
                .collect(),
        );
        Self {
            solid,
            region,
            axes,
            n,
            names,
            tree,
        }
    }

    /// Returns the axis of a side, the sign +1 of its lower or −1 of its upper end, and its
    /// coordinate; `None` for a piece of the solid.
    fn side(&self, piece: u32) -> Option<(usize, f64, f64)> {
        let k = piece.checked_sub(self.n)? as usize;
        let axis = k / 2;
        Some(if k.is_multiple_of(2) {
            (axis, 1.0, self.region.lo[axis])
        } else {
            (axis, -1.0, self.region.hi[axis])
        })
    }
}

impl Solid for Capped<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for (&piece, out) in which.iter().zip(out.chunks_mut(points.len().max(1))) {
            match self.side(piece) {
                Some((axis, sign, at)) => out
                    .iter_mut()
                    .zip(points)
                    .for_each(|(v, p)| *v = sign * (p[axis] - at)),
                None => self.solid.values(&[piece], points, out),
            }
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        match self.side(piece) {
            Some((axis, sign, at)) => (
                sign * (p[axis] - at),
                std::array::from_fn(|i| if i == axis { sign } else { 0.0 }),
            ),
            None => self.solid.gradient(piece, p),
        }
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        match self.side(piece) {
            Some(_) => {
                let (v, g) = self.gradient(piece, p);
                Jet2 { v, g, h: [0.0; 6] }
            }
            None => self.solid.jet(piece, p),
        }
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        for (&piece, out) in which.iter().zip(out) {
            match self.side(piece) {
                // A difference of two doubles is rounded by at most half a unit in the last place,
                // so one step outward on each side encloses it.
                Some((axis, sign, at)) => {
                    let (a, b) = (sign * (region.lo[axis] - at), sign * (region.hi[axis] - at));
                    *out = Interval::new(a.min(b).next_down(), a.max(b).next_up());
                }
                None => self
                    .solid
                    .bounds(&[piece], region, std::slice::from_mut(out)),
            }
        }
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        // A difference of finite numbers is a number, and the differences at the ends enclose those
        // in between.
        self.bounds(which, region, out);
        for (&piece, out) in which.iter().zip(out) {
            if self.side(piece).is_none() {
                let out = std::slice::from_mut(out);
                self.solid.value_bounds(&[piece], region, out);
            }
        }
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        match self.side(piece) {
            Some(_) => Some(self.gradient(piece, region.lo).1.map(Interval::constant)),
            None => self.solid.slopes(piece, region),
        }
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        self.solid.sign_values(points, out);
        for (v, p) in out.iter_mut().zip(points) {
            for k in (self.n..self.n + 6).filter(|&k| self.axes[(k - self.n) as usize / 2]) {
                *v = v.min(self.gradient(k, *p).0);
            }
        }
    }
}
