//! Vertices on pieces: values near the surface, projections onto one, two or three pieces, and what
//! bounds the solid there.

use crate::lattice::{IN, Lattice, OUT};
use isoform_control::Control;
use isoform_geom::{Point3, Solid, cross, dot, norm};
use rayon::prelude::*;

/// The pieces that a vertex is held on, at most three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct On {
    pieces: [u32; 3],
    n: u8,
}

impl On {
    pub(crate) fn of(pieces: &[u32]) -> Self {
        let mut on = Self::default();
        for &p in pieces {
            on = on.with(p).unwrap_or(on);
        }
        on
    }
    pub(crate) fn slice(&self) -> &[u32] {
        &self.pieces[..usize::from(self.n)]
    }
    pub(crate) fn len(&self) -> usize {
        usize::from(self.n)
    }
    pub(crate) fn is_empty(&self) -> bool {
        self.n == 0
    }
    pub(crate) fn contains(&self, piece: u32) -> bool {
        self.slice().contains(&piece)
    }
    /// With one more piece; none if there are three already.
    pub(crate) fn with(mut self, piece: u32) -> Option<Self> {
        if self.contains(piece) {
            return Some(self);
        }
        if self.n == 3 {
            return None;
        }
        self.pieces[usize::from(self.n)] = piece;
        self.n += 1;
        Some(self)
    }
    pub(crate) fn common(&self, other: &Self) -> Self {
        Self::of(
            &self
                .slice()
                .iter()
                .copied()
                .filter(|&p| other.contains(p))
                .collect::<Vec<_>>(),
        )
    }
}

/// Stands for the solid itself where pieces that touch tangentially make one smooth surface:
/// whichever of them decides.
pub(crate) const SKIN: u32 = u32::MAX - 1;

/// Whether two pieces meet at an angle at the nearest point that lies on both.
///
/// Newton's method gets to a transversal intersection in a few steps. Towards a tangential one it
/// only halves the distance each time, and the angle with it, until that is less than [`TANGENT`].
pub(crate) fn meet_at_an_angle(solid: &dyn Solid, pieces: [u32; 2], p: Point3) -> bool {
    let angle = |p| {
        let [a, b] = pieces.map(|i| solid.gradient(i, p).1);
        if dot(a, b) < 0.0 {
            2.0
        } else {
            norm(cross(a, b)) / (norm(a) * norm(b))
        }
    };
    let (mut q, mut here) = (p, angle(p));
    // Far from tangential there is nothing to find out.
    let mut rounds = if here > 0.5 { 0 } else { 12 };
    while rounds > 0 && here > TANGENT {
        let Some((step, _)) = newton(&|i, p| solid.gradient(i, p), &pieces, q) else {
            break;
        };
        q = std::array::from_fn(|i| q[i] - step[i]);
        let next = angle(q);
        if next > 0.9 * here || next.is_nan() {
            break;
        }
        here = next;
        rounds -= 1;
    }
    here > TANGENT
}

/// The solid as the mesher asks it.
pub(crate) struct Surface<'s> {
    pub(crate) solid: &'s dyn Solid,
    pub(crate) lattice: &'s Lattice,
    /// Below this distance a value is 0: rounding, and pieces that coincide.
    pub(crate) zero: f64,
    pub(crate) control: &'s Control<'s>,
}

/// g/|∇g|: the distance to first order.
pub(crate) fn first_order(g: f64, gradient: Point3) -> f64 {
    let n = norm(gradient);
    if n > 0.0 {
        g / n
    } else if g == 0.0 {
        0.0
    } else {
        g.signum() * f64::MAX
    }
}

/// The distance of a point to a piece, to first order.
pub(crate) fn first_order_at(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let (g, d) = solid.gradient(piece, p);
    first_order(g, d)
}

