//! The arrangement of plane algebraic curves in the unit triangle u ≥ 0, v ≥ 0, u + v ≤ 1, exactly:
//! a cylindrical decomposition.
//!
//! Over every critical u (a vertical tangent or singular point of a curve, an intersection of two,
//! an intersection with a side) stands a [`Wall`] with the points of the curves on it; between two
//! walls lies a [`Slab`], in which the curves are disjoint graphs over u. Which arc ends in which
//! point is decided by lines v = c between the points of a wall, which no curve crosses as far as a
//! u close enough to the wall (G. E. Collins, 1975; D. S. Arnon, G. E. Collins, S. McCallum, SIAM
//! J. Comput. 13, 1984). No genericity is assumed: several critical points may share a wall, and a
//! curve may contain the wall.
//!
//! Four triangles, one per quadrant of (s, t), make up the projective plane.

use crate::fibre::{FIRST_BITS, FIRST_FIBRE_BITS, Fibre, FibreError, Fibres};
use crate::float_roots::{
    Bounded, Number, Wide, all_roots, certain_bernstein, proved_roots, stretched,
};
use crate::modular::bits;
use crate::poly::Poly;
use crate::precision::{DOUBLED, Growth, refine_until};
use crate::resultant::{ResultantError, Subresultants, resultant};
use crate::roots::{RealRoot, real_roots, simplest_between};
use crate::upoly::UPoly;
use dashu_int::UBig;
use dashu_ratio::RBig;
use isoform_control::Control;
use isoform_num::Interval;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// The variable that varies from wall to wall, and the one along a wall.
const U: usize = 0;
const V: usize = 1;

/// Why there is no arrangement.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ArrangementError {
    /// Two curves share a component.
    #[error("curves {0} and {1} share a component")]
    CommonComponent(usize, usize),
    /// A polynomial that is zero.
    #[error("curve {0} is the whole plane")]
    Zero(usize),
    /// More than two variables, or stopped.
    #[error(transparent)]
    Resultant(#[from] ResultantError),
}

/// A place on a wall that a curve or a side goes through.
#[derive(Clone, Debug)]
pub struct WallPoint {
    /// v is in \[lo, hi\], and that of no other point of the wall is.
    pub lo: RBig,
    /// See `lo`.
    pub hi: RBig,
    /// The curves that go through it, ascending; [`Arrangement::lower`] and [`Arrangement::upper`]
    /// among them.
    pub curves: Vec<usize>,
}

/// A vertical line over a critical u, within the triangle.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Where.
    pub u: RealRoot,
    /// Its points from the side v = 0 to the side u + v = 1, both of which have one. At u = 1 they
    /// are the same.
    pub points: Vec<WallPoint>,
    /// Curves that contain the whole line.
    pub vertical: Vec<usize>,
}

/// A piece of a curve between two walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arc {
    /// The curve.
    pub curve: usize,
    /// The point of the wall on the left that it ends in.
    pub left: usize,
    /// The same on the right.
    pub right: usize,
}

/// What lies between two neighbouring walls: wall k is on the left of slab k.
#[derive(Clone, Debug)]
pub struct Slab {
    /// A rational u strictly between the walls.
    pub u: RBig,
    /// The arcs from bottom to top; the first is the side v = 0, the last the side u + v = 1.
    pub arcs: Vec<Arc>,
    /// A rational v strictly between each arc and the next, at `u`.
    pub between: Vec<RBig>,
}

/// The decomposition of the unit triangle by curves.
pub struct Arrangement {
    curves: Vec<Poly>,
    /// Their terms with coefficients known to rounding, and to twice as many digits.
    terms: Vec<Terms<Interval>>,
    wide: Vec<Terms<Wide>>,
    /// Which curves contain the sides u = 0, v = 0, u + v = 1.
    pub sides: Vec<[bool; 3]>,
    /// From u = 0 to u = 1, both included.
    pub walls: Vec<Wall>,
    /// One fewer.
    pub slabs: Vec<Slab>,
}

/// A curve without the lines that are treated apart.
struct Curve {
    /// Without sides and vertical lines.
    rest: Poly,
    /// Product of its vertical lines, as a polynomial in u.
    vertical: UPoly,
    fibres: Option<Fibres>,
    /// On v = 0 and on u + v = 1.
    on_lower: UPoly,
    on_upper: UPoly,
    /// For quick tests: terms with coefficients known to rounding, and to twice as many digits;
    /// those of both are multiplied by a power of two.
    terms: Terms<Interval>,
    wide: Terms<Wide>,
}

/// Exponents of u and v, and coefficients.
type Terms<T> = Vec<([usize; 2], T)>;

/// Bits of coefficients that are kept in floating point: above them powers of two are taken out.
/// Half of what a double's exponent holds leaves room for sums of products.
const COEFFICIENT_BITS: usize = 500;

