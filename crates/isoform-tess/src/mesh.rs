//! From the region to triangles: arcs and sides as polylines on the surface, a constrained Delaunay
//! triangulation of each unit triangle, and refinement until every triangle is near the surface and
//! W keeps its sign on it.
//!
//! Between two walls of an arrangement the polylines of arcs have their vertices over the same u,
//! in the order of the arcs: they cannot cross, and what they bound is the region up to isotopy.

mod border;
mod chart;
mod closing;
mod contraction;
mod drawing;
pub(crate) mod fineness;
mod folds;
mod gluing;
mod in_chart;
pub(crate) mod matching;
mod opening;
mod plane;
mod stretch;
mod strips;
pub(crate) mod traced;
mod unit;

use crate::analysis::Analysis;
use crate::claim::{Claim, Grade};
use crate::deck::Deck;
use crate::double::Fibres;
use crate::fan::{Direction, Fan, Key};
use crate::field::{Algebraic, vanishes};
use crate::finding::Finding;
use crate::map::Map;
use crate::region::Region;
use crate::singular::{CurveKind, RealPart};
use crate::surface::{Kind, MeshOptions, Point3, Surface};
use chart::Chart;
use closing::finish;
use fineness::Fineness;
use gluing::{Gluing, Track, key};
use isoform_algebra::{Arrangement, Poly, QUADRANTS, RBig};
use isoform_control::Control;
use isoform_geom::{norm, sub};
use matching::Place;
use rayon::iter::{
    IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator,
};
use std::collections::{BTreeMap, BTreeSet};
use traced::Traced;
use unit::{Joined, Unit};

/// A name that both triangles at a side agree on: the sides s = 0, t = 0, w = 0 by the sign of t,
/// s, s t, the place along them as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Name {
    Inner,
    Side(usize, i64, u64),
    Corner(usize),
    /// The image of a contracted curve.
    Image(usize),
    /// On the seam of a base point, in a direction.
    Seam(usize, Key),
    /// On a ray of a base point, in a direction, backward or not: so many vertices after the
    /// rectangle.
    Ray(usize, Ray, usize),
    /// Where sheets meet.
    Double(usize),
}

#[derive(Clone, Copy, Debug)]
struct Node {
    at: [f64; 2],
    name: Name,
    /// Faces of the box that it is on.
    faces: u8,
    /// The contracted curve that it is on, by its image.
    image: Option<usize>,
    /// A base point: the map has no value there.
    apex: bool,
    /// The sides of the domain that it is on, as bits.
    borders: u64,
}

impl Node {
    fn inner(at: [f64; 2], faces: u8) -> Self {
        Self {
            at,
            name: Name::Inner,
            faces,
            image: None,
            apex: false,
            borders: 0,
        }
    }
}

fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
}
fn distance(a: Point3, b: Point3) -> f64 {
    norm(sub(a, b))
}
/// The length of the longest edge of a triangle.
fn longest([p, q, r]: [Point3; 3]) -> f64 {
    distance(p, q).max(distance(q, r)).max(distance(r, p))
}

/// Halvings of a contracted curve because what leaves it turns.
const TURNS: usize = 10;
/// Halvings of a stretch of an arc or side: ends with vertical tangents are approached to 2⁻⁴⁰ of
/// the stretch.
const HALVINGS: usize = 40;
/// Halvings, and triangles, where a base point is left open: nothing gets fine enough there, and
/// the result is not certified anyway.
const OPEN_HALVINGS: usize = 12;
const OPEN_TRIANGLES: usize = 100_000;
/// Vertices of a stretch at most: more has one along which the map is not continuous.
const VERTICES: usize = 1 << 14;

/// What is made another way than at first, where triangles crossed.
#[derive(Default)]
pub(crate) struct Changes {
    pub(crate) fineness: Fineness,
    /// Further vertices.
    pub(crate) matched: Vec<Place>,
}

