//! Geometry of the solid's pieces: values near the surface, projection onto one, two or three
//! pieces, and tests for faces, edges and corners.
//!
//! A *piece* is one smooth function g of the solid's tree. Its distance at a point is the
//! first-order distance g/|∇g|. Vertices of the mesh are held on pieces: on one within a face, on
//! two along an edge, on three at a corner of the solid.

mod bounds;
mod contact;
mod newton;
mod on;

use crate::complex::STRAY;
use crate::decide::{Local, Scratch};
use crate::distance::{first_order_at, zero_in};
use crate::features::Corner;
use crate::lattice::{INSIDE_CELL, Lattice, OUTSIDE_CELL, ReducedTree};
use crate::points::{centroid, hash, lerp, unique};
use crate::torus::Torus;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, dot, norm, sub};
use isoform_num::Interval;
use newton::Bracket;
pub(crate) use newton::newton;
pub(crate) use on::On;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Pseudo-piece of the whole solid, used where pieces that touch tangentially form one smooth
/// surface: whichever of them decides.
pub(crate) const SKIN: u32 = u32::MAX - 1;
/// Maximum number of layers of a divided solid; the pseudo-piece of layer k is [`SKIN`] − k.
pub(crate) const MAX_DIVIDED_LAYERS: usize = 1000;

/// Returns the pseudo-piece of a layer of a divided solid.
fn skin_of_layer(layer: usize) -> u32 {
    SKIN - layer as u32
}

/// Returns true for the pseudo-piece of a layer.
pub(crate) fn is_skin(piece: u32) -> bool {
    piece <= SKIN && piece > SKIN - MAX_DIVIDED_LAYERS as u32
}

/// Pseudo-piece that decides in cells that lie completely inside or outside.
pub(crate) const NO_PIECE: u32 = u32::MAX;

/// Sine of the angle, two degrees, below which two pieces count as one smooth surface; equal to the
/// limit in [`crate::FeatureOptions`].
pub(crate) const MAX_TANGENT_SINE: f64 = 0.0349;

/// Returns true if two pieces meet at an angle at the nearest point on both.
///
/// Newton's method converges to a transversal intersection within a few steps. Towards a tangential
/// one it only halves the distance each time, and the angle with it, until that is below
/// [`MAX_TANGENT_SINE`].
pub(crate) fn meet_at_an_angle(solid: &dyn Solid, pieces: [u32; 2], p: Point3) -> bool {
    let (mut q, mut here) = (p, sine_between(solid, pieces, p));
    // A sine above 0.5 is clearly transversal. Otherwise each of twelve steps halves the angle
    // towards a tangential intersection, and 2¹² is far more than from 0.5 down to the limit.
    let mut rounds = if here > 0.5 { 0 } else { 12 };
    while rounds > 0 && here > MAX_TANGENT_SINE {
        let Some((step, _)) = newton(&|i, p| solid.gradient(i, p), &pieces, q) else {
            break;
        };
        q = std::array::from_fn(|i| q[i] - step[i]);
        let next = sine_between(solid, pieces, q);
        // Newton steps shrink the angle at a tangential intersection by about one half; if more
        // than nine tenths remain the intersection is transversal.
        if next > 0.9 * here || next.is_nan() {
            break;
        }
        here = next;
        rounds -= 1;
    }
    here > MAX_TANGENT_SINE
}

/// Returns the sine of the angle between two pieces; 2 if it is obtuse.
fn sine_between(solid: &dyn Solid, pieces: [u32; 2], p: Point3) -> f64 {
    let [a, b] = pieces.map(|i| solid.gradient(i, p).1);
    if dot(a, b) < 0.0 {
        2.0
    } else {
        norm(cross(a, b)) / (norm(a) * norm(b))
    }
}

/// A layer of a divided solid, as used by [`Surface`].
#[derive(Clone, Copy)]
pub(crate) struct LayerCells<'s> {
    /// Lattice with the part of the layer's tree that matters in each cell.
    pub(crate) lattice: &'s Lattice,
    /// First piece of the layer.
    pub(crate) first: u32,
}