/// Where a number of the fibre comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Origin {
    Root { curve: usize, index: usize },
    Lower,
    Upper,
}

impl Arrangement {
    /// Decomposes the unit triangle by the zero sets of polynomials in variables 0 (u) and 1 (v).
    /// They are made squarefree; no two may share a component other than a side.
    ///
    /// # Errors
    /// [`ArrangementError`].
    pub fn new(curves: &[Poly], control: &Control<'_>) -> Result<Self, ArrangementError> {
        let sides_of = [
            Poly::var(U),
            Poly::var(V),
            Poly::var(U) + Poly::var(V) - Poly::one(),
        ];
        let mut sides = Vec::new();
        let mut prepared = Vec::new();
        for (k, f) in curves.iter().enumerate() {
            if f.is_zero() {
                return Err(ArrangementError::Zero(k));
            }
            let mut rest = f.squarefree_part();
            let mut has = [false; 3];
            for (side, has) in sides_of.iter().zip(&mut has) {
                if let Some(quotient) = rest.div_exact(side) {
                    (rest, *has) = (quotient, true);
                }
            }
            sides.push(has);
            prepared.push(Curve::new(rest, control)?);
        }
        let critical = critical_values(&prepared, control)?;
        let mut work = Work {
            curves: prepared,
            pairs: BTreeMap::new(),
        };
        let mut walls = Vec::new();
        let mut separators = Vec::new();
        let last = critical.len() - 1;
        for (k, u) in critical.into_iter().enumerate() {
            let (wall, between) = work.wall(u, control)?;
            let is_regular = wall.vertical.is_empty()
                && wall.points.iter().all(|p| p.curves.len() == 1)
                && !between.1;
            if k == 0 || k == last || !is_regular {
                walls.push(wall);
                separators.push(between.0);
            }
        }
        let mut slabs = Vec::new();
        for k in 0..walls.len() - 1 {
            if control.is_stopped() {
                return Err(ResultantError::Stopped.into());
            }
            let u = walls[k].u.rational_below(&walls[k + 1].u);
            let (order, between) = work.arcs_at(&u, control)?;
            let ends = |k: usize, side| work.ends(&walls[k], &separators[k], &u, side, control);
            let (left, right) = (ends(k, Ordering::Greater)?, ends(k + 1, Ordering::Less)?);
            let arcs = order
                .iter()
                .zip(left.into_iter().zip(right))
                .map(|(&curve, (left, right))| Arc { curve, left, right })
                .collect();
            slabs.push(Slab { u, arcs, between });
        }
        let mut curves = Vec::new();
        let (mut terms, mut wide) = (Vec::new(), Vec::new());
        for c in work.curves {
            curves.push(c.rest);
            terms.push(c.terms);
            wide.push(c.wide);
        }
        Ok(Self {
            curves,
            terms,
            wide,
            sides,
            walls,
            slabs,
        })
    }

    /// The number that stands for the side v = 0 among curves.
    pub fn lower(&self) -> usize {
        self.curves.len()
    }
    /// The number that stands for the side u + v = 1 among curves.
    pub fn upper(&self) -> usize {
        self.curves.len() + 1
    }
    /// v on every arc of a slab over some u strictly between its walls, from bottom to top, to
    /// 1e-13 of its size; none if u is not between them.
    pub fn arcs_over(&self, slab: usize, u: &RBig) -> Option<Vec<f64>> {
        let [left, right] = [slab, slab + 1].map(|k| self.walls[k].u.cmp_rational(u));
        if !(left.is_lt() && right.is_gt()) {
            return None;
        }
        let arcs = &self.slabs[slab].arcs;
        let top = RBig::ONE - u;
        let mut roots: BTreeMap<usize, std::vec::IntoIter<f64>> = BTreeMap::new();
        let mut value = |curve: usize| {
            let over = roots.entry(curve).or_insert_with(|| {
                let count = arcs.iter().filter(|a| a.curve == curve).count();
                let near = self.near_roots(curve, u, &top, count);
                let roots = near.unwrap_or_else(|| self.exact_roots(curve, u, &top));
                assert_eq!(roots.len(), count, "as many roots as arcs over a slab");
                roots.into_iter()
            });
            over.next()
        };
        let height = |arc: &Arc| match arc.curve.checked_sub(self.lower()) {
            None => value(arc.curve),
            Some(0) => Some(0.0),
            Some(_) => Some(top.to_f64().value()),
        };
        arcs.iter().map(height).collect()
    }
    /// The roots of a curve over u between 0 and `top`, correctly rounded.
    fn exact_roots(&self, curve: usize, u: &RBig, top: &RBig) -> Vec<f64> {
        let g = over_v(&self.curves[curve].set(U, u));
        let inside =
            |r: &RealRoot| r.cmp_rational(&RBig::ZERO).is_gt() && r.cmp_rational(top).is_lt();
        real_roots(&g)
            .into_iter()
            .filter(inside)
            .map(|r| r.to_f64())
            .collect()
    }
    /// The roots in floating point, if that proves them: with the digits of doubles where they are
    /// enough, and with twice as many for curves of high degree.
    fn near_roots(&self, curve: usize, u: &RBig, top: &RBig, count: usize) -> Option<Vec<f64>> {
        let (x, top) = (u.to_f64().value(), top.to_f64().value());
        // Values of u that are doubles are met exactly.
        let is_double = RBig::try_from(x).is_ok_and(|x| x == *u);
        let around = match is_double {
            true => Interval::new(x, x),
            false => Interval::new(x.next_down(), x.next_up()),
        };
        let near = over(&self.terms[curve], U, around);
        proved_roots(&near, top, count).or_else(|| {
            let wide = || over(&self.wide[curve], U, Wide::exact(x));
            is_double.then(|| proved_roots(&wide(), top, count))?
        })
    }
    /// The polynomial of a curve, squarefree, without sides and vertical lines.
    pub fn curve(&self, k: usize) -> &Poly {
        &self.curves[k]
    }
}

