//! Vertices on pieces: values near the surface, projections onto one, two or three pieces, and what
//! bounds the solid there.
//!
//! A *piece* is one smooth function of the solid's tree. Its distance at a point is g/|∇g|, the
//! distance to first order. Vertices of the mesh are held on pieces: on one within a face, on two
//! along an edge, on three at a corner of the solid.

mod bounds;
mod contact;
mod newton;
mod on;

use crate::complex::STRAY;
use crate::features::Corner;
use crate::lattice::{IN, Lattice, OUT, Reduced};
use crate::points::{along, centroid, hash, unique};
use crate::torus::Torus;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm, sub};
use newton::Bracket;
pub(crate) use newton::newton;
pub(crate) use on::On;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Stands for the solid itself where pieces that touch tangentially make one smooth surface:
/// whichever of them decides.
pub(crate) const SKIN: u32 = u32::MAX - 1;
/// Most layers of a divided solid: the skin of layer k is [`SKIN`] − k.
pub(crate) const MOST_LAYERS: usize = 1000;

/// Stands for a layer of a divided solid itself, as [`SKIN`] does for an undivided one.
fn skin_of_layer(layer: usize) -> u32 {
    SKIN - layer as u32
}

/// Whether a piece is none, but stands for a layer.
pub(crate) fn is_skin(piece: u32) -> bool {
    piece <= SKIN && piece > SKIN - MOST_LAYERS as u32
}

/// Stands for the piece that decides where none does, because the cell is decided.
pub(crate) const NO_PIECE: u32 = u32::MAX;

/// Sine of the angle below which two pieces count as one smooth surface: two degrees, as in
/// [`crate::FeatureOptions`].
pub(crate) const TANGENT: f64 = 0.0349;
/// Sine of an angle far from tangential, where nothing has to be found out.
const CLEARLY: f64 = 0.5;
/// Newton steps towards a place where two pieces meet: each halves the distance to a tangential
/// one, and 2¹² is far more than from [`CLEARLY`] down to [`TANGENT`].
const MEETING_STEPS: usize = 12;
/// Newton steps shrink the angle at a tangential intersection by about one half; where it keeps
/// more than this share the intersection is transversal.
const SHRINKING: f64 = 0.9;
/// Share of the diagonal of the box below which distances are rounding.
const ROUNDING: f64 = 1e-13;
/// Share of the largest coordinate below which distances are rounding: a few roundings of the three
/// coordinates. It counts where the box is far from the origin.
const OF_COORDINATES: f64 = 8.0 * f64::EPSILON;
/// Newton steps onto pieces, at most; some five are usual.
const STEPS: usize = 30;
/// Cells between two looks at the queue of threads, where a look at each costs a microsecond.
const CHUNK: usize = 1024;

/// Whether two pieces meet at an angle at the nearest point that lies on both.
///
/// Newton's method gets to a transversal intersection in a few steps. Towards a tangential one it
/// only halves the distance each time, and the angle with it, until that is less than [`TANGENT`].
pub(crate) fn meet_at_an_angle(solid: &dyn Solid, pieces: [u32; 2], p: Point3) -> bool {
    let (mut q, mut here) = (p, sine_between(solid, pieces, p));
    let mut rounds = if here > CLEARLY { 0 } else { MEETING_STEPS };
    while rounds > 0 && here > TANGENT {
        let Some((step, _)) = newton(&|i, p| solid.gradient(i, p), &pieces, q) else {
            break;
        };
        q = std::array::from_fn(|i| q[i] - step[i]);
        let next = sine_between(solid, pieces, q);
        if next > SHRINKING * here || next.is_nan() {
            break;
        }
        here = next;
        rounds -= 1;
    }
    here > TANGENT
}

/// The sine of the angle between two pieces; 2 where it is obtuse.
fn sine_between(solid: &dyn Solid, pieces: [u32; 2], p: Point3) -> f64 {
    let [a, b] = pieces.map(|i| solid.gradient(i, p).1);
    if dot(a, b) < 0.0 {
        2.0
    } else {
        norm(cross(a, b)) / (norm(a) * norm(b))
    }
}

/// A layer of a divided solid, as [`Surface`] sees it.
#[derive(Clone, Copy)]
pub(crate) struct LayerCells<'s> {
    /// The lattice with what of the layer's tree matters in each cell.
    pub(crate) lattice: &'s Lattice,
    /// Its first piece.
    pub(crate) first: u32,
}