/// Triangulates the part of the surface that is in the box. The region is decomposed by `curves`,
/// too. What could not be opened, joined or refined is said to be unproven.
pub(crate) fn mesh(
    map: &Map,
    region: &Region,
    analysis: &Analysis,
    curves: &Curves,
    options: &MeshOptions,
    changes: &Changes,
    control: &Control<'_>,
) -> Surface {
    let half_width = region.half_width.to_f64().value();
    let mut builder = Builder {
        region,
        options,
        fineness: &changes.fineness,
        control,
        charts: std::array::from_fn(|q| Chart::new(map, q, half_width)),
        half_width,
        images: Vec::new(),
        on_curve: BTreeMap::new(),
        on_side: [None; 3],
        double: BTreeSet::new(),
        creased: BTreeSet::new(),
        seams: BTreeSet::new(),
        double_sides: curves.double_sides,
        glued: curves.glued,
        folded: BTreeSet::new(),
        gluing: Gluing::default(),
        fans: Vec::new(),
        sites: BTreeMap::new(),
        widths: Vec::new(),
        halvings: HALVINGS,
        surface: Surface::default(),
    };
    builder.find_contracted(map, curves);
    if !region.is_clear {
        builder.open_base_points(
            analysis.base_points.as_deref().unwrap_or_default(),
            &map.forms()[3],
        );
    }
    let mut sides = builder.sides();
    if let Some(traced) = &curves.traced {
        builder.gluing = builder.glue_traced(traced, &mut sides);
    } else if curves.is_joined() {
        builder.gluing = builder.glue(
            &mut sides,
            &curves.pinches,
            &curves.isolated,
            curves.fibres.as_ref(),
        );
    }
    let surface = std::mem::take(&mut builder.surface);
    let mut units: Vec<Unit> = (0..4)
        .into_par_iter()
        .filter_map(|q| builder.drawn_unit(q, &sides))
        .collect();
    builder.refine(&mut units);
    builder.put(&changes.matched, &mut units);
    let mut joined = Joined::new(surface, &builder.gluing);
    for unit in units {
        builder.add(unit, &mut joined);
    }
    let mut surface = joined.surface;
    surface.is_double_curve_known = curves.glued
        && !builder.gluing.is_stopped
        && (curves.traced.is_some()
            || analysis
                .singular
                .as_ref()
                .is_some_and(|s| s.double.is_some()));
    surface.double_curve = std::mem::take(&mut builder.gluing.arcs);
    surface.findings.append(&mut builder.gluing.findings);
    surface.grades = builder.grades(curves);
    let tolerance = |p: Point3| builder.tolerance_at(p);
    let mut surface = finish(surface, builder.half_width, curves.glued, &tolerance);
    // Contracted curves with one image are one vertex, and what is joined with them is known by
    // its image: where sheets are not to be joined, it may be one of another sheet.
    if curves.deck.is_some() && !curves.glued {
        let count = closing::pinched(&surface);
        if count > 0 {
            surface.findings.push(Finding::PinchedVertices(count));
        }
    }
    surface
}

/// The curves that a region is decomposed by beside those of the box, without the sides of the unit
/// triangles, which are there already.
#[derive(Default)]
pub(crate) struct Curves {
    contracted: Vec<(Poly, Vec<Point3>)>,
    double: Vec<Poly>,
    /// Cuspidal edges.
    creased: Vec<Poly>,
    double_sides: [bool; 3],
    /// Whether sheets that cross are joined.
    glued: bool,
    /// The fundamental domain of deck transformations: its border is joined with itself.
    deck: Option<Deck>,
    pinches: Vec<[f64; 3]>,
    /// Isolated real points of singular curves.
    isolated: Vec<[f64; 3]>,
    /// What tells a real parameter alone from one that meets conjugate ones.
    fibres: Option<Fibres>,
    /// The double curve, if it was traced and is not to be decomposed.
    traced: Option<Traced>,
}