/// The coefficients of powers of one variable where the other one, of index `fixed`, has a value;
/// one at least.
fn over<T: Bounded>(terms: &Terms<T>, fixed: usize, value: T) -> Vec<T> {
    let degree = terms.iter().map(|t| t.0[1 - fixed]).max().unwrap_or(0);
    let mut coefficients = vec![T::exact(0.0); 1 + degree];
    let mut powers = vec![T::exact(1.0)];
    for (exponents, c) in terms {
        let (i, j) = (exponents[fixed], exponents[1 - fixed]);
        while powers.len() <= i {
            powers.push(powers[powers.len() - 1] * value);
        }
        coefficients[j] = coefficients[j] + *c * powers[i];
    }
    coefficients
}

impl Curve {
    fn new(rest: Poly, control: &Control<'_>) -> Result<Self, ArrangementError> {
        let content = rest.content_in(V);
        let rest = rest.div_exact(&content).expect("the content divides");
        let rest = rest.primitive();
        let vertical = over_u(&content);
        let fibres = if rest.degree(V) > 0 {
            Some(Fibres::new(&rest, V, control)?)
        } else {
            None
        };
        let on = |by: &Poly| over_u(&rest.substitute(V, by));
        let (on_lower, on_upper) = (on(&Poly::zero()), on(&(Poly::one() - Poly::var(U))));
        let size = rest.terms().iter().map(|(_, c)| bits(c)).max();
        let excess = size.unwrap_or(0).saturating_sub(COEFFICIENT_BITS);
        let (mut terms, mut wide) = (Terms::new(), Terms::new());
        for (e, c) in rest.terms() {
            let c = RBig::from_parts(c.clone(), UBig::ONE << excess);
            let exponents = [usize::from(e[U]), usize::from(e[V])];
            let near = c.to_f64().value();
            terms.push((exponents, Interval::new(near.next_down(), near.next_up())));
            wide.push((exponents, Wide::between(&c, &c)));
        }
        Ok(Self {
            rest,
            vertical,
            fibres,
            on_lower,
            on_upper,
            terms,
            wide,
        })
    }

    /// The roots between the sides over a u that is known within bounds, if floating point proves
    /// them: all of them, each simple, in disjoint intervals.
    fn roots_over(&self, u: Wide) -> Option<Vec<[RBig; 2]>> {
        let top = Wide::exact(1.0) + Wide::exact(-1.0) * u;
        let coefficients = stretched(&over(&self.wide, U, u), top);
        // From shares of the height to heights.
        let top = top.bounds();
        let height = |x: f64, top: f64, outward: fn(f64) -> f64| RBig::try_from(outward(x * top));
        all_roots(&coefficients)?
            .into_iter()
            .map(|[lo, hi]| {
                let lo = height(lo, top[0], f64::next_down).ok()?;
                let hi = height(hi, top[1], f64::next_up).ok()?;
                Some([lo, hi])
            })
            .collect()
    }

    /// Whether the polynomial is proved to have no zero on v = c for u from one number to another.
    fn misses(&self, [from, to]: [&RBig; 2], c: &RBig) -> bool {
        let length = to - from;
        let (from, length) = (Wide::between(from, from), Wide::between(&length, &length));
        let mut coefficients = over(&self.wide, V, Wide::between(c, c));
        // In shares of the way.
        let n = coefficients.len();
        for i in 0..n {
            for j in (i..n - 1).rev() {
                coefficients[j] = coefficients[j] + coefficients[j + 1] * from;
            }
        }
        certain_bernstein(&stretched(&coefficients, length)).is_some_and(|b| {
            let mut signs = b.into_iter().map(Wide::sign);
            let first = signs.next();
            first != Some(0) && signs.all(|s| Some(s) == first)
        })
    }
}