impl Surface<'_> {
    /// Distance of a point to a piece, to first order; 0 within rounding.
    pub(crate) fn distance(&self, piece: u32, p: Point3) -> f64 {
        if piece == SKIN {
            return self.value(p).0;
        }
        let v = first_order_at(self.solid, piece, p);
        if v.abs() <= self.zero { 0.0 } else { v }
    }

    /// Value of the solid and the piece that decides it; ±∞ in cells that are decided.
    pub(crate) fn value(&self, p: Point3) -> (f64, u32) {
        match self.lattice.state_at(p) {
            IN => (f64::INFINITY, u32::MAX),
            OUT => (f64::NEG_INFINITY, u32::MAX),
            k => self.lattice.trees[k as usize - 2]
                .0
                .value_and_piece(&|i| self.distance(i, p)),
        }
    }

    /// The middle of a cell where the function is not a number.
    ///
    /// Asked before anything is made of the cells: intervals decide nothing where it is none, so
    /// that all of space would be cut up in search of features.
    pub(crate) fn not_a_number(&self) -> Option<Point3> {
        let n = self.lattice.n;
        let middle = |c: usize| {
            let at = [c % n[0], c / n[0] % n[1], c / (n[0] * n[1])];
            self.lattice.point(at.map(|i| 2 * i + 1))
        };
        let is_none = |c: &usize| {
            self.lattice.state[*c] >= 2
                && !self.control.is_stopped()
                && self.value(middle(*c)).0.is_nan()
        };
        (0..self.lattice.state.len())
            .into_par_iter()
            .with_min_len(1024)
            .find_first(is_none)
            .map(middle)
    }

    /// Whether no other piece can decide the solid's sign around the point.
    pub(crate) fn is_alone(&self, piece: u32, p: Point3) -> bool {
        let k = self.lattice.state_at(p);
        k >= 2 && self.lattice.trees[k as usize - 2].1 == [piece]
    }

    /// Value and gradient of a piece, or of the one that decides.
    pub(crate) fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        if piece != SKIN {
            return self.solid.gradient(piece, p);
        }
        match self.value(p).1 {
            u32::MAX => (f64::INFINITY, [0.0; 3]),
            piece => self.solid.gradient(piece, p),
        }
    }

    /// One step of Newton's method towards the nearest point where all the pieces vanish.
    pub(crate) fn nearer(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let (step, _) = newton(&|i, p| self.gradient(i, p), pieces, from)?;
        Some(std::array::from_fn(|i| from[i] - step[i]))
    }

    /// The nearest point where all the pieces vanish: Newton with the least step, to rounding.
    pub(crate) fn project(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let mut p = from;
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let (step, off) = newton(&|i, p| self.gradient(i, p), pieces, p)?;
            if off >= last && off <= self.zero {
                return Some(p);
            }
            last = off;
            p = std::array::from_fn(|i| p[i] - step[i]);
            if off == 0.0 {
                return Some(p);
            }
        }
        (last <= self.zero).then_some(p)
    }

    /// Where the solid's value changes sign between `a` and `b` (values `fa`, `fb` of different
    /// signs): the share of the way and the piece that vanishes there.
    pub(crate) fn root(&self, a: Point3, fa: f64, b: Point3, fb: f64) -> Option<(f64, u32)> {
        root(a, fa, b, fb, self.zero, |p| self.value(p))
    }

    /// The same for one piece alone.
    pub(crate) fn root_of(
        &self,
        piece: u32,
        a: Point3,
        fa: f64,
        b: Point3,
        fb: f64,
    ) -> Option<f64> {
        root(a, fa, b, fb, self.zero, |p| {
            (self.distance(piece, p), piece)
        })
        .map(|r| r.0)
    }

    /// Whether the two pieces meet at `p` in an edge of the solid: the sign in the four quadrants
    /// between them depends on both, and they meet at an angle.
    pub(crate) fn is_edge(&self, pair: [u32; 2], p: Point3) -> bool {
        let k = self.lattice.state_at(p);
        if k < 2 {
            return false;
        }
        let n = pair.map(|i| {
            let d = self.solid.gradient(i, p).1;
            let l = norm(d);
            d.map(|v| v / l)
        });
        if norm(cross(n[0], n[1])) < TANGENT {
            return false;
        }
        let tree = &self.lattice.trees[k as usize - 2].0;
        let value = |s: f64, t: f64| {
            tree.value(&|i| {
                if i == pair[0] {
                    s
                } else if i == pair[1] {
                    t
                } else {
                    // A third piece that vanishes as well is followed into the quadrant.
                    let d = self.distance(i, p);
                    if d != 0.0 {
                        d.signum() * f64::MAX
                    } else {
                        self.follow(i, n, [s, t], p)
                    }
                }
            }) >= 0.0
        };
        let [a, b, c, d] = [
            value(1.0, 1.0),
            value(1.0, -1.0),
            value(-1.0, 1.0),
            value(-1.0, -1.0),
        ];
        (a != b || c != d) && (a != c || b != d)
    }

    /// Whether the three pieces meet at `p` in a corner of the solid: the sign in the eight octants
    /// between them depends on each.
    pub(crate) fn is_corner(&self, on: &[u32], p: Point3) -> bool {
        let k = self.lattice.state_at(p);
        if k < 2 {
            return false;
        }
        let tree = &self.lattice.trees[k as usize - 2].0;
        let inside = |bits: usize| {
            tree.value(&|i| match on.iter().position(|&o| o == i) {
                Some(at) => {
                    if bits >> at & 1 == 1 {
                        1.0
                    } else {
                        -1.0
                    }
                }
                None => self.distance(i, p).signum() * f64::MAX,
            }) >= 0.0
        };
        (0..3).all(|at| (0..8usize).any(|bits| inside(bits) != inside(bits ^ 1 << at)))
    }

    /// Whether a piece that vanishes at `p` is the surface somewhere around: in some direction
    /// within it, its sign decides the solid's when the other pieces that vanish there go with
    /// their gradients, and those tangential to it with it.
    pub(crate) fn is_face(&self, piece: u32, p: Point3) -> bool {
        let k = self.lattice.state_at(p);
        if k < 2 {
            return false;
        }
        let (tree, pieces) = &self.lattice.trees[k as usize - 2];
        let unit = |i: u32| {
            let g = self.solid.gradient(i, p).1;
            let l = norm(g).max(1e-300);
            g.map(|x| x / l)
        };
        let n = unit(piece);
        let zero: Vec<(u32, Point3)> = pieces
            .iter()
            .filter(|&&i| i != piece && self.distance(i, p) == 0.0)
            .map(|&i| (i, unit(i)))
            .collect();
        if zero.is_empty() {
            return true;
        }
        let axis = (0..3)
            .min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs()))
            .unwrap_or(0);
        let mut e = [0.0; 3];
        e[axis] = 1.0;
        let a = cross(n, e);
        let b = cross(n, a);
        // Directions in no simple ratio to each other, so that none lies in another piece by
        // design.
        (0..16).any(|k| {
            let (s, c) = (0.4 * f64::from(k) + 0.123).sin_cos();
            let along: Point3 = std::array::from_fn(|i| c * a[i] + s * b[i]);
            let inside = |side: f64| {
                tree.value(&|i| {
                    if i == piece {
                        return side;
                    }
                    match zero.iter().find(|z| z.0 == i) {
                        Some((_, g)) if norm(cross(*g, n)) < TANGENT => side * dot(*g, n).signum(),
                        Some((_, g)) => dot(*g, along),
                        None => self.distance(i, p).signum() * f64::MAX,
                    }
                }) >= 0.0
            };
            inside(1.0) != inside(-1.0)
        })
    }

    /// Value of a piece to first order in the quadrant where the two normals give `s` and `t`.
    fn follow(&self, piece: u32, n: [Point3; 2], [s, t]: [f64; 2], p: Point3) -> f64 {
        let k = dot(n[0], n[1]);
        let det = 1.0 - k * k;
        let (alpha, beta) = ((s - k * t) / det, (t - k * s) / det);
        let along: Point3 = std::array::from_fn(|i| alpha * n[0][i] + beta * n[1][i]);
        dot(self.solid.gradient(piece, p).1, along)
    }
}

