//! Construction of an arrangement: walls over critical values, slabs between them, and the points
//! in which arcs end.

use super::critical::{Critical, Event};
use super::curve::{Curve, over_u, roots_between_sides};
use super::stack::{Common, Roots, Stack};
use super::{Arc, ArrangementError, Slab, V, Wall};
use crate::fibre::{FIRST_BITS, FIRST_FIBRE_BITS, FibreError, Fibres};
use crate::float_roots::Wide;
use crate::poly::Poly;
use crate::precision::{DOUBLED, Growth, refine_until};
use crate::resultant::{ResultantError, Subresultants};
use crate::roots::{RealRoot, real_roots, simplest_between};
use crate::upoly::UPoly;
use dashu_int::IBig;
use dashu_ratio::RBig;
use isoform_control::Control;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

pub(super) struct ArrangementWork {
    pub(super) curves: Vec<Curve>,
    /// Subresultants of pairs of curves, computed on demand.
    pairs: BTreeMap<(usize, usize), Subresultants>,
}

/// Wall with the data that the adjacent slabs need.
pub(super) struct PreparedWall {
    pub(super) wall: Wall,
    /// Rational numbers between successive points of the wall.
    separators: Vec<RBig>,
    /// True if a curve touches the wall in one of the points.
    touches: bool,
}

impl PreparedWall {
    /// Returns true if curves cross the wall one by one, without an event.
    pub(super) fn is_regular(&self) -> bool {
        self.wall.vertical.is_empty()
            && self.wall.points.iter().all(|p| p.curves.len() == 1)
            && !self.touches
    }
}

/// Number v between two rational ones, with the curve or side to which it belongs.
struct LocatedNumber {
    lo: RBig,
    hi: RBig,
    curve: usize,
}

/// Polynomial over a u at which its leading coefficients in v may vanish.
struct SpecialisedCurve {
    /// Polynomial without the powers of v whose coefficients vanish.
    poly: Poly,
    /// Degree in v.
    degree: usize,
    /// True if all powers are kept.
    is_whole: bool,
}

impl SpecialisedCurve {
    /// Returns the polynomial over u; `None` if all coefficients vanish.
    fn new(f: &Poly, u: &RealRoot) -> Option<Self> {
        let rows = f.coefficients_in(V);
        let degree = (0..rows.len())
            .rev()
            .find(|&i| u.sign_of(&over_u(&rows[i])).is_ne())?;
        let is_whole = degree + 1 == rows.len();
        let terms = rows.into_iter().take(degree + 1).enumerate();
        let poly = terms.fold(Poly::zero(), |sum, (i, c)| {
            sum + c * Poly::var(V).pow(i as u32)
        });
        Some(Self {
            poly,
            degree,
            is_whole,
        })
    }
}

impl ArrangementWork {
    pub(super) fn new(curves: Vec<Curve>) -> Self {
        Self {
            curves,
            pairs: BTreeMap::new(),
        }
    }

    /// Returns the roots of the curves over a critical value. Curves that only cross the wall there
    /// have them computed in floating point, unless `exact`.
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

    /// Returns the points over a critical value and the separators between them.
    pub(super) fn wall(
        &mut self,
        mut critical: Critical,
        control: &Control<'_>,
    ) -> Result<PreparedWall, ArrangementError> {
        // The approximation with which all fibres begin, computed once.
        critical.u.refine(FIRST_BITS);
        let mut stack = Stack::new(self.roots_at(&critical, false, control)?);
        let common = self.common(&critical, control)?;
        let near = stack.placed(&mut critical.u, FIRST_FIBRE_BITS, &common, control)?;
        let placed = match near {
            Some(placed) => placed,
            None => {
                // The numbers are too close for floating point.
                stack = Stack::new(self.roots_at(&critical, true, control)?);
                refine_until(FIRST_FIBRE_BITS, DOUBLED, control, |bits| {
                    stack.placed(&mut critical.u, bits, &common, control)
                })?
            }
        };
        let (points, touches) = stack.points(&placed);
        let separators = points
            .windows(2)
            .map(|w| simplest_between(&w[0].hi, &w[1].lo))
            .collect();
        let contains_line = |k: &usize| {
            let vertical = &self.curves[*k].vertical;
            vertical.degree() > 0 && critical.u.sign_of(vertical).is_eq()
        };
        let vertical = (0..self.curves.len()).filter(contains_line).collect();
        let u = critical.u;
        Ok(PreparedWall {
            wall: Wall {
                u,
                points,
                vertical,
            },
            separators,
            touches,
        })
    }