/// What happens at a critical value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    /// A curve has a vertical tangent or a singular point, goes to infinity, or meets the side v =
    /// 0 or u + v = 1.
    Alone(usize),
    /// Two curves meet, or go to infinity together.
    Pair(usize, usize),
    /// An end of the range, or a vertical line.
    Other,
}

/// A critical value, and all that happens there.
struct Critical {
    u: RealRoot,
    events: Vec<Event>,
}

impl Critical {
    /// Whether a curve is not just crossed there by the line over u.
    fn is_special(&self, curve: usize) -> bool {
        self.events.iter().any(|e| match *e {
            Event::Alone(k) => k == curve,
            Event::Pair(j, k) => j == curve || k == curve,
            Event::Other => false,
        })
    }
    fn has(&self, event: Event) -> bool {
        self.events.contains(&event)
    }
}

/// The critical values in \[0, 1\], ascending, with 0 and 1.
fn critical_values(
    curves: &[Curve],
    control: &Control<'_>,
) -> Result<Vec<Critical>, ArrangementError> {
    let mut found: Vec<(UPoly, Event)> = vec![
        (UPoly::from_i64(&[0, 1]), Event::Other),
        (UPoly::from_i64(&[-1, 1]), Event::Other),
    ];
    for (k, c) in curves.iter().enumerate() {
        found.push((c.vertical.clone(), Event::Other));
        found.push((c.on_lower.clone(), Event::Alone(k)));
        found.push((c.on_upper.clone(), Event::Alone(k)));
        if let Some(fibres) = &c.fibres {
            found.push((fibres.leading().clone(), Event::Alone(k)));
        }
        if let Some(chain) = c.fibres.as_ref().and_then(Fibres::subresultants) {
            found.push((chain.resultant.clone(), Event::Alone(k)));
        }
        for (j, other) in curves.iter().enumerate().take(k) {
            if c.fibres.is_none() || other.fibres.is_none() {
                continue;
            }
            let r = over_u(&resultant(&other.rest, &c.rest, V, control)?);
            if r.is_zero() {
                return Err(ArrangementError::CommonComponent(j, k));
            }
            found.push((r, Event::Pair(j, k)));
        }
    }
    // Pairwise coprime polynomials with the same roots: then no two roots are equal, and signs at
    // them are cheap.
    let mut base: Vec<(UPoly, Vec<Event>)> = Vec::new();
    for (p, event) in found {
        if control.is_stopped() {
            return Err(ResultantError::Stopped.into());
        }
        // Sides, vertical lines and multiple factors were split off, so that nothing happens
        // everywhere.
        assert!(!p.is_zero(), "critical values of a curve are finitely many");
        if p.degree() == 0 {
            continue;
        }
        let mut rest = p.squarefree_part();
        let mut next = Vec::new();
        for (b, events) in base {
            let g = if rest.degree() > 0 {
                b.gcd(&rest)
            } else {
                UPoly::one()
            };
            if g.degree() == 0 {
                next.push((b, events));
                continue;
            }
            let without = b.div_exact(&g).expect("a common divisor divides");
            rest = rest.div_exact(&g).expect("a common divisor divides");
            let both = events.iter().copied().chain([event]).collect();
            next.extend(
                [(without, events), (g, both)]
                    .into_iter()
                    .filter(|p| p.0.degree() > 0),
            );
        }
        if rest.degree() > 0 {
            next.push((rest, vec![event]));
        }
        base = next;
    }
    let within =
        |r: &RealRoot| r.cmp_rational(&RBig::ZERO).is_ge() && r.cmp_rational(&RBig::ONE).is_le();
    let mut roots: Vec<Critical> = Vec::new();
    for (p, events) in &base {
        roots.extend(real_roots(p).into_iter().filter(within).map(|u| Critical {
            u,
            events: events.clone(),
        }));
    }
    // They differ: refined until apart, which spares the test for equality.
    refine_until(24, DOUBLED, control, |bits| {
        roots.iter_mut().for_each(|r| r.u.refine(bits));
        roots.sort_by(|a, b| a.u.interval().0.cmp(&b.u.interval().0));
        let mut pairs = roots.windows(2);
        let apart = pairs.all(|w| w[0].u.interval().1 < w[1].u.interval().0);
        Ok::<_, ResultantError>(apart.then_some(()))
    })?;
    Ok(roots)
}

