//! The part of the parameter plane that a map sends into a box, exactly.
//!
//! |X|, |Y|, |Z| ≤ B|W| is bounded by the six curves X ± B W, Y ± B W, Z ± B W. In each of the four
//! unit triangles their arrangement has finitely many cells, on each of which the map stays inside
//! the box or outside of it. A cell that is inside does not meet the pole curve: where W vanishes
//! inside, all four forms do, and that is a base point.
//!
//! The sides of a region of the parameter plane are lines that enter the same arrangement; cells
//! outside of it are not inside. Curves of the box that are proved to miss it are left out: where
//! one of them is, no base point is in the region.

use crate::deck::Deck;
use crate::domain::{Domain, image_bounds, parameters};
use crate::field::exact;
use crate::map::Map;
use isoform_algebra::{
    Arrangement, ArrangementError, Poly, QUADRANTS, RBig, coprime_base, in_triangle,
};
use isoform_control::Control;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use std::collections::{BTreeMap, BTreeSet};

/// The region in one of the unit triangles.
pub struct Triangle {
    /// The cells. Curve k of the arrangement is factor k of the region.
    pub arrangement: Arrangement,
    /// Of each slab the cells from bottom to top: whether the map sends them into the box.
    pub inside: Vec<Vec<bool>>,
}

/// The region in the projective plane.
pub struct Region {
    /// Half the width of the box.
    pub half_width: RBig,
    /// Irreducible or not, squarefree and pairwise coprime forms whose zeros bound the region.
    pub factors: Vec<Poly>,
    /// The faces of the box that each factor belongs to: −X, +X, −Y, +Y, −Z, +Z are 0 to 5.
    pub faces: Vec<Vec<usize>>,
    /// The sides of the domain whose lines each factor is, as bits.
    pub(crate) lines: Vec<u64>,
    /// The factors that the surface is folded along.
    folds: BTreeSet<usize>,
    /// The fundamental domain to which it is restricted.
    pub(crate) deck: Option<Deck>,
    /// Of each of the other curves the factors that it consists of.
    pub extra: Vec<Vec<usize>>,
    /// By quadrants, as in [`QUADRANTS`].
    pub triangles: Vec<Triangle>,
    /// The part of the parameter plane to which it is restricted.
    pub domain: Option<Domain>,
    /// Whether the map is proved to have no pole in the closed domain and to send it into the open
    /// box: then neither was decomposed.
    pub is_clear: bool,
}

/// The topology of a region: of the surface in the box as far as no two parameters have the same
/// image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegionTopology {
    /// Euler characteristic.
    pub euler: i64,
    /// Connected components.
    pub components: usize,
    /// Connected components of the boundary.
    pub loops: usize,
}