impl Curves {
    /// Contracted ones; where sheets are joined, double ones and cuspidal edges, too.
    pub(crate) fn new(
        analysis: &Analysis,
        glued: bool,
        deck: Option<Deck>,
        pinches: Vec<[f64; 3]>,
        fibres: Option<Fibres>,
        traced: Option<Traced>,
    ) -> Self {
        let is_fold = |c: &Poly| deck.as_ref().is_some_and(|d| d.folds.curves.contains(c));
        let mut found = Self {
            glued,
            pinches,
            fibres,
            ..Self::default()
        };
        let all = analysis.singular.as_ref().map_or(&[][..], |s| &s.curves);
        for c in all {
            let side = (0..3).find(|&k| c.curve.is_associate(&Poly::var(k)));
            if let RealPart::Points(points) = &c.real
                && glued
            {
                // Those of contracted curves have their images anyway.
                let is_contracted = |p: &[Algebraic; 3]| {
                    all.iter().any(|c| {
                        matches!(c.kind, CurveKind::Contracted(_)) && vanishes(&c.curve, p)
                    })
                };
                found.isolated.extend(
                    points
                        .iter()
                        .filter(|p| !is_contracted(p))
                        .map(|p| p.each_ref().map(Algebraic::to_f64)),
                );
            }
            match (&c.kind, side) {
                (CurveKind::Contracted(to), None) if !to.at_infinity() => {
                    let images = to
                        .points()
                        .iter()
                        .map(|p| [0, 1, 2].map(|k| p[k].to_f64() / p[3].to_f64()))
                        .collect::<Vec<_>>();
                    if !images.is_empty() {
                        found.contracted.push((c.curve.clone(), images));
                    }
                }
                (CurveKind::Double, _) if glued && traced.is_none() && c.is_double_arc() => {
                    found.add_double(&c.curve);
                }
                (CurveKind::Ramified, None)
                    if glued && matches!(c.real, RealPart::Curve) && !is_fold(&c.curve) =>
                {
                    found.creased.push(c.curve.clone())
                }
                _ => {}
            }
        }
        for border in deck.iter().map(|d| &d.seams) {
            (0..3).for_each(|k| found.double_sides[k] |= border.sides[k]);
        }
        found.deck = deck;
        found.traced = traced;
        found
    }
    /// The curves along which the border of a fundamental domain is joined with itself.
    fn seams(&self) -> &[Poly] {
        self.deck.as_ref().map_or(&[], |d| &d.seams.curves)
    }
    /// Whether there are vertices with several parameters.
    fn is_joined(&self) -> bool {
        self.glued || self.deck.is_some()
    }
    /// Whether arcs stand for the double curve.
    pub(crate) fn is_traced(&self) -> bool {
        self.traced.is_some()
    }
    /// Has arcs in the place of double curves of parameters.
    pub(crate) fn trace(&mut self, traced: Option<Traced>) {
        self.traced = traced;
        self.double.clear();
        self.double_sides = [false; 3];
    }
    /// Has double curves of parameters in the place of arcs, which are left to the caller.
    pub(crate) fn decompose(&mut self, analysis: &Analysis) -> Option<Traced> {
        let curves = analysis.singular.as_ref().map_or(&[][..], |s| &s.curves);
        for c in curves.iter().filter(|c| c.is_double_arc()) {
            self.add_double(&c.curve);
        }
        self.traced.take()
    }
    fn add_double(&mut self, curve: &Poly) {
        match (0..3).find(|&k| curve.is_associate(&Poly::var(k))) {
            Some(k) => self.double_sides[k] = true,
            None => self.double.push(curve.clone()),
        }
    }
    /// Forms in (s, t, w).
    pub(crate) fn forms(&self) -> Vec<Poly> {
        let contracted = self.contracted.iter().map(|c| &c.0);
        contracted
            .chain(&self.double)
            .chain(&self.creased)
            .chain(self.seams())
            .cloned()
            .collect()
    }
}