/// The solid as the mesher asks it.
pub(crate) struct Surface<'s> {
    pub(crate) solid: &'s dyn Solid,
    pub(crate) lattice: &'s Lattice,
    /// The layers of a solid that is divided into regions; none of one that is not.
    pub(crate) layers: &'s [LayerCells<'s>],
    /// How many layers divide the solid: those behind them are sides of a unit cell.
    pub(crate) dividers: usize,
    /// The box of a unit cell.
    pub(crate) torus: Option<Torus>,
    /// The layer whose value counts as that of the solid.
    pub(crate) focus: usize,
    /// Below this distance a value is 0: rounding, and pieces that coincide.
    pub(crate) zero: f64,
    /// Whether cells are smaller where the surface bends.
    pub(crate) bends: bool,
    /// Whether pieces that touch are held where a third one separates them.
    pub(crate) seams: bool,
    /// Whether there are such places.
    pub(crate) has_seams: AtomicBool,
    /// Tips of cones, where there is to be a vertex.
    pub(crate) apexes: Vec<Corner>,
    /// Whether equals are put in order by their places, as if at random, and not by their numbers:
    /// where all vertices along a flat face are equal, an order along the face would let each
    /// depend on the one before it, from one end to the other.
    pub(crate) by_place: bool,
    pub(crate) control: &'s Control<'s>,
}

/// A point and the solid's value there.
pub(crate) type Valued = (Point3, f64);

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

/// The distance below which values in a region are rounding.
pub(crate) fn zero_in(region: Aabb) -> f64 {
    let reach = region.lo.into_iter().chain(region.hi);
    let far = reach.fold(0.0, |far: f64, v| far.max(v.abs()));
    (ROUNDING * region.diagonal()).max(OF_COORDINATES * far)
}

/// The distance of a point to a piece, to first order.
pub(crate) fn first_order_at(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let (g, d) = solid.gradient(piece, p);
    first_order(g, d)
}

/// The distance of a point to a solid's surface, to first order, negative outside.
pub(crate) fn distance_at(solid: &dyn Solid, p: Point3) -> f64 {
    solid.tree().value(&|piece| first_order_at(solid, piece, p))
}

impl<'s> Surface<'s> {
    /// The surface of a solid in a box.
    pub(crate) fn new(
        solid: &'s dyn Solid,
        lattice: &'s Lattice,
        region: Aabb,
        control: &'s Control<'s>,
    ) -> Self {
        Self {
            solid,
            lattice,
            layers: &[],
            dividers: 0,
            torus: None,
            focus: 0,
            zero: zero_in(region),
            bends: true,
            seams: true,
            has_seams: AtomicBool::new(false),
            apexes: Vec::new(),
            by_place: false,
            control,
        }
    }
}

impl<'s> Surface<'s> {
    /// Where something stands among its equals: the same for all, unless places decide.
    pub(crate) fn rank(&self, p: Point3) -> u64 {
        if self.by_place { hash(p) } else { 0 }
    }

    /// Distance of a point to a piece, to first order; 0 within rounding. On a side of a unit cell
    /// it is 0 if it is so as seen from anywhere.
    pub(crate) fn distance(&self, piece: u32, p: Point3) -> f64 {
        if is_skin(piece) {
            return self.value_in(self.layer_of(piece), p).0;
        }
        let v = first_order_at(self.solid, piece, p);
        if v.abs() <= self.zero {
            0.0
        } else if self.torus.is_some() {
            self.distance_within(piece, p).unwrap_or(v)
        } else {
            v
        }
    }

    /// Distance of a point to a piece as seen from a place: on a side of a unit cell a piece is
    /// another one on the other side.
    pub(crate) fn distance_from(&self, piece: u32, p: Point3, from: Point3) -> f64 {
        match &self.torus {
            Some(torus) if !self.is_side(piece) => self.distance(piece, torus.beside(p, from)),
            _ => self.distance(piece, p),
        }
    }

    /// Distance of a point to a piece, where on a side of a unit cell the nearest image of it
    /// counts.
    pub(crate) fn nearest_distance(&self, piece: u32, p: Point3) -> f64 {
        if is_skin(piece) {
            return self.distance(piece, p);
        }
        let v = first_order_at(self.solid, piece, p);
        if v.abs() <= self.zero { 0.0 } else { v }
    }

    /// Distance of a point on sides of a unit cell as seen from within the box. A piece that does
    /// not vanish at any image of it must be seen from one place with the others: the nearest of
    /// its images may be outside of what the point is inside of.
    #[cold]
    fn distance_within(&self, piece: u32, p: Point3) -> Option<f64> {
        let torus = self.torus.as_ref()?;
        let is_on_side = torus.is_on_side(p).contains(&true) && !self.is_side(piece);
        is_on_side.then(|| first_order_at(self.solid, piece, torus.inner(p)))
    }