/// The least step to the linearised pieces, and the largest distance to one of them.
fn newton(
    gradient: &dyn Fn(u32, Point3) -> (f64, Point3),
    pieces: &[u32],
    p: Point3,
) -> Option<(Point3, f64)> {
    let mut rows = [([0.0; 3], 0.0); 3];
    let mut off = 0.0f64;
    for (row, &piece) in rows.iter_mut().zip(pieces) {
        let (g, d) = gradient(piece, p);
        let n = norm(d);
        if !(n > 0.0 && n.is_finite() && g.is_finite()) {
            return None;
        }
        *row = (d.map(|v| v / n), g / n);
        off = off.max((g / n).abs());
    }
    let [(a, u), (b, v), (c, w)] = rows;
    let step = match pieces.len() {
        1 => a.map(|x| x * u),
        2 => {
            // x = α a + β b with a·x = u, b·x = v.
            let k = dot(a, b);
            let det = 1.0 - k * k;
            if det < 1e-10 {
                return None;
            }
            let (alpha, beta) = ((u - k * v) / det, (v - k * u) / det);
            std::array::from_fn(|i| alpha * a[i] + beta * b[i])
        }
        3 => {
            let det = dot(a, cross(b, c));
            if det.abs() < 1e-8 {
                return None;
            }
            let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
            std::array::from_fn(|i| (u * bc[i] + v * ca[i] + w * ab[i]) / det)
        }
        _ => return None,
    };
    Some((step, off))
}

/// Sine of the angle below which two pieces count as one smooth surface: two degrees, as in
/// [`crate::FeatureOptions`].
pub(crate) const TANGENT: f64 = 0.0349;

fn root(
    a: Point3,
    fa: f64,
    b: Point3,
    fb: f64,
    zero: f64,
    f: impl Fn(Point3) -> (f64, u32),
) -> Option<(f64, u32)> {
    // Illinois: the regula falsi whose stuck end is halved.
    let (mut s, mut fs, mut t, mut ft) = (0.0, fa, 1.0, fb);
    let mut side = 0;
    for _ in 0..100 {
        let m = if fs.is_finite() && ft.is_finite() {
            (s * ft - t * fs) / (ft - fs)
        } else {
            0.5 * (s + t)
        };
        let m = if m > s && m < t { m } else { 0.5 * (s + t) };
        let p = std::array::from_fn(|i| a[i] + m * (b[i] - a[i]));
        let (v, piece) = f(p);
        if v.is_nan() {
            return None;
        }
        if v.abs() <= zero || m <= s || m >= t {
            return (piece != u32::MAX).then_some((m, piece));
        }
        if (v > 0.0) == (fs > 0.0) {
            (s, fs) = (m, v);
            if side == 1 {
                ft *= 0.5;
            }
            side = 1;
        } else {
            (t, ft) = (m, v);
            if side == 2 {
                fs *= 0.5;
            }
            side = 2;
        }
    }
    None
}