/// A solid with its lattice, as queried by the mesher.
pub(crate) struct Surface<'s> {
    pub(crate) solid: &'s dyn Solid,
    pub(crate) lattice: &'s Lattice,
    /// Layers of a solid that is divided into regions; empty if it is not divided.
    pub(crate) layers: &'s [LayerCells<'s>],
    /// Number of layers that divide the solid: further ones are sides of a unit cell.
    pub(crate) dividers: usize,
    /// Periodic box of a unit cell.
    pub(crate) torus: Option<Torus>,
    /// Layer whose value counts as that of the solid.
    pub(crate) focus: usize,
    /// Distance below which a value counts as 0, because of rounding or coincident pieces.
    pub(crate) zero: f64,
    /// True if cells are smaller where the surface bends.
    pub(crate) bends: bool,
    /// True if vertices on touching pieces are held on the seam where a third piece separates them.
    pub(crate) seams: bool,
    /// True once a seam was found.
    pub(crate) has_seams: AtomicBool,
    /// Tips of cones, each of which needs a vertex.
    pub(crate) apexes: Vec<Corner>,
    /// True if equal candidates are ordered by a hash of their positions instead of their indices.
    /// Along a flat face all vertices are equal candidates; ordered along the face, each would
    /// depend on its predecessor, from one end to the other.
    pub(crate) by_place: bool,
    pub(crate) control: &'s Control<'s>,
}

/// A point and the solid's value there.
pub(crate) type Valued = (Point3, f64);

impl<'s> Surface<'s> {
    /// Creates the surface of a solid in a box.
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
    /// Returns the key for breaking ties: a hash of the position if `by_place`, else 0.
    pub(crate) fn rank(&self, p: Point3) -> u64 {
        if self.by_place { hash(p) } else { 0 }
    }

    /// Returns the first-order distance of a point from a piece; 0 within rounding. On a side of a
    /// unit cell it is 0 if it vanishes at any periodic image.
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

    /// Returns the distance of a point from a piece, evaluated on the side of `from`: a piece
    /// differs between opposite sides of a unit cell.
    pub(crate) fn distance_from(&self, piece: u32, p: Point3, from: Point3) -> f64 {
        match &self.torus {
            Some(torus) if !self.is_side(piece) => {
                self.distance(piece, torus.moved_off_side(p, from))
            }
            _ => self.distance(piece, p),
        }
    }

    /// Returns the distance of a point from a piece; on a side of a unit cell that of the nearest
    /// image.
    pub(crate) fn nearest_distance(&self, piece: u32, p: Point3) -> f64 {
        if is_skin(piece) {
            return self.distance(piece, p);
        }
        let v = first_order_at(self.solid, piece, p);
        if v.abs() <= self.zero { 0.0 } else { v }
    }

    /// Returns the distance of a point on sides of a unit cell, evaluated slightly inside the box;
    /// `None` for other points. Pieces that vanish at none of its images must be evaluated at one
    /// point together: at its nearest image, a piece may have another sign.
    #[cold]
    fn distance_within(&self, piece: u32, p: Point3) -> Option<f64> {
        let torus = self.torus.as_ref()?;
        let is_on_side = torus.is_on_side(p).contains(&true) && !self.is_side(piece);
        is_on_side.then(|| first_order_at(self.solid, piece, torus.inner(p)))
    }

    /// Returns the value of the solid and the piece that decides it; ±∞ and [`NO_PIECE`] in cells
    /// that lie completely inside or outside.
    pub(crate) fn value(&self, p: Point3) -> (f64, u32) {
        self.value_in(self.focus, p)
    }

    /// Returns the value of a layer and the piece that decides it, like [`Self::value`].
    pub(crate) fn value_in(&self, layer: usize, p: Point3) -> (f64, u32) {
        let lattice = self.lattice_of(layer);
        match lattice.state_at(p) {
            INSIDE_CELL => (f64::INFINITY, NO_PIECE),
            OUTSIDE_CELL => (f64::NEG_INFINITY, NO_PIECE),
            k => lattice
                .reduced(k)
                .expect("undecided cells have a tree")
                .tree
                .value_and_piece(&|i| self.distance(i, p)),
        }
    }