/// A polynomial in which v was eliminated, or has a value.
fn over_u(p: &Poly) -> UPoly {
    p.to_upoly(U).expect("no variable but u is left")
}
/// A polynomial in which u has a value.
fn over_v(p: &Poly) -> UPoly {
    p.to_upoly(V).expect("no variable but v is left")
}

struct Work {
    curves: Vec<Curve>,
    /// Subresultants of pairs of curves, as far as they were asked for.
    pairs: BTreeMap<(usize, usize), Subresultants>,
}

/// Rational numbers between the points of a wall, one fewer than these.
type Separators = Vec<RBig>;

/// The roots of a curve over a critical value.
enum Roots {
    /// The curve has none, as it does not depend on v.
    None,
    /// Those between the sides, proved in floating point: all of them are simple.
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
    /// Where a root is, to so many bits if that is to be had.
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
    fn is_multiple(&self, index: usize) -> bool {
        match self {
            Self::Exact(fibre) => fibre.roots[index].multiplicity > 1,
            _ => false,
        }
    }
}

/// Where the numbers of a fibre are, to so many bits if that is to be had.
fn ranges_of(
    all: &[Origin],
    u: &mut RealRoot,
    fibres: &mut [Roots],
    bits: usize,
    control: &Control<'_>,
) -> Result<Vec<(RBig, RBig)>, ResultantError> {
    u.refine(bits);
    let mut range = |o: &Origin| match *o {
        Origin::Lower => Ok((RBig::ZERO, RBig::ZERO)),
        Origin::Upper => {
            let (lo, hi) = u.interval();
            Ok((RBig::ONE - hi, RBig::ONE - lo))
        }
        Origin::Root { curve, index } => fibres[curve].range(index, bits, control),
    };
    all.iter().map(&mut range).collect()
}

/// How many numbers of each two of n curves and the sides may be equal, and for each number the
/// group of those that it may be equal to. Roots of one curve differ, but may still touch.
fn meetings_of(all: &[Origin], ranges: &[(RBig, RBig)], n: usize) -> (Vec<Vec<usize>>, Vec<usize>) {
    let which = |o: &Origin| match *o {
        Origin::Root { curve, .. } => curve,
        Origin::Lower => n,
        Origin::Upper => n + 1,
    };
    let mut meetings = vec![vec![0usize; n + 2]; n + 2];
    let mut group: Vec<usize> = (0..all.len()).collect();
    for a in 0..all.len() {
        for b in 0..a {
            let (x, y) = (which(&all[a]), which(&all[b]));
            let (j, k) = (x.min(y), x.max(y));
            if ranges[a].0 <= ranges[b].1 && ranges[b].0 <= ranges[a].1 {
                meetings[j][k] += 1;
                let (from, to) = (group[a], group[b]);
                group
                    .iter_mut()
                    .filter(|g| **g == from)
                    .for_each(|g| *g = to);
            }
        }
    }
    (meetings, group)
}

impl Work {
    /// The roots of the curves over a critical value; those of curves that are just crossed there
    /// in floating point, unless `exact`.
    fn roots_at(
        &self,
        critical: &Critical,
        exact: bool,
        control: &Control<'_>,
    ) -> Result<Vec<Roots>, ArrangementError> {
        let (lo, hi) = critical.u.interval();
        let u = Wide::between(&lo, &hi);
        let roots = |(k, c): (usize, &Curve)| {
            let Some(fibres) = &c.fibres else {
                return Ok(Roots::None);
            };
            let near = (!exact && !critical.is_special(k)).then(|| c.roots_over(u));
            if let Some(ranges) = near.flatten() {
                return Ok(Roots::Near(ranges));
            }
            match fibres.at(&critical.u, control) {
                Ok(fibre) => Ok(Roots::Exact(fibre)),
                Err(FibreError::Resultant(e)) => Err(e.into()),
                Err(FibreError::Vertical) => unreachable!("vertical lines were split off"),
            }
        };
        self.curves.iter().enumerate().map(roots).collect()
    }

