//! The part of the parameter plane that a map sends into a box, decomposed exactly.
//!
//! The box |X|, |Y|, |Z| ≤ B|W| is bounded by the six curves X ± B W, Y ± B W, Z ± B W. In each of
//! the four unit triangles their arrangement has finitely many cells, on each of which the map
//! stays either inside the box or outside. A cell inside does not meet the pole curve: if W
//! vanishes at a point inside, all four forms do, so that it is a base point.
//!
//! The sides of a domain are lines that enter the arrangement, too; cells outside of the domain are
//! treated like cells outside of the box. If the map provably sends the closed domain into the open
//! box ([`Region::is_clear`]), the six curves are left out.
//!
//! - *factor*: an irreducible, or at least squarefree, form that is a component of one or more of
//!   these curves.
//! - *wall*, *slab*, *arc*: the parts of an [`Arrangement`]; points, arcs and cells are numbered
//!   from bottom to top.
//! - *fold*: a curve of parameters at which the surface turns back and ends.

mod topology;

pub use topology::RegionTopology;

use crate::deck::Deck;
use crate::domain::{Domain, image_bounds, parameters};
use crate::field::exact;
use crate::map::Map;
use isoform_algebra::{
    Arc, Arrangement, ArrangementError, Poly, QUADRANTS, RBig, Slab, coprime_base, in_triangle,
};
use isoform_control::Control;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use std::collections::BTreeSet;

/// The region in one of the unit triangles.
pub struct Triangle {
    /// Arrangement of the cells; curve k of it is factor k of the region.
    pub arrangement: Arrangement,
    /// True for each cell that the map sends into the box: by slab, cells from bottom to top.
    pub inside: Vec<Vec<bool>>,
}

/// The region in the projective plane.
///
/// ```
/// use isoform_algebra::RBig;
/// use isoform_tess::{Control, Map, Region};
///
/// // A sphere of radius 2 around the cube of half width 1.5 sticks out of its six faces only.
/// let sphere = ["4*s", "4*t", "2*s^2 + 2*t^2 - 2", "s^2 + t^2 + 1"];
/// let map = Map::parse(sphere, Default::default())?;
/// let half_width = RBig::from(3) / RBig::from(2);
/// let region = Region::new(&map, &half_width, &[], &Control::default())?;
/// let topology = region.topology();
/// assert_eq!((topology.euler, topology.components, topology.loops), (2 - 6, 1, 6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Region {
    /// Half the width of the box.
    pub half_width: RBig,
    /// Squarefree and pairwise coprime forms, not necessarily irreducible, whose zeros bound the
    /// region.
    pub factors: Vec<Poly>,
    /// Faces of the box to which each factor belongs: −X, +X, −Y, +Y, −Z, +Z are 0 to 5.
    pub faces: Vec<Vec<usize>>,
    /// Sides of the domain whose lines contain each factor, as bits.
    pub(crate) lines: Vec<u64>,
    /// Factors along which the surface is folded.
    folds: BTreeSet<usize>,
    /// Deck transformations to whose fundamental domain the region is restricted, if any.
    pub(crate) deck: Option<Deck>,
    /// Factors of each of the other curves.
    pub extra: Vec<Vec<usize>>,
    /// The unit triangles, in the order of [`QUADRANTS`].
    pub triangles: Vec<Triangle>,
    /// Part of the parameter plane to which the region is restricted; `None` for the whole plane.
    pub domain: Option<Domain>,
    /// True if the map provably has no pole in the closed domain and sends it into the open box:
    /// then poles and faces are not part of the decomposition.
    pub is_clear: bool,
}