struct Builder<'a> {
    region: &'a Region,
    options: &'a MeshOptions,
    fineness: &'a Fineness,
    control: &'a Control<'a>,
    charts: [Chart; 4],
    half_width: f64,
    /// Images of contracted curves.
    images: Vec<Point3>,
    /// Those of each contracted factor of the region, and of the lines s = 0, t = 0, w = 0.
    on_curve: BTreeMap<usize, Vec<usize>>,
    on_side: [Option<usize>; 3],
    /// Factors of the region that are double curves, and cuspidal edges.
    double: BTreeSet<usize>,
    creased: BTreeSet<usize>,
    /// Those on the border of a fundamental domain, which are double curves to what joins them.
    seams: BTreeSet<usize>,
    double_sides: [bool; 3],
    /// Whether sheets that cross are joined.
    glued: bool,
    /// Seams, by fan and node, that the surface ends in.
    folded: BTreeSet<(usize, usize)>,
    gluing: Gluing,
    /// Base points, opened.
    fans: Vec<Fan>,
    /// Where they are: by quadrant, wall and point.
    sites: BTreeMap<(usize, usize, usize), Site>,
    /// Half the widths of the rectangles around them.
    widths: Vec<f64>,
    halvings: usize,
    surface: Surface,
}

/// A base point in a unit triangle.
struct Site {
    fan: usize,
    at: [f64; 2],
    /// Half the height of the rectangle around it.
    height: f64,
    /// Drawn arcs that end there.
    arcs: Vec<SiteArc>,
}

/// An arc that ends in a base point.
struct SiteArc {
    ray: Ray,
    /// Whether it lies to the right, or upward if it is a vertical line.
    right: bool,
    curve: usize,
    /// Slabs and places in them, from the base point to the border of the rectangle; none for a
    /// vertical line.
    chain: Vec<(usize, usize)>,
    /// On the border of the rectangle, and halfway.
    end: [f64; 2],
    middle: [f64; 2],
}

impl SiteArc {
    /// How far its end is above or below the base point.
    fn rise(&self, base: [f64; 2]) -> f64 {
        (self.end[1] - base[1]).abs()
    }
    /// The points of walls that it passes within the rectangle.
    fn passed(&self, a: &Arrangement) -> Vec<(usize, usize)> {
        let ends = |&(slab, i): &(usize, usize)| {
            let arc = a.slabs[slab].arcs[i];
            if self.right {
                (slab + 1, arc.right)
            } else {
                (slab, arc.left)
            }
        };
        self.chain[..self.chain.len().saturating_sub(1)]
            .iter()
            .map(ends)
            .collect()
    }
}

/// A direction of a fan, by its key, and whether it is backward.
type Ray = (Key, bool);

/// Where a point (s : t : w) is in the plane of the unit triangle of a quadrant, be it outside.
fn place_beside(quadrant: usize, p: [f64; 3]) -> [f64; 2] {
    let y = folded(quadrant, p);
    let sum: f64 = y.iter().sum();
    [y[0] / sum, y[1] / sum]
}
/// Where it is in the unit triangle, if it is in it.
fn place_in(quadrant: usize, p: [f64; 3]) -> Option<[f64; 2]> {
    let y = folded(quadrant, p);
    let is_in = y.iter().all(|y| *y >= 0.0) || y.iter().all(|y| *y <= 0.0);
    is_in.then(|| place_beside(quadrant, p))
}
/// Where it is in the unit triangle: exactly on its side, if a coordinate is 0.
fn place_on(quadrant: usize, p: [f64; 3]) -> Option<[f64; 2]> {
    let at = place_in(quadrant, p)?;
    Some(side_of(p, at).map_or(at, |(side, x)| on_side(side, x)))
}
/// The side of the unit triangles that a point is on, and its place there, from that in a triangle.
fn side_of(p: [f64; 3], at: [f64; 2]) -> Option<(usize, f64)> {
    let side = p.iter().position(|&x| x == 0.0)?;
    Some((side, if side == 0 { at[1] } else { at[0] }))
}
/// The coordinates with the signs of a quadrant.
fn folded(quadrant: usize, p: [f64; 3]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * p[0], t * p[1], p[2]]
}

/// (s : t : w) of a point of a unit triangle.
fn in_plane(quadrant: usize, [u, v]: [f64; 2]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * u, t * v, 1.0 - u - v]
}

/// Places along each side, by side and sign, and whether the stretch after each belongs to the
/// region.
type Sides = BTreeMap<(usize, i64), Vec<(f64, bool)>>;