    /// The points over a critical value, the numbers between them, and whether a curve touches the
    /// wall in one of them.
    fn wall(
        &mut self,
        mut critical: Critical,
        control: &Control<'_>,
    ) -> Result<(Wall, (Separators, bool)), ArrangementError> {
        let n = self.curves.len();
        // What all fibres begin with, found once.
        critical.u.refine(FIRST_BITS);
        let mut fibres = self.roots_at(&critical, false, control)?;
        let origins = |fibres: &[Roots]| {
            let mut all = vec![Origin::Lower, Origin::Upper];
            for (curve, f) in fibres.iter().enumerate() {
                all.extend((0..f.count()).map(|index| Origin::Root { curve, index }));
            }
            all
        };
        let mut all = origins(&fibres);
        // How many numbers each pair of origins has in common.
        let mut common = vec![vec![0usize; n + 2]; n + 2];
        for k in 0..n {
            if matches!(fibres[k], Roots::None) {
                continue;
            }
            if critical.has(Event::Alone(k)) {
                let [lower, upper] = [&self.curves[k].on_lower, &self.curves[k].on_upper]
                    .map(|on| usize::from(critical.u.sign_of(on).is_eq()));
                (common[k][n], common[k][n + 1]) = (lower, upper);
            }
            for j in 0..k {
                if critical.has(Event::Pair(j, k)) {
                    common[j][k] = self.common_roots(j, k, &critical.u, control)?;
                }
            }
        }
        common[n][n + 1] = usize::from(critical.u.cmp_rational(&RBig::ONE).is_eq());
        let attempt = |bits, u: &mut RealRoot, fibres: &mut Vec<Roots>, all: &[Origin]| {
            let ranges = ranges_of(all, u, fibres, bits, control)?;
            let (meetings, groups) = meetings_of(all, &ranges, n);
            Ok::<_, ResultantError>((meetings == common).then_some((ranges, groups)))
        };
        let near = attempt(FIRST_FIBRE_BITS, &mut critical.u, &mut fibres, &all)?;
        let (ranges, groups) = match near {
            Some(found) => found,
            None => {
                // Too near to each other for floating point.
                fibres = self.roots_at(&critical, true, control)?;
                all = origins(&fibres);
                refine_until(FIRST_FIBRE_BITS, DOUBLED, control, |bits| {
                    attempt(bits, &mut critical.u, &mut fibres, &all)
                })?
            }
        };
        let mut points: Vec<(WallPoint, bool)> = Vec::new();
        let mut done = vec![false; all.len()];
        for first in 0..all.len() {
            if done[first] {
                continue;
            }
            let members: Vec<usize> = (first..all.len())
                .filter(|&m| groups[m] == groups[first])
                .collect();
            let (mut lo, mut hi) = ranges[first].clone();
            let (mut curves, mut touches) = (Vec::new(), false);
            for &m in &members {
                done[m] = true;
                lo = lo.max(ranges[m].0.clone());
                hi = hi.min(ranges[m].1.clone());
                curves.push(match all[m] {
                    Origin::Root { curve, index } => {
                        touches |= fibres[curve].is_multiple(index);
                        curve
                    }
                    Origin::Lower => n,
                    Origin::Upper => n + 1,
                });
            }
            curves.sort_unstable();
            points.push((WallPoint { lo, hi, curves }, touches));
        }
        points.sort_by(|a, b| a.0.lo.cmp(&b.0.lo));
        let from = points
            .iter()
            .position(|p| p.0.curves.contains(&n))
            .expect("the lower side is there");
        let to = points
            .iter()
            .position(|p| p.0.curves.contains(&(n + 1)))
            .expect("the upper side is there");
        let separators = points[from..=to]
            .windows(2)
            .map(|w| simplest_between(&w[0].0.hi, &w[1].0.lo))
            .collect();
        let touches = points[from..=to].iter().any(|p| p.1);
        let points = points.drain(from..=to).map(|p| p.0).collect();
        let vertical = (0..n)
            .filter(|&k| {
                let vertical = &self.curves[k].vertical;
                vertical.degree() > 0 && critical.u.sign_of(vertical).is_eq()
            })
            .collect();
        Ok((
            Wall {
                u: critical.u,
                points,
                vertical,
            },
            (separators, touches),
        ))
    }

    /// The number of real numbers v at which both curves vanish over u.
    fn common_roots(
        &mut self,
        j: usize,
        k: usize,
        u: &RealRoot,
        control: &Control<'_>,
    ) -> Result<usize, ArrangementError> {
        let (Some(_), Some(_)) = (&self.curves[j].fibres, &self.curves[k].fibres) else {
            return Ok(0);
        };
        let over = |f: &Poly| {
            // Without the powers of v whose coefficients vanish over u.
            let rows = f.coefficients_in(V);
            let degree = (0..rows.len())
                .rev()
                .find(|&i| u.sign_of(&over_u(&rows[i])).is_ne())?;
            let is_whole = degree + 1 == rows.len();
            let sum = rows.into_iter().take(degree + 1).enumerate();
            Some((
                sum.fold(Poly::zero(), |sum, (i, c)| {
                    sum + c * Poly::var(V).pow(i as u32)
                }),
                degree,
                is_whole,
            ))
        };
        let (Some((f, m, whole_f)), Some((g, n, whole_g))) =
            (over(&self.curves[j].rest), over(&self.curves[k].rest))
        else {
            return Ok(0);
        };
        if m == 0 || n == 0 {
            return Ok(0);
        }
        let (f, g) = if m >= n { (f, g) } else { (g, f) };
        let made;
        let chain = if whole_f && whole_g {
            match self.pairs.entry((j, k)) {
                Entry::Vacant(place) => place.insert(Subresultants::new(&f, &g, V, control)?),
                Entry::Occupied(known) => known.into_mut(),
            }
        } else {
            made = Subresultants::new(&f, &g, V, control)?;
            &made
        };
        let mut degree = 0;
        while degree < chain.count() && u.sign_of(&chain.principal(degree, control)?).is_eq() {
            degree += 1;
        }
        let divisor = match degree {
            0 => return Ok(0),
            // A real divisor of odd degree one has one root.
            1 if chain.count() > 1 => return Ok(1),
            d if d < chain.count() => chain.polynomial(d, control)?,
            _ => g,
        };
        match Fibres::new(&divisor, V, control)?.at(u, control) {
            Ok(fibre) => Ok(fibre.roots.len()),
            Err(FibreError::Vertical) => unreachable!("the principal coefficient does not vanish"),
            Err(FibreError::Resultant(e)) => Err(e.into()),
        }
    }