impl Region {
    /// Decomposes the parameters that a map sends into the box \[−B, B\]³, with B = `half_width` >
    /// 0, by the faces of the box and by other curves: forms in (s, t, w).
    ///
    /// # Errors
    /// [`ArrangementError`], if stopped.
    pub fn new(
        map: &Map,
        half_width: &RBig,
        extra: &[Poly],
        control: &Control<'_>,
    ) -> Result<Self, ArrangementError> {
        Self::within(map, half_width, None, None, extra, control)
    }
    /// Decomposes the part of these parameters that is in a domain, and in the fundamental domain
    /// of deck transformations, whose seams are among the other curves.
    ///
    /// # Errors
    /// [`ArrangementError`], if stopped.
    pub(crate) fn within(
        map: &Map,
        half_width: &RBig,
        domain: Option<&Domain>,
        deck: Option<&Deck>,
        extra: &[Poly],
        control: &Control<'_>,
    ) -> Result<Self, ArrangementError> {
        let is_clear = domain.is_some_and(|d| is_clear(map, half_width, d));
        let faces = if is_clear {
            Vec::new()
        } else {
            face_curves(map, half_width)
        };
        let lines = domain.map(Domain::lines).unwrap_or_default();
        let folds = deck.map_or(&[][..], |d| &d.folds.curves);
        let borders = faces.iter().chain(&lines).chain(folds);
        let all: Vec<Poly> = borders.chain(extra).cloned().collect();
        let (factors, mut divisors) = coprime_base(&all);
        let extra = divisors.split_off(faces.len() + lines.len() + folds.len());
        let of_folds = divisors.split_off(faces.len() + lines.len());
        let of_lines = divisors.split_off(faces.len());
        let of_faces = divisors;
        let limits = Limits {
            faces: &faces,
            domain,
            deck,
        };
        let triangles = (0..4)
            .into_par_iter()
            .map(|quadrant| Triangle::new(&factors, quadrant, &limits, control));
        let triangles: Vec<Result<Triangle, ArrangementError>> = triangles.collect();
        let triangles = triangles.into_iter().collect::<Result<_, _>>()?;
        let bits = |places: Vec<usize>| places.iter().fold(0, |bits, k| bits | 1 << k);
        let numbers = 0..factors.len();
        Ok(Self {
            half_width: half_width.clone(),
            faces: numbers.clone().map(|f| having(&of_faces, f)).collect(),
            lines: numbers.map(|f| bits(having(&of_lines, f))).collect(),
            factors,
            folds: of_folds.into_iter().flatten().collect(),
            deck: deck.cloned(),
            extra,
            triangles,
            domain: domain.cloned(),
            is_clear,
        })
    }
    /// Returns true if the surface may end elsewhere than in the box's faces.
    fn has_borders(&self) -> bool {
        self.domain.is_some()
            || (0..3).any(|side| self.is_fold_side(side))
            || !self.folds.is_empty()
    }
    /// Iterates over the factors along which the surface is folded.
    pub(crate) fn folds(&self) -> impl Iterator<Item = usize> {
        self.folds.iter().copied()
    }
    /// Returns true if a point (s : t : w) is in the fundamental domain, or if there is none.
    pub(crate) fn is_fundamental(&self, p: &[RBig; 3]) -> bool {
        self.deck.as_ref().is_none_or(|d| d.holds(p))
    }
    /// Returns true if the surface is folded along a factor.
    pub(crate) fn is_fold(&self, factor: usize) -> bool {
        self.folds.contains(&factor)
    }
    /// Returns true if the surface is folded along a side of the unit triangles.
    pub(crate) fn is_fold_side(&self, side: usize) -> bool {
        self.deck.as_ref().is_some_and(|d| d.folds.sides[side])
    }
    /// Returns the side of the domain, as a bit, on which an arc over a slab lies. An arc that lies
    /// on the line of a side but not on the side gives 0; a fold counts as the first side.
    pub(crate) fn side_of_arc(&self, quadrant: usize, slab: usize, place: usize) -> u64 {
        let a = &self.triangles[quadrant].arrangement;
        let (u, curve) = (&a.slabs[slab].u, a.slabs[slab].arcs[place].curve);
        let is_fold = match curve {
            c if c == a.lower() => self.is_fold_side(1),
            c if c == a.upper() => self.is_fold_side(2),
            c => self.folds.contains(&c),
        };
        if is_fold {
            return FOLD_BIT;
        }
        let v = match curve {
            c if c == a.lower() => Some(RBig::ZERO),
            c if c == a.upper() => Some(RBig::ONE - u),
            c if self.lines[c] != 0 => on_line(a.curve(c), u),
            _ => None,
        };
        v.map_or(0, |v| self.side_at(quadrant, [u, &v]))
    }
    /// Returns the side of the domain, as a bit, on which the wall between a point and the next one
    /// lies, or [`FOLD_BIT`].
    pub(crate) fn side_of_wall(&self, quadrant: usize, wall: usize, point: usize) -> u64 {
        let w = &self.triangles[quadrant].arrangement.walls[wall];
        if point + 1 >= w.points.len() {
            return 0;
        }
        let has = |is_such: &dyn Fn(usize) -> bool| w.vertical.iter().any(|&f| is_such(f));
        if wall == 0 && self.is_fold_side(0) || has(&|f| self.folds.contains(&f)) {
            return FOLD_BIT;
        }
        // The side u = 0 of the unit triangle, or a vertical line.
        let is_line = wall == 0 || has(&|f| self.lines[f] != 0);
        if self.domain.is_none() || !is_line {
            return 0;
        }
        let Some(u) = w.u.to_rational() else {
            return 0;
        };
        let v = (&w.points[point].hi + &w.points[point + 1].lo) / RBig::from(2);
        self.side_at(quadrant, [&u, &v])
    }
    /// Returns the side of the domain, as a bit, on which a place on a side of a unit triangle
    /// lies, or [`FOLD_BIT`]. No curve may pass through the place.
    pub(crate) fn side_of_place(&self, quadrant: usize, at: [f64; 2]) -> u64 {
        let side = at.iter().position(|x| *x == 0.0).unwrap_or(2);
        if self.is_fold_side(side) {
            return FOLD_BIT;
        }
        if self.domain.is_none() {
            return 0;
        }
        let [u, v] = at.map(exact);
        self.side_at(quadrant, [&u, &v])
    }
    /// Returns the side of the domain, as a bit, on which a point of a unit triangle lies.
    fn side_at(&self, quadrant: usize, at: [&RBig; 2]) -> u64 {
        let side = |d: &Domain| d.side_at(&parameters(quadrant, at)?);
        self.domain.as_ref().and_then(side).map_or(0, |k| 1 << k)
    }
    /// Returns all sides of the domain, as bits, that end in a point of a wall or pass through it.
    pub(crate) fn sides_of_point(&self, quadrant: usize, wall: usize, point: usize) -> u64 {
        if !self.has_borders() {
            return 0;
        }
        let a = &self.triangles[quadrant].arrangement;
        let mut bits = self.side_of_wall(quadrant, wall, point);
        if let Some(below) = point.checked_sub(1) {
            bits |= self.side_of_wall(quadrant, wall, below);
        }
        for (slab, hand) in beside(wall) {
            let arcs = a.slabs.get(slab).map_or(&[][..], |s| &s.arcs);
            for place in (0..arcs.len()).filter(|&i| hand.end(&arcs[i]) == point) {
                bits |= self.side_of_arc(quadrant, slab, place);
            }
        }
        bits
    }
}