    /// Returns the number of common points of each two of the curves and the sides over a critical
    /// value.
    fn common(
        &mut self,
        critical: &Critical,
        control: &Control<'_>,
    ) -> Result<Common, ArrangementError> {
        let n = self.curves.len();
        let mut common = vec![vec![0usize; n + 2]; n + 2];
        for k in 0..n {
            let curve = &self.curves[k];
            if curve.fibres.is_none() {
                continue;
            }
            if critical.has(Event::Alone(k)) {
                let meets = |on: &UPoly| usize::from(critical.u.sign_of(on).is_eq());
                common[k][n] = meets(&curve.on_lower);
                common[k][n + 1] = meets(&curve.on_upper);
            }
            for j in 0..k {
                if critical.has(Event::Pair(j, k)) {
                    common[j][k] = self.common_roots(j, k, &critical.u, control)?;
                }
            }
        }
        common[n][n + 1] = usize::from(critical.u.cmp_rational(&RBig::ONE).is_eq());
        Ok(common)
    }

    /// Returns a curve over u; `None` if it has no roots there.
    fn specialised(&self, k: usize, u: &RealRoot) -> Option<SpecialisedCurve> {
        let curve = &self.curves[k];
        curve.fibres.as_ref()?;
        SpecialisedCurve::new(&curve.rest, u).filter(|s| s.degree > 0)
    }

    /// Returns the number of real numbers v at which both curves vanish over u.
    fn common_roots(
        &mut self,
        j: usize,
        k: usize,
        u: &RealRoot,
        control: &Control<'_>,
    ) -> Result<usize, ArrangementError> {
        let (Some(f), Some(g)) = (self.specialised(j, u), self.specialised(k, u)) else {
            return Ok(0);
        };
        let (f, g) = if f.degree >= g.degree { (f, g) } else { (g, f) };
        let make = || Subresultants::new(&f.poly, &g.poly, V, control);
        let made;
        let chain = if f.is_whole && g.is_whole {
            match self.pairs.entry((j, k)) {
                Entry::Vacant(place) => place.insert(make()?),
                Entry::Occupied(known) => known.into_mut(),
            }
        } else {
            made = make()?;
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
            _ => g.poly,
        };
        match Fibres::new(&divisor, V, control)?.at(u, control) {
            Ok(fibre) => Ok(fibre.roots.len()),
            Err(FibreError::Vertical) => unreachable!("the principal coefficient does not vanish"),
            Err(FibreError::Resultant(e)) => Err(e.into()),
        }
    }

    /// Returns the slab between two neighbouring walls.
    pub(super) fn slab(
        &self,
        left: &PreparedWall,
        right: &PreparedWall,
        control: &Control<'_>,
    ) -> Result<Slab, ResultantError> {
        if control.is_stopped() {
            return Err(ResultantError::Stopped);
        }
        let u = left.wall.u.rational_below(&right.wall.u);
        let found = self.over(&u, control)?;
        let between = found
            .windows(2)
            .map(|w| simplest_between(&w[0].hi, &w[1].lo))
            .collect();
        let lefts = self.ends(left, &u, Ordering::Greater, control)?;
        let rights = self.ends(right, &u, Ordering::Less, control)?;
        let arcs = found
            .iter()
            .zip(lefts.into_iter().zip(rights))
            .map(|(f, (left, right))| Arc {
                curve: f.curve,
                left,
                right,
            })
            .collect();
        Ok(Slab { u, arcs, between })
    }

    /// Returns the curves and sides over a rational u that is not critical, ascending, in disjoint
    /// ranges.
    fn over(&self, u: &RBig, control: &Control<'_>) -> Result<Vec<LocatedNumber>, ResultantError> {
        let top = RBig::ONE - u;
        let near = self.near_roots_at(u).map(|r| self.with_sides(r, &top));
        if let Some(found) = near.filter(|found| are_apart(found)) {
            return Ok(found);
        }
        let mut roots = self.exact_roots_at(u, &top);
        // All differ, as u is not critical.
        refine_until(32, DOUBLED, control, |bits| {
            let range = |(r, curve): &mut (RealRoot, usize)| {
                r.refine(bits);
                let (lo, hi) = r.interval();
                LocatedNumber {
                    lo,
                    hi,
                    curve: *curve,
                }
            };
            let found = self.with_sides(roots.iter_mut().map(range).collect(), &top);
            Ok(are_apart(&found).then_some(found))
        })
    }