    /// Returns the centre of a cell where the function is not a number, among those that `is_asked`
    /// accepts.
    ///
    /// This test precedes all use of the cells: where the function is not a number intervals decide
    /// nothing, and the search for features would subdivide all of space.
    pub(crate) fn not_a_number(&self, is_asked: impl Fn(Point3) -> bool + Sync) -> Option<Point3> {
        let middle = |c: usize| {
            self.lattice
                .point(self.lattice.indices(c).map(|i| 2 * i + 1))
        };
        let state = &self.lattice.state;
        let is_mixed = |c: &usize| self.lattice.reduced(state[*c]).is_some();
        let whole = self.may_hide().then(|| Local::everywhere(self.solid));
        let is_hidden = |p: Point3| {
            let value = |w: &Local| w.value(self.solid, p, &mut Scratch::new(self.solid));
            whole.as_ref().map(value).is_some_and(f64::is_nan)
        };
        let is_none = |c: &usize| {
            state[*c] != OUTSIDE_CELL
                && !self.control.is_stopped()
                && ((is_mixed(c) && self.value(middle(*c)).0.is_nan()) || is_hidden(middle(*c)))
                && is_asked(middle(*c))
        };
        let cells = (0..state.len()).into_par_iter();
        // Each cell costs about a microsecond, too little for a task of its own.
        let found = cells.with_min_len(1024).find_first(is_none).map(middle);
        found.or_else(|| {
            // Pieces may be defined where the function of the solid is nowhere.
            let mut mixed = (0..state.len())
                .filter(is_mixed)
                .map(middle)
                .filter(|p| is_asked(*p));
            let is_undefined = |p: Point3| {
                let mut value = [0.0];
                self.solid.sign_values(&[p], &mut value);
                value[0].is_nan()
            };
            let first = mixed.next().filter(|p| is_undefined(*p))?;
            mixed.all(is_undefined).then_some(first)
        })
    }

    /// Returns true if a piece may be undefined in the lattice: the trees of cells lack those that
    /// decide nothing wherever they are defined.
    fn may_hide(&self) -> bool {
        let pieces = self.solid.tree().pieces();
        let [lo, hi] = [[0; 3], self.lattice.n.map(|n| 2 * n)].map(|at| self.lattice.point(at));
        let mut ranges = vec![Interval::ALL; pieces.len()];
        let region = Aabb { lo, hi };
        self.solid.value_bounds(&pieces, region, &mut ranges);
        pieces.len() > 1 && ranges.contains(&Interval::ALL)
    }

    /// Returns the layer of a piece.
    #[inline]
    pub(crate) fn layer_of(&self, piece: u32) -> usize {
        if is_skin(piece) {
            return (SKIN - piece) as usize;
        }
        let before = self.layers.partition_point(|l| l.first <= piece);
        before.saturating_sub(1)
    }

    /// Returns the layer of pieces; `None` if they belong to several.
    pub(crate) fn common_layer(&self, pieces: &[u32]) -> Option<usize> {
        let layer = self.layer_of(*pieces.first()?);
        let is_there = |&piece: &u32| self.layer_of(piece) == layer;
        pieces.iter().all(is_there).then_some(layer)
    }