impl Region {
    /// The parameters that a map sends into the box \[−B, B\]³, with B = `half_width` > 0,
    /// decomposed by other curves, too: forms in (s, t, w).
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
    /// Those of them that are in a domain, and in the fundamental domain of deck transformations,
    /// whose seams are among the other curves.
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
        let [forms @ .., w] = map.forms();
        let is_clear = domain.is_some_and(|d| is_clear(map, half_width, d));
        let bounds: Vec<Poly> = match is_clear {
            true => Vec::new(),
            false => forms
                .iter()
                .flat_map(|x| [x + &w.scale(half_width), x - &w.scale(half_width)])
                .collect(),
        };
        let lines = domain.map(Domain::lines).unwrap_or_default();
        let folds = deck.map_or(&[][..], |d| &d.folds.curves);
        let borders = bounds.iter().chain(&lines).chain(folds);
        let all: Vec<Poly> = borders.chain(extra).cloned().collect();
        let (factors, divisors) = coprime_base(&all);
        let mut rest = divisors[bounds.len() + lines.len()..].to_vec();
        let extra = rest.split_off(folds.len());
        let folds = rest.into_iter().flatten().collect();
        let faces = (0..factors.len())
            .map(|f| {
                (0..bounds.len())
                    .filter(|&b| divisors[b].contains(&f))
                    .collect()
            })
            .collect();
        let sides = |f: usize| {
            (0..lines.len())
                .filter(|k| divisors[bounds.len() + k].contains(&f))
                .fold(0, |bits, k| bits | 1 << k)
        };
        let lines = (0..factors.len()).map(sides).collect();
        let triangles = (0..4).into_par_iter().map(|quadrant| {
            let local = |p: &Poly| in_triangle(p, quadrant);
            let arrangement =
                Arrangement::new(&factors.iter().map(local).collect::<Vec<_>>(), control)?;
            let bounds: Vec<Poly> = bounds.iter().map(local).collect();
            let inside = arrangement
                .slabs
                .iter()
                .map(|slab| {
                    let bounds: Vec<Poly> = bounds.iter().map(|b| b.set(0, &slab.u)).collect();
                    let between = |v: &RBig| {
                        bounds.chunks(2).all(|pair| {
                            let [low, high] = [0, 1].map(|k| {
                                let value = pair[k].set(1, v).as_constant();
                                value.expect("both variables have values")
                            });
                            low.sign() != high.sign() || low.is_zero() || high.is_zero()
                        })
                    };
                    let in_domain = |v: &RBig| {
                        let at = [&slab.u, v];
                        domain.is_none_or(|d| {
                            parameters(quadrant, at).is_some_and(|p| d.contains(&p))
                        }) && deck.is_none_or(|d| d.holds(&homogeneous(quadrant, at)))
                    };
                    slab.between
                        .iter()
                        .map(|v| in_domain(v) && between(v))
                        .collect()
                })
                .collect();
            Ok(Triangle {
                arrangement,
                inside,
            })
        });
        let triangles: Vec<Result<Triangle, ArrangementError>> = triangles.collect();
        let triangles = triangles.into_iter().collect::<Result<_, _>>()?;
        Ok(Self {
            half_width: half_width.clone(),
            factors,
            faces,
            lines,
            folds,
            deck: deck.cloned(),
            extra,
            triangles,
            domain: domain.cloned(),
            is_clear,
        })
    }
    /// Whether the surface ends elsewhere than in the box's faces.
    fn has_borders(&self) -> bool {
        self.domain.is_some()
            || (0..3).any(|side| self.is_fold_side(side))
            || !self.folds.is_empty()
    }
    /// The factors that the surface is folded along.
    pub(crate) fn folds(&self) -> impl Iterator<Item = usize> {
        self.folds.iter().copied()
    }
    /// Whether a point (s : t : w) is in the fundamental domain, if there is one.
    pub(crate) fn is_fundamental(&self, p: &[RBig; 3]) -> bool {
        self.deck.as_ref().is_none_or(|d| d.holds(p))
    }
    /// Whether the surface is folded along a factor.
    pub(crate) fn is_fold(&self, factor: usize) -> bool {
        self.folds.contains(&factor)
    }
    /// Whether it is folded along a side of the unit triangles.
    pub(crate) fn is_fold_side(&self, side: usize) -> bool {
        self.deck.as_ref().is_some_and(|d| d.folds.sides[side])
    }
    /// The side of the domain, as a bit, that an arc over a slab lies on: none for what only lies
    /// on its line. A curve along which the surface is folded counts as the first side.
    pub(crate) fn side_of_arc(&self, quadrant: usize, slab: usize, place: usize) -> u64 {
        let a = &self.triangles[quadrant].arrangement;
        let (u, curve) = (&a.slabs[slab].u, a.slabs[slab].arcs[place].curve);
        let is_fold = match curve {
            c if c == a.lower() => self.is_fold_side(1),
            c if c == a.upper() => self.is_fold_side(2),
            c => self.folds.contains(&c),
        };
        if is_fold {
            return FOLD;
        }
        let v = match curve {
            c if c == a.lower() => Some(RBig::ZERO),
            c if c == a.upper() => Some(RBig::ONE - u),
            c if self.lines[c] != 0 => on_line(a.curve(c), u),
            _ => None,
        };
        v.map_or(0, |v| self.side_at(quadrant, [u, &v]))
    }
    /// The same for the wall between a point and the next.
    pub(crate) fn side_of_wall(&self, quadrant: usize, wall: usize, point: usize) -> u64 {
        let w = &self.triangles[quadrant].arrangement.walls[wall];
        if point + 1 < w.points.len()
            && (wall == 0 && self.is_fold_side(0)
                || w.vertical.iter().any(|f| self.folds.contains(f)))
        {
            return FOLD;
        }
        // The side u = 0, or an upright line.
        let is_line = point + 1 < w.points.len()
            && (wall == 0 || w.vertical.iter().any(|&f| self.lines[f] != 0));
        let Some(u) = Some(&w.u)
            .filter(|_| self.domain.is_some() && is_line)
            .and_then(|u| u.to_rational())
        else {
            return 0;
        };
        let v = (&w.points[point].hi + &w.points[point + 1].lo) / RBig::from(2);
        self.side_at(quadrant, [&u, &v])
    }
    /// The same for what a place of a unit triangle's side lies on: it is no point that a curve
    /// goes through.
    pub(crate) fn side_of_place(&self, quadrant: usize, at: [f64; 2]) -> u64 {
        let side = at.iter().position(|x| *x == 0.0).unwrap_or(2);
        if self.is_fold_side(side) {
            return FOLD;
        }
        let [u, v] = at.map(exact);
        if self.domain.is_none() {
            0
        } else {
            self.side_at(quadrant, [&u, &v])
        }
    }
    fn side_at(&self, quadrant: usize, at: [&RBig; 2]) -> u64 {
        let side = |d: &Domain| d.side_at(&parameters(quadrant, at)?);
        self.domain.as_ref().and_then(side).map_or(0, |k| 1 << k)
    }
    /// All sides that end in a point of a wall, or that it is on.
    pub(crate) fn sides_of_point(&self, quadrant: usize, wall: usize, point: usize) -> u64 {
        if !self.has_borders() {
            return 0;
        }
        let a = &self.triangles[quadrant].arrangement;
        let mut bits = 0;
        for (slab, right) in [(wall.wrapping_sub(1), false), (wall, true)] {
            for (i, arc) in a
                .slabs
                .get(slab)
                .map_or(&[][..], |s| &s.arcs)
                .iter()
                .enumerate()
            {
                if (if right { arc.left } else { arc.right }) == point {
                    bits |= self.side_of_arc(quadrant, slab, i);
                }
            }
        }
        let before = point
            .checked_sub(1)
            .map_or(0, |p| self.side_of_wall(quadrant, wall, p));
        bits | before | self.side_of_wall(quadrant, wall, point)
    }

    /// Euler characteristic, components and boundary loops. The region is taken as the closure of
    /// its cells.
    pub fn topology(&self) -> RegionTopology {
        let mut count = Count::default();
        for (quadrant, triangle) in self.triangles.iter().enumerate() {
            count.add(triangle, quadrant);
        }
        count.finish()
    }
}