    /// Returns the roots of the curves between the sides, in the order of the curves, if floating
    /// point proves them.
    fn near_roots_at(&self, u: &RBig) -> Option<Vec<LocatedNumber>> {
        let at = Wide::between(u, u);
        let mut found = Vec::new();
        let curves = self.curves.iter().enumerate();
        for (curve, c) in curves.filter(|(_, c)| c.fibres.is_some()) {
            let roots = c.roots_over(at)?.into_iter();
            found.extend(roots.map(|[lo, hi]| LocatedNumber { lo, hi, curve }));
        }
        Some(found)
    }

    /// Adds the sides v = 0 and v = `top` to numbers, and sorts them in ascending order.
    fn with_sides(&self, mut found: Vec<LocatedNumber>, top: &RBig) -> Vec<LocatedNumber> {
        let n = self.curves.len();
        let sides = [(RBig::ZERO, n), (top.clone(), n + 1)];
        found.extend(sides.map(|(v, curve)| LocatedNumber {
            lo: v.clone(),
            hi: v,
            curve,
        }));
        found.sort_by(|a, b| a.lo.cmp(&b.lo));
        found
    }

    /// Returns the roots of the curves between the sides over a rational u, in the order of the
    /// curves.
    fn exact_roots_at(&self, u: &RBig, top: &RBig) -> Vec<(RealRoot, usize)> {
        let curves = self.curves.iter().enumerate();
        curves
            .filter(|(_, c)| c.fibres.is_some())
            .flat_map(|(k, c)| roots_between_sides(&c.rest, u, top).map(move |r| (r, k)))
            .collect()
    }

    /// Returns the points of the wall in which the arcs on one side of it end: on the right side if
    /// `side` is `Greater`. `sample` is in the slab there.
    fn ends(
        &self,
        standing: &PreparedWall,
        sample: &RBig,
        side: Ordering,
        control: &Control<'_>,
    ) -> Result<Vec<usize>, ResultantError> {
        let separators = &standing.separators;
        let at = self.clear_place(standing, sample, side, control)?;
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
        ends.push(standing.wall.points.len() - 1);
        Ok(ends)
    }

    /// Returns a u, `sample` or one nearer to a wall, such that no curve crosses a separator
    /// between it and the wall.
    fn clear_place(
        &self,
        standing: &PreparedWall,
        sample: &RBig,
        side: Ordering,
        control: &Control<'_>,
    ) -> Result<RBig, ResultantError> {
        /// Number of bits of the fraction of the way to the wall that is left after the first
        /// sample.
        const FIRST_PLACE_BITS: usize = 8;
        /// Growth of the number of bits from one attempt to the next, in steps small enough for an
        /// approximate test to succeed.
        const PLACE_BITS_GROWTH: Growth = |bits| bits + bits / 4;
        /// Number of bits above which the test is exact: a negative result then means that the
        /// place is too far from the wall.
        const MAX_APPROXIMATE_BITS: usize = 48;
        let mut u = standing.wall.u.clone();
        refine_until(FIRST_PLACE_BITS, PLACE_BITS_GROWTH, control, |bits| {
            let at = if bits > FIRST_PLACE_BITS {
                u.refine(2 * bits);
                nearer(&u, sample, side, bits)
            } else {
                Some(sample.clone())
            };
            // Walls may be closer together than their current precision.
            let Some(at) = at else {
                return Ok(None);
            };
            let is_clear = |c: &RBig| self.is_clear(&u, &at, c, bits > MAX_APPROXIMATE_BITS);
            Ok(standing.separators.iter().all(is_clear).then_some(at))
        })
    }

    /// Returns the number of separators below each root between the sides over u, if floating point
    /// decides.
    fn near_gaps(&self, u: &RBig, separators: &[RBig]) -> Option<Vec<usize>> {
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

    /// Returns true if no curve crosses the line v = c from the wall up to `at`. Without `exact`,
    /// false may also mean that the test was too coarse.
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
                            // On one side of both, and not on the wall, by the choice of c.
                            from == to && to.is_ne()
                        })
                }
        })
    }
}

/// Returns true if ranges in ascending order are disjoint.
fn are_apart(found: &[LocatedNumber]) -> bool {
    found.windows(2).all(|w| w[0].hi < w[1].lo)
}

/// Returns a simple number within 2^−bits of the way from a wall to `sample`, on the given side of
/// the wall; `None` if the sample may lie within the interval of the wall.
fn nearer(wall: &RealRoot, sample: &RBig, side: Ordering, bits: usize) -> Option<RBig> {
    let (lo, hi) = wall.interval();
    let near = if side.is_gt() { hi } else { lo };
    if sample.cmp(&near) != side {
        return None;
    }
    let step = (sample - &near) / RBig::from(IBig::ONE << bits);
    Some(if side.is_gt() {
        simplest_between(&near, &(&near + step))
    } else {
        simplest_between(&(&near + step), &near)
    })
}