/// Bit of the curves along which the surface is folded. It is also that of the first side of a
/// domain, but maps over a domain have no folds.
pub(crate) const FOLD_BIT: u64 = 1;

/// Returns the curves of parameters that are sent into the planes of the box's faces, in the order
/// of [`Region::faces`].
fn face_curves(map: &Map, half_width: &RBig) -> Vec<Poly> {
    let [forms @ .., w] = map.forms();
    let far = w.scale(half_width);
    forms.iter().flat_map(|x| [x + &far, x - &far]).collect()
}

/// Returns the indices of the lists that contain a number.
fn having(lists: &[Vec<usize>], number: usize) -> Vec<usize> {
    let found = (0..lists.len()).filter(|&k| lists[k].contains(&number));
    found.collect()
}

/// Returns (s : t : w) of a point of a unit triangle.
fn homogeneous(quadrant: usize, [u, v]: [&RBig; 2]) -> [RBig; 3] {
    let [s, t] = QUADRANTS[quadrant].map(RBig::from);
    [s * u, t * v, RBig::ONE - u - v]
}

/// Returns true if the map provably has no pole in a closed domain and sends it into the open box.
pub(crate) fn is_clear(map: &Map, half_width: &RBig, domain: &Domain) -> bool {
    let inside = |[lo, hi]: &[RBig; 2]| *lo > -half_width && hi < half_width;
    image_bounds(map.affine(), &domain.bounds()).is_some_and(|b| b.iter().all(inside))
}

/// Returns v on a line over u; `None` on a vertical line.
fn on_line(line: &Poly, u: &RBig) -> Option<RBig> {
    let rest = line.set(0, u);
    let slope = rest.coefficient([0, 1, 0, 0]);
    (!slope.is_zero()).then(|| -rest.coefficient([0; 4]) / slope)
}

/// Conditions on a cell of the region.
struct Limits<'a> {
    /// Curves of [`face_curves`]; empty if the map provably stays in the box.
    faces: &'a [Poly],
    domain: Option<&'a Domain>,
    deck: Option<&'a Deck>,
}