    /// Value of the solid and the piece that decides it; ±∞ and [`NO_PIECE`] in cells that are
    /// decided.
    pub(crate) fn value(&self, p: Point3) -> (f64, u32) {
        self.value_in(self.focus, p)
    }

    /// Value of a layer and the piece that decides it, as [`Self::value`] tells of the solid.
    pub(crate) fn value_in(&self, layer: usize, p: Point3) -> (f64, u32) {
        let lattice = self.lattice_of(layer);
        match lattice.state_at(p) {
            IN => (f64::INFINITY, NO_PIECE),
            OUT => (f64::NEG_INFINITY, NO_PIECE),
            k => lattice
                .reduced(k)
                .expect("undecided cells have a tree")
                .tree
                .value_and_piece(&|i| self.distance(i, p)),
        }
    }

    /// The middle of a cell where the function is not a number, of those that `is_asked` for.
    ///
    /// Asked before anything is made of the cells: intervals decide nothing where it is none, so
    /// that all of space would be cut up in search of features.
    pub(crate) fn not_a_number(&self, is_asked: impl Fn(Point3) -> bool + Sync) -> Option<Point3> {
        let middle = |c: usize| {
            self.lattice
                .point(self.lattice.indices(c).map(|i| 2 * i + 1))
        };
        let is_none = |c: &usize| {
            self.lattice.reduced(self.lattice.state[*c]).is_some()
                && !self.control.is_stopped()
                && self.value(middle(*c)).0.is_nan()
                && is_asked(middle(*c))
        };
        (0..self.lattice.state.len())
            .into_par_iter()
            .with_min_len(CHUNK)
            .find_first(is_none)
            .map(middle)
    }

    /// The layer that a piece belongs to.
    #[inline]
    pub(crate) fn layer_of(&self, piece: u32) -> usize {
        if is_skin(piece) {
            return (SKIN - piece) as usize;
        }
        let before = self.layers.partition_point(|l| l.first <= piece);
        before.saturating_sub(1)
    }

    /// The one layer that pieces belong to, if it is one.
    pub(crate) fn common_layer(&self, pieces: &[u32]) -> Option<usize> {
        let layer = self.layer_of(*pieces.first()?);
        let is_there = |&piece: &u32| self.layer_of(piece) == layer;
        pieces.iter().all(is_there).then_some(layer)
    }