/// The bit of the curves that the surface is folded along: maps over a domain have none.
pub(crate) const FOLD: u64 = 1;

/// (s : t : w) of a point of a unit triangle.
fn homogeneous(quadrant: usize, [u, v]: [&RBig; 2]) -> [RBig; 3] {
    let [s, t] = QUADRANTS[quadrant].map(RBig::from);
    [s * u, t * v, RBig::ONE - u - v]
}

/// Whether the map is proved to have no pole in a closed domain and to send it into the open box.
pub(crate) fn is_clear(map: &Map, half_width: &RBig, domain: &Domain) -> bool {
    let inside = |[lo, hi]: &[RBig; 2]| *lo > -half_width && hi < half_width;
    image_bounds(map.affine(), &domain.bounds()).is_some_and(|b| b.iter().all(inside))
}

/// v on a line over u.
fn on_line(line: &Poly, u: &RBig) -> Option<RBig> {
    let rest = line.set(0, u);
    let slope = rest.coefficient([0, 1, 0, 0]);
    (!slope.is_zero()).then(|| -rest.coefficient([0; 4]) / slope)
}

impl Triangle {
    /// Whether a point of a wall belongs to the closure of a cell inside.
    pub(crate) fn holds_point(&self, wall: usize, point: usize) -> bool {
        self.cells_at(wall, point, point).next().is_some()
    }
    /// Whether the wall between a point and the next does.
    pub(crate) fn holds_segment(&self, wall: usize, point: usize) -> bool {
        self.cells_at(wall, point, point + 1).next().is_some()
    }
    /// Whether the cells on the left and on the right of the wall between a point and the next are
    /// inside.
    pub(crate) fn sides_held(&self, wall: usize, point: usize) -> [bool; 2] {
        let mut held = [false; 2];
        self.cells_at(wall, point, point + 1)
            .for_each(|(slab, _)| held[usize::from(slab == wall)] = true);
        held
    }
    /// The cells inside, as slab and place, that a stretch of a wall belongs to.
    fn cells_at(
        &self,
        wall: usize,
        from: usize,
        to: usize,
    ) -> impl Iterator<Item = (usize, usize)> {
        let slabs = &self.arrangement.slabs;
        [(wall.wrapping_sub(1), false), (wall, true)]
            .into_iter()
            .filter(|s| s.0 < slabs.len())
            .flat_map(move |(s, is_right)| {
                let end = move |i: usize| {
                    if is_right {
                        slabs[s].arcs[i].left
                    } else {
                        slabs[s].arcs[i].right
                    }
                };
                (0..self.inside[s].len())
                    .filter(move |&i| self.inside[s][i] && end(i) <= from && to <= end(i + 1))
                    .map(move |i| (s, i))
            })
    }
    /// Whether anything but the side itself goes through a point of the wall.
    pub(crate) fn is_real(&self, wall: usize, point: usize) -> bool {
        let n = self.arrangement.lower();
        let w = &self.arrangement.walls[wall];
        w.points[point].curves.iter().any(|&c| c < n) || !w.vertical.is_empty()
    }
}