    /// Returns the lattice of a layer.
    #[inline]
    pub(crate) fn lattice_of(&self, layer: usize) -> &'s Lattice {
        self.layers.get(layer).map_or(self.lattice, |l| l.lattice)
    }

    /// Returns the value of a region: the intersection of the whole with its divider, minus all
    /// earlier dividers. The remainder has no divider.
    pub(crate) fn value_of_region(&self, region: usize, p: Point3) -> f64 {
        let value = |layer: usize| self.value_in(layer, p).0;
        let dividers = self.dividers;
        let own = (region < dividers).then(|| value(region + 1));
        let before = (1..=region.min(dividers)).map(|layer| -value(layer));
        before.chain(own).fold(value(0), f64::min)
    }

    /// Returns the part of a layer's tree that matters around a point; `None` if the cell is
    /// decided.
    pub(crate) fn reduced_in(&self, layer: usize, p: Point3) -> Option<&'s ReducedTree> {
        self.lattice_of(layer).reduced_at(p)
    }

    /// Returns the piece of the side of a unit cell across an axis, as seen from below.
    pub(crate) fn side_piece(&self, axis: usize) -> Option<u32> {
        let axes = self.torus?.axes;
        let before = axes[..axis].iter().filter(|&&repeats| repeats).count();
        let layer = self.layers.get(self.dividers + 1 + before)?;
        axes[axis].then_some(layer.first)
    }

    /// Returns true if a piece is a side of a unit cell.
    #[inline]
    pub(crate) fn is_side(&self, piece: u32) -> bool {
        self.torus.is_some() && piece < STRAY && self.layer_of(piece) > self.dividers
    }

    /// Returns the sides of a unit cell on which a point lies.
    pub(crate) fn sides_at(&self, p: Point3) -> On {
        let Some(torus) = &self.torus else {
            return On::default();
        };
        let is_on_side = torus.is_on_side(p);
        let axes = (0..3).filter(|&axis| is_on_side[axis]);
        let pieces: Vec<u32> = axes.filter_map(|axis| self.side_piece(axis)).collect();
        On::from_pieces(&pieces)
    }

    /// Restricts candidate pieces of a face to those near it on the side of `within`: corners on a
    /// side of a unit cell also lie on the pieces behind it.
    pub(crate) fn keep_beside(&self, pieces: &mut Vec<u32>, face: [Point3; 3], within: Point3) {
        let Some(torus) = &self.torus else { return };
        let middle = centroid(face);
        let reach = face
            .iter()
            .map(|&p| norm(sub(p, middle)))
            .fold(0.0, f64::max);
        let beside = torus.moved_off_side(middle, within);
        let is_near = |&i: &u32| self.distance(i, beside).abs() <= reach;
        if pieces.iter().any(is_near) {
            pieces.retain(is_near);
        }
    }

    /// Returns true if a vertex is held by sides of a unit cell only.
    pub(crate) fn holds_only_sides(&self, on: &On) -> bool {
        on.slice().iter().all(|&piece| self.is_side(piece))
    }

    /// Moves a point on sides of a unit cell to the lower sides, where the vertices are stored.
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

    /// Returns the pieces of the whole and its dividers that matter around a point.
    pub(crate) fn pieces_near(&self, p: Point3) -> Vec<u32> {
        let layers = 0..=self.dividers;
        let reduced = layers.filter_map(|layer| self.reduced_in(layer, p));
        reduced
            .flat_map(|reduced| &reduced.pieces)
            .copied()
            .collect()
    }

    /// Returns the pieces like [`Self::pieces_near`]; on a side of a unit cell those on either side
    /// of it.
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

    /// Returns true if each of the layers of some pieces has its surface at a point.
    pub(crate) fn are_bounded_at(&self, pieces: &[u32], p: Point3) -> bool {
        let value = |&piece: &u32| self.value_in(self.layer_of(piece), p).0;
        pieces.iter().all(|piece| value(piece).abs() <= self.zero)
    }

    /// Returns the pseudo-piece of a piece's layer.
    pub(crate) fn skin(&self, piece: u32) -> u32 {
        skin_of_layer(self.layer_of(piece))
    }

    /// Returns true if no other piece can decide the solid's sign around the point.
    pub(crate) fn is_alone(&self, piece: u32, p: Point3) -> bool {
        self.reduced_in(self.layer_of(piece), p)
            .is_some_and(|reduced| reduced.pieces == [piece])
    }

    /// Returns value and gradient of a piece; of the deciding one for a pseudo-piece.
    pub(crate) fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        if !is_skin(piece) {
            return self.solid.gradient(piece, p);
        }
        match self.value_in(self.layer_of(piece), p).1 {
            NO_PIECE => (f64::INFINITY, [0.0; 3]),
            piece => self.solid.gradient(piece, p),
        }
    }

    /// Takes one Newton step towards the nearest common zero of the pieces.
    pub(crate) fn nearer(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let (step, _) = newton(&|i, p| self.gradient(i, p), pieces, from)?;
        Some(std::array::from_fn(|i| from[i] - step[i]))
    }

    /// Returns the nearest common zero of the pieces: Newton's method with minimal steps, to
    /// rounding.
    pub(crate) fn project(&self, pieces: &[u32], from: Point3) -> Option<Point3> {
        let mut p = from;
        let mut last = f64::INFINITY;
        // About five steps are usual.
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

    /// Finds the sign change of the solid between two points with values of different signs: the
    /// fraction of the segment and the piece that vanishes there.
    pub(crate) fn root(&self, a: Valued, b: Valued) -> Option<(f64, u32)> {
        self.root_by(a, b, |p| self.value(p))
    }

    /// Finds the sign change of one piece between two points, evaluated on the side of `from`: the
    /// fraction of the segment.
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
        for _ in 0..Bracket::MAX_BRACKET_STEPS {
            let m = bracket.guess();
            let (v, piece) = f(lerp(a.0, b.0, m));
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