    /// The lattice of a layer.
    #[inline]
    pub(crate) fn lattice_of(&self, layer: usize) -> &'s Lattice {
        self.layers.get(layer).map_or(self.lattice, |l| l.lattice)
    }

    /// Value of a region: it lies in the whole and in its divider, and in none before that. The
    /// last one has none.
    pub(crate) fn value_of_region(&self, region: usize, p: Point3) -> f64 {
        let value = |layer: usize| self.value_in(layer, p).0;
        let dividers = self.dividers;
        let own = (region < dividers).then(|| value(region + 1));
        let before = (1..=region.min(dividers)).map(|layer| -value(layer));
        before.chain(own).fold(value(0), f64::min)
    }

    /// What of a layer's tree matters around a point; none if it is decided there.
    pub(crate) fn reduced_in(&self, layer: usize, p: Point3) -> Option<&'s Reduced> {
        self.lattice_of(layer).reduced_at(p)
    }

    /// The piece of the side of a unit cell across an axis, as it is seen from below.
    pub(crate) fn side_piece(&self, axis: usize) -> Option<u32> {
        let axes = self.torus?.axes;
        let before = axes[..axis].iter().filter(|&&repeats| repeats).count();
        let layer = self.layers.get(self.dividers + 1 + before)?;
        axes[axis].then_some(layer.first)
    }

    /// Whether a piece is that of a side of a unit cell.
    #[inline]
    pub(crate) fn is_side(&self, piece: u32) -> bool {
        self.torus.is_some() && piece < STRAY && self.layer_of(piece) > self.dividers
    }

    /// The sides of a unit cell that a point is on.
    pub(crate) fn sides_at(&self, p: Point3) -> On {
        let Some(torus) = &self.torus else {
            return On::default();
        };
        let is_on_side = torus.is_on_side(p);
        let axes = (0..3).filter(|&axis| is_on_side[axis]);
        let pieces: Vec<u32> = axes.filter_map(|axis| self.side_piece(axis)).collect();
        On::of(&pieces)
    }

    /// Keeps of pieces on which the corners of a face may lie those that are near it on the side of
    /// a place: corners on a side of a unit cell lie on the pieces behind that as well.
    pub(crate) fn keep_beside(&self, pieces: &mut Vec<u32>, face: [Point3; 3], within: Point3) {
        let Some(torus) = &self.torus else { return };
        let middle = centroid(face);
        let reach = face
            .iter()
            .map(|&p| norm(sub(p, middle)))
            .fold(0.0, f64::max);
        let beside = torus.beside(middle, within);
        let is_near = |&i: &u32| self.distance(i, beside).abs() <= reach;
        if pieces.iter().any(is_near) {
            pieces.retain(is_near);
        }
    }

    /// Whether nothing but sides of a unit cell holds a vertex.
    pub(crate) fn holds_only_sides(&self, on: &On) -> bool {
        on.slice().iter().all(|&piece| self.is_side(piece))
    }

    /// A point on sides of a unit cell, where the vertices of lower sides are.
    pub(crate) fn on_lower_sides(&self, mut p: Point3, on: &On) -> Point3 {
        if let Some(torus) = &self.torus {
            for axis in 0..3 {
                if self.side_piece(axis).is_some_and(|side| on.contains(side)) {
                    p[axis] = torus.region.lo[axis];
                }
            }
        }
        p
    }

    /// The pieces of the whole and of what divides it that matter around a point.
    pub(crate) fn pieces_near(&self, p: Point3) -> Vec<u32> {
        let layers = 0..=self.dividers;
        let reduced = layers.filter_map(|layer| self.reduced_in(layer, p));
        reduced
            .flat_map(|reduced| &reduced.pieces)
            .copied()
            .collect()
    }

    /// As [`Self::pieces_near`]; on a side of a unit cell those on either side of it.
    pub(crate) fn pieces_around(&self, p: Point3) -> Vec<u32> {
        let Some(torus) = &self.torus else {
            return self.pieces_near(p);
        };
        let images = torus.images(p);
        unique(
            images
                .into_iter()
                .flat_map(|p| self.pieces_near(p))
                .collect(),
        )
    }

    /// Whether each of the layers that pieces belong to has its surface at a point.
    pub(crate) fn are_bounded_at(&self, pieces: &[u32], p: Point3) -> bool {
        let value = |&piece: &u32| self.value_in(self.layer_of(piece), p).0;
        pieces.iter().all(|piece| value(piece).abs() <= self.zero)
    }

    /// Stands for the solid that a piece is one of.
    pub(crate) fn skin(&self, piece: u32) -> u32 {
        skin_of_layer(self.layer_of(piece))
    }

    /// Whether no other piece can decide the solid's sign around the point.
    pub(crate) fn is_alone(&self, piece: u32, p: Point3) -> bool {
        self.reduced_in(self.layer_of(piece), p)
            .is_some_and(|reduced| reduced.pieces == [piece])
    }

    /// Value and gradient of a piece, or of the one that decides.
    pub(crate) fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        if !is_skin(piece) {
            return self.solid.gradient(piece, p);
        }
        match self.value_in(self.layer_of(piece), p).1 {
            NO_PIECE => (f64::INFINITY, [0.0; 3]),
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
        for _ in 0..STEPS {
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

    /// Where the solid's value changes sign between two points with values of different signs: the
    /// share of the way and the piece that vanishes there.
    pub(crate) fn root(&self, a: Valued, b: Valued) -> Option<(f64, u32)> {
        self.root_by(a, b, |p| self.value(p))
    }

    /// Where one piece alone changes its sign between two points, as seen from a place beside
    /// them: the share of the way.
    pub(crate) fn root_of(&self, piece: u32, a: Valued, b: Valued, from: Point3) -> Option<f64> {
        let root = self.root_by(a, b, |p| (self.distance_from(piece, p, from), piece));
        root.map(|r| r.0)
    }

    fn root_by(
        &self,
        a: Valued,
        b: Valued,
        f: impl Fn(Point3) -> (f64, u32),
    ) -> Option<(f64, u32)> {
        let mut bracket = Bracket::new(a.1, b.1);
        for _ in 0..Bracket::STEPS {
            let m = bracket.guess();
            let (v, piece) = f(along(a.0, b.0, m));
            if v.is_nan() {
                return None;
            }
            if v.abs() <= self.zero || !bracket.holds(m) {
                return (piece != NO_PIECE).then_some((m, piece));
            }
            bracket.narrow(m, v);
        }
        None
    }
}