/// Where cells of different triangles meet: the sides s = 0, t = 0, w = 0 by the sign of t, s, s t,
/// and the corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// Slab and place of a cell in a triangle.
    Cell(usize, usize, usize),
    /// Point of a wall inside a triangle.
    Inner(usize, usize, usize),
    /// A point of a side that a bounding curve goes through, by order; an interval of it after that
    /// many points.
    Point(usize, i64, usize),
    Interval(usize, i64, usize),
    /// (0:0:1), (1:0:0), (0:1:0).
    Corner(usize),
}

/// Sums over the pieces of the region: open cells of the triangles one by one, what lies on sides
/// once for both triangles.
#[derive(Default)]
struct Count {
    euler: i64,
    on_sides: BTreeMap<Place, bool>,
    /// Which pieces touch.
    touching: Vec<(Place, Place)>,
    /// Pieces of the boundary and their ends.
    bounding: Vec<(Place, Place)>,
    /// How many triangles with the region next to it an interval of a side that is itself a
    /// bounding curve has.
    cells: Vec<Place>,
    side_cells: BTreeMap<Place, usize>,
    side_ends: BTreeMap<Place, (Place, Place)>,
}

impl Count {
    fn add(&mut self, t: &Triangle, q: usize) {
        let walls = &t.arrangement.walls;
        let last = walls.len() - 1;
        let n = t.arrangement.lower();
        // Names of all points of walls. Points on sides that only this triangle's decomposition
        // knows belong to the interval around.
        let [s, r] = QUADRANTS[q];
        let mut names: BTreeMap<(usize, usize), Place> = BTreeMap::new();
        let mut seen = [0usize; 3];
        for k in 0..=last {
            let top = walls[k].points.len() - 1;
            for p in 0..=top {
                let on_side = match (k, p) {
                    (k, _) if k == last => Err(1),
                    (0, 0) => Err(0),
                    (0, p) if p == top => Err(2),
                    (0, _) => Ok((0, r)),
                    (_, 0) => Ok((1, s)),
                    (_, p) if p == top => Ok((2, s * r)),
                    _ => {
                        names.insert((k, p), Place::Inner(q, k, p));
                        continue;
                    }
                };
                let name = match on_side {
                    Err(corner) => Place::Corner(corner),
                    Ok((side, sign)) if t.is_real(k, p) => {
                        seen[side] += 1;
                        Place::Point(side, sign, seen[side])
                    }
                    Ok((side, sign)) => Place::Interval(side, sign, seen[side]),
                };
                names.insert((k, p), name);
                if t.holds_point(k, p) {
                    self.on_sides.insert(name, true);
                }
            }
        }
        // Open cells, arcs, stretches of walls and points inside the triangle.
        for (k, slab) in t.arrangement.slabs.iter().enumerate() {
            for (i, &inside) in t.inside[k].iter().enumerate() {
                if inside {
                    self.euler += 1;
                    self.cells.push(Place::Cell(q, k, i));
                }
            }
            for (i, arc) in slab.arcs.iter().enumerate() {
                let below = i > 0 && t.inside[k][i - 1];
                let above = i < t.inside[k].len() && t.inside[k][i];
                let ends = (names[&(k, arc.left)], names[&(k + 1, arc.right)]);
                if arc.curve >= n {
                    // On a side: the interval between its points.
                    let (side, sign) = if arc.curve == n { (1, s) } else { (2, s * r) };
                    let before = (0..=k)
                        .filter(|&w| {
                            w > 0
                                && matches!(
                                    names[&(w, self.side_point(t, w, side))],
                                    Place::Point(..)
                                )
                        })
                        .count();
                    if below || above {
                        let name = Place::Interval(side, sign, before);
                        self.on_sides.insert(name, true);
                        self.touching
                            .push((name, Place::Cell(q, k, if above { i } else { i - 1 })));
                        *self.side_cells.entry(name).or_default() |= 1 << q;
                    }
                    continue;
                }
                if below || above {
                    self.euler -= 1;
                }
                if below && above {
                    self.touching
                        .push((Place::Cell(q, k, i - 1), Place::Cell(q, k, i)));
                } else if below || above {
                    self.bounding.push(ends);
                }
            }
        }
        for (k, wall) in walls.iter().enumerate() {
            for p in 0..wall.points.len() {
                if matches!(names[&(k, p)], Place::Inner(..)) && t.holds_point(k, p) {
                    self.euler += 1;
                }
                for (slab, i) in t.cells_at(k, p, p) {
                    self.touching
                        .push((Place::Cell(q, slab, i), names[&(k, p)]));
                }
                if p + 1 < wall.points.len() && t.holds_segment(k, p) {
                    if k == 0 {
                        let before = (1..=p)
                            .filter(|&p| matches!(names[&(0, p)], Place::Point(..)))
                            .count();
                        let name = Place::Interval(0, r, before);
                        self.on_sides.insert(name, true);
                        *self.side_cells.entry(name).or_default() |= 1 << q;
                        for (slab, i) in t.cells_at(k, p, p + 1) {
                            self.touching.push((name, Place::Cell(q, slab, i)));
                        }
                        continue;
                    }
                    self.euler -= 1;
                    let cells: Vec<_> = t.cells_at(k, p, p + 1).collect();
                    if let [a, b] = cells[..] {
                        self.touching
                            .push((Place::Cell(q, a.0, a.1), Place::Cell(q, b.0, b.1)));
                    } else if !wall.vertical.is_empty() {
                        self.bounding.push((names[&(k, p)], names[&(k, p + 1)]));
                    }
                }
            }
        }
        // What the intervals of the sides end in.
        for (side, sign, ends, points) in [
            (
                0,
                r,
                (0, 2),
                (0..walls[0].points.len())
                    .map(|p| (0, p))
                    .collect::<Vec<_>>(),
            ),
            (1, s, (0, 1), (0..=last).map(|k| (k, 0)).collect()),
            (
                2,
                s * r,
                (2, 1),
                (0..=last).map(|k| (k, walls[k].points.len() - 1)).collect(),
            ),
        ] {
            let mut before = Place::Corner(ends.0);
            let mut number = 0;
            let mut close = |at: Place, next: Place| {
                self.side_ends
                    .insert(Place::Interval(side, sign, number), (at, next));
                number += 1;
            };
            for name in points
                .iter()
                .map(|p| names[p])
                .filter(|n| matches!(n, Place::Point(..)))
            {
                close(before, name);
                before = name;
            }
            close(before, Place::Corner(ends.1));
        }
    }