    /// The curves over a rational u that is not critical, from the lower side to the upper one, and
    /// numbers between them.
    fn arcs_at(
        &self,
        u: &RBig,
        control: &Control<'_>,
    ) -> Result<(Vec<usize>, Vec<RBig>), ResultantError> {
        let n = self.curves.len();
        let top = RBig::ONE - u;
        let at = Wide::between(u, u);
        let near = self.curves.iter().enumerate().map(|(k, c)| {
            let roots = match c.fibres {
                Some(_) => c.roots_over(at)?,
                None => Vec::new(),
            };
            Some(roots.into_iter().map(move |[lo, hi]| (lo, hi, k)).collect())
        });
        let near: Option<Vec<Vec<(RBig, RBig, usize)>>> = near.collect();
        let sides = [(RBig::ZERO, n), (top.clone(), n + 1)];
        let with_sides = |found: Vec<(RBig, RBig, usize)>| {
            let sides = sides.iter().map(|(v, k)| (v.clone(), v.clone(), *k));
            let mut found: Vec<_> = found.into_iter().chain(sides).collect();
            found.sort_by(|a, b| a.0.cmp(&b.0));
            found
        };
        let are_apart = |found: &[(RBig, RBig, usize)]| found.windows(2).all(|w| w[0].1 < w[1].0);
        let near = near.map(|near| with_sides(near.concat()));
        let found = match near.filter(|near| are_apart(near)) {
            Some(found) => found,
            None => {
                let mut roots = self.exact_roots_at(u, &top);
                // All differ, as u is not critical.
                refine_until(32, DOUBLED, control, |bits| {
                    let ranges = |(r, k): &mut (RealRoot, usize)| {
                        r.refine(bits);
                        let (lo, hi) = r.interval();
                        (lo, hi, *k)
                    };
                    let found = with_sides(roots.iter_mut().map(ranges).collect());
                    Ok::<_, ResultantError>(are_apart(&found).then_some(found))
                })?
            }
        };
        let between = found
            .windows(2)
            .map(|w| simplest_between(&w[0].1, &w[1].0))
            .collect();
        Ok((found.into_iter().map(|f| f.2).collect(), between))
    }
    /// The roots of the curves between the sides over a rational u, by curves.
    fn exact_roots_at(&self, u: &RBig, top: &RBig) -> Vec<(RealRoot, usize)> {
        let inside =
            |r: &RealRoot| r.cmp_rational(&RBig::ZERO).is_gt() && r.cmp_rational(top).is_lt();
        let mut found = Vec::new();
        for (k, c) in self.curves.iter().enumerate() {
            if c.fibres.is_some() {
                let g = over_v(&c.rest.set(U, u));
                found.extend(real_roots(&g).into_iter().filter(inside).map(|r| (r, k)));
            }
        }
        found
    }