/// Adds a place to a side, but for its ends.
fn add_place(sides: &mut Sides, side: (usize, i64), x: f64) {
    let places = sides.entry(side).or_default();
    let k = places.partition_point(|p| p.0 < x);
    if k > 0 && places.get(k).is_some_and(|p| p.0 != x) {
        places.insert(k, (x, places[k - 1].1));
    }
}

/// The side and sign of the three sides u = 0, v = 0, u + v = 1 of a unit triangle.
fn sides_of(quadrant: usize) -> [(usize, i64); 3] {
    let [s, t] = QUADRANTS[quadrant];
    [(0, t), (1, s), (2, s * t)]
}
/// A place on a side in the triangle.
fn on_side(side: usize, x: f64) -> [f64; 2] {
    match side {
        0 => [0.0, x],
        1 => [x, 0.0],
        _ => [x, 1.0 - x],
    }
}

impl Builder<'_> {
    /// What is claimed of the mesh. Of what had not to be decided nothing is claimed.
    fn grades(&self, curves: &Curves) -> Vec<Grade> {
        let is_opened = !self.sites.is_empty();
        let is_tree = self.sites.values().any(|s| self.fans[s.fan].is_tree());
        let is_joined = curves.is_joined() && self.gluing.is_anything_joined();
        let asked = [
            (Claim::Images, self.images.len() > 1),
            (Claim::Tangents, is_opened),
            (Claim::Trees, is_tree),
            (Claim::SignAtBasePoints, is_opened),
            (Claim::Folds, is_opened && curves.deck.is_some()),
            (Claim::Partners, is_joined || !curves.isolated.is_empty()),
            (Claim::Sheets, curves.deck.is_some() && !curves.glued),
        ];
        let asked = asked.into_iter().filter(|c| c.1).map(|c| c.0);
        let always = [
            Claim::Drawing,
            Claim::SignOfW,
            Claim::Distances,
            Claim::Shapes,
            Claim::Edges,
        ];
        asked.chain(always).map(Grade::from).collect()
    }
    /// Base points in a unit triangle, by quadrant, wall and point.
    fn sites_in(&self, q: usize) -> impl Iterator<Item = (&(usize, usize, usize), &Site)> {
        self.sites.range((q, 0, 0)..(q + 1, 0, 0))
    }
    /// The faces of the box that all curves through a point of a wall belong to.
    fn faces_at(&self, q: usize, wall: usize, point: usize) -> u8 {
        let a = &self.region.triangles[q].arrangement;
        let w = &a.walls[wall];
        let on = [wall == 0, point == 0, point + 1 == w.points.len()];
        let through = |f: usize| {
            w.points[point].curves.contains(&f)
                || w.vertical.contains(&f)
                || a.sides[f].iter().zip(on).any(|(side, on)| *side && on)
        };
        (0..self.region.factors.len())
            .filter(|&f| through(f))
            .fold(0, |bits, f| bits | self.bits(f))
    }
    /// The faces of the box that a whole side of a unit triangle is sent to.
    fn faces_along(&self, q: usize, side: usize) -> u8 {
        let sides = &self.region.triangles[q].arrangement.sides;
        (0..self.region.factors.len())
            .filter(|&f| sides[f][side])
            .fold(0, |bits, f| bits | self.bits(f))
    }
    fn bits(&self, factor: usize) -> u8 {
        self.region.faces[factor]
            .iter()
            .fold(0, |bits, face| bits | 1 << face)
    }
    /// The contracted curve through a point of a wall, by its image.
    fn image_at(&self, q: usize, wall: usize, point: usize) -> Option<usize> {
        let w = &self.region.triangles[q].arrangement.walls[wall];
        let mut factors = w.points[point].curves.iter().chain(&w.vertical);
        factors.find_map(|f| self.nearest_image(q, *f, self.place(q, wall, point)))
    }
    /// The image of a factor that is contracted: the one near to the value of the map at a point of
    /// it.
    fn nearest_image(&self, q: usize, factor: usize, at: [f64; 2]) -> Option<usize> {
        let images = self.on_curve.get(&factor)?;
        let p = self.charts[q].at(at);
        let far = |k: &usize| distance(self.images[*k], p);
        images
            .iter()
            .copied()
            .min_by(|a, b| far(a).total_cmp(&far(b)))
    }
    fn place(&self, q: usize, wall: usize, point: usize) -> [f64; 2] {
        let w = &self.region.triangles[q].arrangement.walls[wall];
        let u = w.u.to_f64();
        if point == 0 {
            return [u, 0.0];
        }
        if point + 1 == w.points.len() {
            return [u, 1.0 - u];
        }
        let p = &w.points[point];
        [u, ((&p.lo + &p.hi) / RBig::from(2)).to_f64().value()]
    }

    /// The name of a place on a side.
    fn name_on(&self, q: usize, side: usize, x: f64) -> Name {
        match (side, x) {
            (0 | 1, 0.0) => Name::Corner(0),
            (1 | 2, 1.0) => Name::Corner(1),
            (0, 1.0) | (2, 0.0) => Name::Corner(2),
            _ => Name::Side(side, sides_of(q)[side].1, x.to_bits()),
        }
    }
    /// The name of a vertex with a parameter (s : t : w).
    fn name_of(&self, q: usize, p: [f64; 3], at: [f64; 2]) -> Name {
        side_of(p, at).map_or(Name::Inner, |(side, x)| self.name_on(q, side, x))
    }
    /// The name of a point of a wall.
    fn wall_name(&self, q: usize, wall: usize, point: usize) -> Name {
        let at = self.place(q, wall, point);
        match () {
            () if wall == 0 => self.name_on(q, 0, at[1]),
            () if point == 0 => self.name_on(q, 1, at[0]),
            () if point + 1
                == self.region.triangles[q].arrangement.walls[wall]
                    .points
                    .len() =>
            {
                self.name_on(q, 2, at[0])
            }
            () => Name::Inner,
        }
    }

    /// The image of a point of a unit triangle, put on the faces of the box that it is known to be
    /// on.
    fn image(&self, q: usize, at: [f64; 2], faces: u8) -> Point3 {
        let mut p = self.charts[q].at(at);
        for face in (0..6).filter(|f| faces >> f & 1 == 1) {
            p[face / 2] = if face % 2 == 0 {
                -self.half_width
            } else {
                self.half_width
            };
        }
        p
    }

    /// The largest distance from the surface near to a point.
    fn tolerance_at(&self, p: Point3) -> f64 {
        self.options.tolerance * self.fineness.factor(p, self.half_width)
    }

    /// Whether a straight piece may stand for what lies between two parameters of a curve in space.
    fn is_fine(&self, at: &dyn Fn(f64) -> Point3, a: f64, b: f64) -> bool {
        let (p, q) = (at(a), at(b));
        let off = [0.25, 0.5, 0.75].map(|t| {
            let x: Point3 = std::array::from_fn(|i| p[i] + t * (q[i] - p[i]));
            distance(at(a + t * (b - a)), x)
        });
        // Values that are not numbers are never fine.
        distance(p, q) <= self.options.longest
            && off
                .iter()
                .all(|&d| d <= 0.3 * self.tolerance_at(middle(p, q)))
    }

    /// Places along the sides that both triangles use.
    fn sides(&self) -> Sides {
        let mut sides: BTreeMap<(usize, i64), Vec<f64>> = BTreeMap::new();
        for q in 0..4 {
            let t = &self.region.triangles[q];
            let walls = &t.arrangement.walls;
            let keys = sides_of(q);
            for key in keys {
                sides.entry(key).or_default();
            }
            let left = (1..walls[0].points.len() - 1)
                .filter(|&p| t.is_real(0, p))
                .map(|p| self.place(q, 0, p)[1]);
            sides.entry(keys[0]).or_default().extend(left);
            for (k, wall) in walls.iter().enumerate().take(walls.len() - 1).skip(1) {
                for (key, p) in [(keys[1], 0), (keys[2], wall.points.len() - 1)] {
                    if t.is_real(k, p) {
                        sides.entry(key).or_default().push(wall.u.to_f64());
                    }
                }
            }
        }
        let mut out = Sides::new();
        for ((side, sign), mut places) in sides {
            places.extend([0.0, 1.0]);
            let both: Vec<usize> = (0..4)
                .filter(|&q| sides_of(q)[side] == (side, sign))
                .collect();
            let based = self.places_on(side, &both);
            places.extend(
                based
                    .iter()
                    .flat_map(|b| b.1)
                    .filter(|x| (0.0..=1.0).contains(x)),
            );
            places.sort_by(f64::total_cmp);
            places.dedup();
            let at = |x: f64| self.charts[both[0]].at(on_side(side, x));
            let mut list = Vec::new();
            for w in places.windows(2) {
                let inside = both
                    .iter()
                    .any(|&q| self.side_is_inside(q, side, 0.5 * (w[0] + w[1])));
                if based.iter().any(|b| b.0 == w[0] || b.0 == w[1]) {
                    list.push((w[0], inside));
                    continue;
                }
                let bit = if inside {
                    self.side_bit(both[0], side, w[0], w[1])
                } else {
                    0
                };
                if let Some(line) =
                    self.border_line(both[0], bit, on_side(side, w[0]), on_side(side, w[1]))
                {
                    let place = |at: &[f64; 2]| if side == 0 { at[1] } else { at[0] };
                    list.extend(line[..line.len() - 1].iter().map(|at| (place(at), inside)));
                    continue;
                }
                let mut stack = vec![(w[0], w[1], 0)];
                while let Some((a, b, depth)) = stack.pop() {
                    // A contracted side has one image, but what leaves it there turns, the faster
                    // the nearer to base points.
                    let rough = || match self.on_side[side] {
                        None => !self.is_fine(&at, a, b),
                        Some(_) if based.is_empty() => false,
                        Some(_) => {
                            let near = based
                                .iter()
                                .map(|p| (a - p.0).abs().min((b - p.0).abs()))
                                .fold(1.0 / 16.0, f64::min);
                            b - a > near
                                || depth < TURNS
                                    && self.charts[both[0]]
                                        .turns([a, 0.5 * (a + b), b].map(|x| on_side(side, x)))
                        }
                    };
                    let signed =
                        || self.charts[both[0]].keeps_sign([a, b, a].map(|x| on_side(side, x)), 0);
                    if inside
                        && depth < self.halvings
                        && list.len() < VERTICES
                        && !self.control.is_stopped()
                        && (rough() || !signed())
                    {
                        let m = 0.5 * (a + b);
                        stack.extend([(m, b, depth + 1), (a, m, depth + 1)]);
                    } else {
                        list.push((a, inside));
                    }
                }
            }
            list.push((1.0, false));
            out.insert((side, sign), list);
        }
        out
    }

    fn side_is_inside(&self, q: usize, side: usize, x: f64) -> bool {
        let t = &self.region.triangles[q];
        let walls = &t.arrangement.walls;
        if side == 0 {
            let p = (1..walls[0].points.len())
                .filter(|&p| self.place(q, 0, p)[1] < x)
                .count();
            return t.holds_segment(0, p);
        }
        let k = walls[1..walls.len() - 1]
            .iter()
            .filter(|w| w.u.to_f64() < x)
            .count();
        let cells = &t.inside[k];
        if side == 1 {
            cells[0]
        } else {
            cells[cells.len() - 1]
        }
    }

    /// The name of a vertex, that of the image if it is on a contracted curve.
    fn merged(&self, q: usize, node: &Node) -> Name {
        const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [0, 2]];
        let first = |sides: &[usize]| sides.iter().find_map(|&s| self.on_side[s]);
        let image = node.image.or_else(|| match node.name {
            Name::Side(side, ..) => first(&[side]),
            Name::Corner(c) => first(&SIDES[c]),
            _ => None,
        });
        match image {
            Some(k) => Name::Image(k),
            None => self
                .gluing
                .name(&key(node.name, q, node.at))
                .unwrap_or(node.name),
        }
    }
}