    fn side_point(&self, t: &Triangle, wall: usize, side: usize) -> usize {
        if side == 1 {
            0
        } else {
            t.arrangement.walls[wall].points.len() - 1
        }
    }

    fn finish(mut self) -> RegionTopology {
        for place in self.on_sides.keys() {
            match place {
                Place::Point(..) | Place::Corner(_) => self.euler += 1,
                Place::Interval(..) => self.euler -= 1,
                Place::Cell(..) | Place::Inner(..) => {}
            }
        }
        // A side with the region on one hand only bounds it.
        for (place, triangles) in &self.side_cells {
            if triangles.count_ones() == 1
                && let Some(&ends) = self.side_ends.get(place)
            {
                self.bounding.push(ends);
            }
        }
        let components = groups(
            self.touching
                .iter()
                .copied()
                .chain(self.cells.iter().map(|&c| (c, c))),
        );
        let loops = groups(self.bounding.iter().copied());
        RegionTopology {
            euler: self.euler,
            components,
            loops,
        }
    }
}

/// The number of connected components of a graph.
fn groups(pairs: impl Iterator<Item = (Place, Place)>) -> usize {
    let mut number: BTreeMap<Place, usize> = BTreeMap::new();
    let mut parent: Vec<usize> = Vec::new();
    fn root(parent: &mut [usize], mut k: usize) -> usize {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    }
    for (a, b) in pairs {
        let [a, b] = [a, b].map(|p| {
            let next = parent.len();
            let k = *number.entry(p).or_insert(next);
            if k == next {
                parent.push(k);
            }
            root(&mut parent, k)
        });
        let [a, b] = [a, b].map(|k| root(&mut parent, k));
        parent[a] = b;
    }
    (0..parent.len()).filter(|&k| parent[k] == k).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(texts: [&str; 4], half_width: &str) -> [i64; 3] {
        let map = Map::parse(texts, Default::default()).expect("a map");
        let half_width = Poly::parse(half_width, &[])
            .expect("a number")
            .as_constant()
            .expect("a number");
        let t = Region::new(&map, &half_width, &[], &Control::default())
            .expect("a region")
            .topology();
        [t.euler, t.components as i64, t.loops as i64]
    }

    #[test]
    fn planes_and_spheres() {
        assert_eq!(topology(["s", "t", "0", "1"], "1"), [1, 1, 1], "a square");
        assert_eq!(
            topology(["s", "t", "s + t", "1"], "1"),
            [1, 1, 1],
            "a hexagon"
        );
        assert_eq!(
            topology(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], "2"),
            [1, 1, 0],
            "the whole projective plane"
        );
        let sphere = ["4*s", "4*t", "2*s^2 + 2*t^2 - 2", "s^2 + t^2 + 1"];
        assert_eq!(
            topology(sphere, "1"),
            [0, 0, 0],
            "a sphere of radius 2 around the box"
        );
        assert_eq!(topology(sphere, "3/2"), [-4, 1, 6], "the caps cut off");
        assert_eq!(
            topology(sphere, "5/4"),
            [8, 8, 8],
            "only what is near the diagonals of the box is left"
        );
    }

    /// Maps without real base points, whose regions were counted elsewhere.
    #[test]
    fn regions_of_the_zoo() {
        let mut compared = 0;
        for file in isoform_testdata::files("zoo", "json") {
            let text = std::fs::read_to_string(&file).expect("readable");
            let known: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let counted = &known["box_topology_normalised"];
            let Some(true) = counted["stable"].as_bool() else {
                continue;
            };
            let map = Map::from_json(&text, Default::default()).expect("a map");
            let half_width = RBig::from(known["box"].as_i64().expect("a number"));
            let t = Region::new(&map, &half_width, &[], &Control::default())
                .expect("a region")
                .topology();
            let expected = ["chi", "components", "boundary_loops"]
                .map(|k| counted[k].as_i64().expect("a number"));
            assert_eq!(
                [t.euler, t.components as i64, t.loops as i64],
                expected,
                "{}",
                file.display()
            );
            compared += 1;
        }
        assert!(compared >= 11, "{compared} regions compared");
    }
}