    /// The points of the wall in which the arcs on one side of it end: on the right side if `side`
    /// is `Greater`. `sample` is in the slab there.
    fn ends(
        &self,
        wall: &Wall,
        separators: &Separators,
        sample: &RBig,
        side: Ordering,
        control: &Control<'_>,
    ) -> Result<Vec<usize>, ResultantError> {
        /// Share of the way to the wall that is left at first, in bits, and how it shrinks: by
        /// steps after which a rough look may do.
        const FIRST: usize = 8;
        const NEARER: Growth = |bits| bits + bits / 4;
        let mut at = sample.clone();
        let mut u = wall.u.clone();
        refine_until(FIRST, NEARER, control, |bits| {
            if bits > FIRST {
                u.refine(2 * bits);
                let (lo, hi) = u.interval();
                let near = if side.is_gt() { hi } else { lo };
                // Walls may be closer together than the wall is known yet.
                if sample.cmp(&near) != side {
                    return Ok(None);
                }
                let step = (sample - &near) / RBig::from(dashu_int::IBig::ONE << bits);
                at = if side.is_gt() {
                    simplest_between(&near, &(&near + step))
                } else {
                    simplest_between(&(&near + step), &near)
                };
            }
            let is_clear = |c: &RBig| self.is_clear(&u, &at, c, bits > 48);
            Ok::<_, ResultantError>(separators.iter().all(is_clear).then_some(()))
        })?;
        let mut points = self.near_gaps(&at, separators).unwrap_or_else(|| {
            let below = |r: &RealRoot| {
                let is_above = |s: &&RBig| r.cmp_rational(s).is_gt();
                separators.iter().filter(is_above).count()
            };
            let roots = self.exact_roots_at(&at, &(RBig::ONE - &at));
            roots.iter().map(|(r, _)| below(r)).collect()
        });
        // The order of the arcs is that of the slab, and points ascend with them.
        points.sort_unstable();
        let mut ends = vec![0];
        ends.extend(points);
        ends.push(wall.points.len() - 1);
        Ok(ends)
    }

    /// Of each root between the sides over u the number of separators below it, if floating point
    /// tells.
    fn near_gaps(&self, u: &RBig, separators: &Separators) -> Option<Vec<usize>> {
        let at = Wide::between(u, u);
        let mut found = Vec::new();
        for c in self.curves.iter().filter(|c| c.fibres.is_some()) {
            for [lo, hi] in c.roots_over(at)? {
                let below = separators.partition_point(|s| *s < lo);
                found.push((separators.partition_point(|s| *s < hi) == below).then_some(below)?);
            }
        }
        Some(found)
    }

    /// Whether no curve crosses the line v = c from the wall as far as `at`. Without `exact` a
    /// false answer may only mean too rough a look.
    fn is_clear(&self, u: &RealRoot, at: &RBig, c: &RBig, exact: bool) -> bool {
        let (lo, hi) = u.interval();
        let (lo, hi) = (lo.min(at.clone()), hi.max(at.clone()));
        // The upper side: u = 1 − c.
        let crossing = RBig::ONE - c;
        if crossing >= lo && crossing <= hi {
            return false;
        }
        self.curves.iter().filter(|f| f.fibres.is_some()).all(|f| {
            f.misses([&lo, &hi], c)
                || exact && {
                    let g = over_u(&f.rest.set(V, c));
                    g.degree() == 0
                        || real_roots(&g).iter().all(|r| {
                            let (from, to) = (r.cmp(u), r.cmp_rational(at));
                            // On the same side of both, and not on the wall, by the choice of c.
                            from == to && to.is_ne()
                        })
                }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    /// A circle that the arrangement has lost: its arcs are missed, not left out.
    #[test]
    #[should_panic(expected = "as many roots as arcs over a slab")]
    fn a_curve_that_is_dropped_is_noticed() {
        let circle = Poly::parse("64*(u - 1/4)^2 + 64*(v - 1/4)^2 - 1", &["u", "v"]);
        let circle = circle.expect("a polynomial");
        let mut a = Arrangement::new(&[circle], &Control::default()).expect("not stopped");
        let middle = RBig::ONE / RBig::from(4);
        let slab = (0..a.slabs.len())
            .find(|&k| a.arcs_over(k, &middle).is_some_and(|arcs| arcs.len() == 4))
            .expect("the circle's arcs between the sides");
        a.curves[0] = Poly::one();
        a.terms[0] = vec![([0, 0], Interval::new(1.0, 1.0))];
        a.wide[0] = vec![([0, 0], Wide::exact(1.0))];
        let _ = a.arcs_over(slab, &middle);
    }

    /// Every loop of growing precision asks whether to stop.
    #[test]
    fn decompositions_can_be_stopped_anywhere() {
        let p = |text| Poly::parse(text, &["u", "v"]).expect("a polynomial");
        let curves = [
            p("u^3 - v^2 + 1/7*u*v"),
            p("(u - 1/3)^2 + v^2 - 1/16"),
            p("3*u - v"),
        ];
        let whole = Arrangement::new(&curves, &Control::default()).expect("not stopped");
        let mut stopped = 0;
        for microseconds in [0, 20, 50, 100, 200, 500, 1000, 2000, 5000] {
            let end = Instant::now() + Duration::from_micros(microseconds);
            match Arrangement::new(&curves, &Control::default().until(end)) {
                Ok(found) => assert_eq!(found.slabs.len(), whole.slabs.len()),
                Err(error) => {
                    let expected = ArrangementError::Resultant(ResultantError::Stopped);
                    assert_eq!(error, expected, "after {microseconds} µs");
                    stopped += 1;
                }
            }
        }
        assert!(stopped > 0);
    }
}