impl Limits<'_> {
    /// Returns true for each cell of a slab, from bottom to top, that belongs to the region;
    /// `faces` are the curves of the box's faces in the unit triangle.
    fn cells_held(&self, slab: &Slab, faces: &[Poly], quadrant: usize) -> Vec<bool> {
        let faces: Vec<Poly> = faces.iter().map(|f| f.set(0, &slab.u)).collect();
        let is_held = |v: &RBig| {
            self.admits(quadrant, [&slab.u, v])
                && faces
                    .chunks(2)
                    .all(|pair| is_between(&pair[0], &pair[1], v))
        };
        slab.between.iter().map(is_held).collect()
    }
    /// Returns true if a point of a unit triangle is in the domain and in the fundamental domain.
    fn admits(&self, quadrant: usize, at: [&RBig; 2]) -> bool {
        let in_domain = |d: &Domain| parameters(quadrant, at).is_some_and(|p| d.contains(&p));
        self.domain.is_none_or(in_domain)
            && self
                .deck
                .is_none_or(|d| d.holds(&homogeneous(quadrant, at)))
    }
}

/// Returns true if a coordinate is between two opposite faces of the box at v: their polynomials,
/// in v alone, have different signs there, or one of them vanishes.
fn is_between(low: &Poly, high: &Poly, v: &RBig) -> bool {
    let [low, high] = [low, high].map(|face| {
        let value = face.set(1, v).as_constant();
        value.expect("both variables have values")
    });
    low.sign() != high.sign() || low.is_zero() || high.is_zero()
}

/// Side of a wall on which a slab lies.
#[derive(Clone, Copy)]
enum Hand {
    /// The slab is on the left of the wall: its arcs end there.
    Left,
    /// The slab is on the right of the wall: its arcs begin there.
    Right,
}

impl Hand {
    /// Returns the point of the wall at which an arc of the slab has its end.
    fn end(self, arc: &Arc) -> usize {
        match self {
            Self::Left => arc.right,
            Self::Right => arc.left,
        }
    }
}

/// Returns the indices of the slabs on both sides of a wall; a slab with such an index need not
/// exist.
fn beside(wall: usize) -> [(usize, Hand); 2] {
    [(wall.wrapping_sub(1), Hand::Left), (wall, Hand::Right)]
}

impl Triangle {
    /// Decomposes a unit triangle by the factors.
    fn new(
        factors: &[Poly],
        quadrant: usize,
        limits: &Limits<'_>,
        control: &Control<'_>,
    ) -> Result<Self, ArrangementError> {
        let local = |f: &Poly| in_triangle(f, quadrant);
        let curves: Vec<Poly> = factors.iter().map(local).collect();
        let arrangement = Arrangement::new(&curves, control)?;
        let faces: Vec<Poly> = limits.faces.iter().map(local).collect();
        let slabs = arrangement.slabs.iter();
        let inside = slabs.map(|slab| limits.cells_held(slab, &faces, quadrant));
        Ok(Self {
            inside: inside.collect(),
            arrangement,
        })
    }
    /// Returns true if a point of a wall belongs to the closure of a cell inside.
    pub(crate) fn holds_point(&self, wall: usize, point: usize) -> bool {
        self.cells_at(wall, point, point).next().is_some()
    }
    /// Returns true if the wall between a point and the next one belongs to the closure of a cell
    /// inside.
    pub(crate) fn holds_segment(&self, wall: usize, point: usize) -> bool {
        self.cells_at(wall, point, point + 1).next().is_some()
    }
    /// Returns true for each of the cells on the left and on the right of the wall between a point
    /// and the next one that is inside.
    pub(crate) fn sides_held(&self, wall: usize, point: usize) -> [bool; 2] {
        let mut held = [false; 2];
        for cell in self.cells_at(wall, point, point + 1) {
            held[usize::from(cell.slab == wall)] = true;
        }
        held
    }
    /// Iterates over the cells inside whose closure contains a segment of a wall between two
    /// points, or a single point.
    fn cells_at(&self, wall: usize, from: usize, to: usize) -> impl Iterator<Item = RegionCell> {
        let slabs = &self.arrangement.slabs;
        let slabs_beside = beside(wall).into_iter().filter(|s| s.0 < slabs.len());
        slabs_beside.flat_map(move |(slab, hand)| {
            let end = move |i: usize| hand.end(&slabs[slab].arcs[i]);
            (0..self.inside[slab].len())
                .filter(move |&i| self.inside[slab][i] && end(i) <= from && to <= end(i + 1))
                .map(move |place| RegionCell { slab, place })
        })
    }
    /// Returns true if a curve other than the side itself passes through the point of the wall.
    pub(crate) fn is_real(&self, wall: usize, point: usize) -> bool {
        let n = self.arrangement.lower();
        let w = &self.arrangement.walls[wall];
        w.points[point].curves.iter().any(|&c| c < n) || !w.vertical.is_empty()
    }
}

/// A cell of a triangle, by its slab and its place there from the bottom.
#[derive(Clone, Copy, Debug)]
struct RegionCell {
    slab: usize,
    place: usize,
}
