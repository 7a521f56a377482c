//! From the region to triangles: arcs and sides as polylines on the surface, a constrained Delaunay triangulation of each unit triangle,
//! and refinement until every triangle is near the surface and W keeps its sign on it.
//!
//! Between two walls of an arrangement the polylines of arcs have their vertices over the same u, in the order of the arcs: they cannot
//! cross, and what they bound is the region up to isotopy.

mod border;
mod chart;
mod closing;
pub(crate) mod fineness;
mod gluing;
mod in_chart;
mod opening;
mod plane;
mod stretch;
mod strips;

use crate::analysis::Analysis;
use crate::double::Fibres;
use crate::fan::{Direction, Fan, Key};
use crate::field::{Algebraic, vanishes};
use crate::map::Map;
use crate::region::Region;
use crate::singular::{CurveKind, RealPart};
use crate::surface::{Kind, MeshOptions, Point3, Surface};
use chart::Chart;
use closing::finish;
use fineness::Fineness;
use gluing::{Gluing, Track, key};
use in_chart::InChart;
use isoform_algebra::{Arrangement, Poly, QUADRANTS, RBig};
use isoform_geom::{norm, sub};
use plane::{Measure, Plane};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};
use stretch::{Columns, Stretch, height};
use strips::{PathVertex, around, between};

/// A name that both triangles at a side agree on: the sides s = 0, t = 0, w = 0 by the sign of t, s, s t, the place along them as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Name {
    Inner,
    Side(usize, i64, u64),
    Corner(usize),
    /// The image of a contracted curve.
    Image(usize),
    /// On the seam of a base point, in a direction.
    Seam(usize, Key),
    /// On a ray of a base point, in a direction, backward or not: so many vertices after the rectangle.
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
        Self { at, name: Name::Inner, faces, image: None, apex: false, borders: 0 }
    }
}

impl HasPosition for Node {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
}
fn distance(a: Point3, b: Point3) -> f64 {
    norm(sub(a, b))
}

/// Halvings of a contracted curve because what leaves it turns.
const TURNS: usize = 10;
/// Halvings of a stretch of an arc or side: ends with vertical tangents are approached to 2⁻⁴⁰ of the stretch.
const HALVINGS: usize = 40;
/// Halvings, and triangles, where a base point is left open: nothing gets fine enough there, and the result is not certified anyway.
const OPEN_HALVINGS: usize = 12;
const OPEN_TRIANGLES: usize = 100_000;
/// Vertices of a stretch at most: more has one along which the map is not continuous.
const VERTICES: usize = 1 << 14;

/// Triangulates the part of the surface that is in the box. The region is decomposed by `curves`, too. What could not be opened, joined or
/// refined is said to be unproven.
pub(crate) fn mesh(
    map: &Map,
    region: &Region,
    analysis: &Analysis,
    curves: &Curves,
    options: &MeshOptions,
    fineness: &Fineness,
    stop: &dyn Fn() -> bool,
) -> Surface {
    let mut builder = Builder {
        region,
        options,
        fineness,
        stop,
        charts: std::array::from_fn(|q| Chart::new(map, q)),
        half_width: region.half_width.to_f64().value(),
        images: Vec::new(),
        on_curve: BTreeMap::new(),
        on_side: [None; 3],
        double: BTreeSet::new(),
        creased: BTreeSet::new(),
        double_sides: curves.double_sides,
        gluing: Gluing::default(),
        fans: Vec::new(),
        sites: BTreeMap::new(),
        widths: Vec::new(),
        halvings: HALVINGS,
        surface: Surface::default(),
    };
    builder.find_contracted(map, curves);
    if !region.is_clear {
        builder.open_base_points(analysis.base_points.as_deref().unwrap_or_default(), &map.forms()[3]);
    }
    let mut sides = builder.sides();
    if curves.glued {
        builder.gluing = builder.glue(&mut sides, &curves.pinches, &curves.isolated, curves.fibres.as_ref());
    }
    let mut global = BTreeMap::new();
    let mut surface = std::mem::take(&mut builder.surface);
    for q in 0..4 {
        builder.chart(q, &sides, &mut global, &mut surface);
    }
    surface.double_curve = std::mem::take(&mut builder.gluing.arcs);
    surface.unproven.append(&mut builder.gluing.unproven);
    finish(surface, builder.half_width, curves.glued)
}

/// The curves that a region is decomposed by beside those of the box, without the sides of the unit triangles, which are there already.
#[derive(Default)]
pub(crate) struct Curves {
    contracted: Vec<(Poly, Vec<Point3>)>,
    double: Vec<Poly>,
    /// Cuspidal edges.
    creased: Vec<Poly>,
    double_sides: [bool; 3],
    /// Whether sheets that cross are joined.
    glued: bool,
    pinches: Vec<[f64; 3]>,
    /// Isolated real points of singular curves.
    isolated: Vec<[f64; 3]>,
    /// What tells a real parameter alone from one that meets conjugate ones.
    fibres: Option<Fibres>,
}

impl Curves {
    /// Contracted ones; where sheets are joined, double ones and cuspidal edges, too.
    pub(crate) fn new(analysis: &Analysis, glued: bool, pinches: Vec<[f64; 3]>, fibres: Option<Fibres>) -> Self {
        let mut found = Self { glued, pinches, fibres, ..Self::default() };
        let all = analysis.singular.as_ref().map_or(&[][..], |s| &s.curves);
        for c in all {
            let side = (0..3).find(|&k| c.curve.is_associate(&Poly::var(k)));
            if let RealPart::Points(points) = &c.real
                && glued
            {
                // Those of contracted curves have their images anyway.
                let is_contracted =
                    |p: &[Algebraic; 3]| all.iter().any(|c| matches!(c.kind, CurveKind::Contracted(_)) && vanishes(&c.curve, p));
                found.isolated.extend(points.iter().filter(|p| !is_contracted(p)).map(|p| p.each_ref().map(Algebraic::to_f64)));
            }
            match (&c.kind, side) {
                (CurveKind::Contracted(to), None) if !to.at_infinity() => {
                    let images = to.points().iter().map(|p| [0, 1, 2].map(|k| p[k].to_f64() / p[3].to_f64())).collect::<Vec<_>>();
                    if !images.is_empty() {
                        found.contracted.push((c.curve.clone(), images));
                    }
                }
                (CurveKind::Double, side) if glued && matches!(c.real, RealPart::Curve) => match side {
                    Some(k) => found.double_sides[k] = true,
                    None => found.double.push(c.curve.clone()),
                },
                (CurveKind::Ramified, None) if glued && matches!(c.real, RealPart::Curve) => found.creased.push(c.curve.clone()),
                _ => {}
            }
        }
        found
    }
    /// Forms in (s, t, w).
    pub(crate) fn forms(&self) -> Vec<Poly> {
        let contracted = self.contracted.iter().map(|c| &c.0);
        contracted.chain(&self.double).chain(&self.creased).cloned().collect()
    }
}

struct Builder<'a> {
    region: &'a Region,
    options: &'a MeshOptions,
    fineness: &'a Fineness,
    stop: &'a dyn Fn() -> bool,
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
    double_sides: [bool; 3],
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
    /// Slabs and places in them, from the base point to the side of the rectangle; none for a vertical line.
    chain: Vec<(usize, usize)>,
    /// On the side of the rectangle, and halfway.
    end: [f64; 2],
    middle: [f64; 2],
}

impl SiteArc {
    /// The points of walls that it passes within the rectangle.
    fn passed(&self, a: &Arrangement) -> Vec<(usize, usize)> {
        let ends = |&(slab, i): &(usize, usize)| {
            let arc = a.slabs[slab].arcs[i];
            if self.right { (slab + 1, arc.right) } else { (slab, arc.left) }
        };
        self.chain[..self.chain.len().saturating_sub(1)].iter().map(ends).collect()
    }
}

/// A direction of a fan, by its key, and whether it is backward.
type Ray = (Key, bool);

/// Where a point (s : t : w) is in the unit triangle of a quadrant, if it is in it.
fn place_in(quadrant: usize, p: [f64; 3]) -> Option<[f64; 2]> {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    let y = [s * p[0], t * p[1], p[2]];
    let sign = [1.0, -1.0].into_iter().find(|sign| y.iter().all(|y| sign * y >= 0.0))?;
    let sum: f64 = y.iter().map(|y| sign * y).sum();
    Some([sign * y[0] / sum, sign * y[1] / sum])
}

/// (s : t : w) of a point of a unit triangle.
fn in_plane(quadrant: usize, [u, v]: [f64; 2]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * u, t * v, 1.0 - u - v]
}

type Cdt = ConstrainedDelaunayTriangulation<Node>;
/// Places along each side, by side and sign, and whether the stretch after each belongs to the region.
type Sides = BTreeMap<(usize, i64), Vec<(f64, bool)>>;

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
    /// The faces of the box that all curves through a point of a wall belong to.
    fn faces_at(&self, q: usize, wall: usize, point: usize) -> u8 {
        let a = &self.region.triangles[q].arrangement;
        let w = &a.walls[wall];
        let on = [wall == 0, point == 0, point + 1 == w.points.len()];
        let through = |f: usize| {
            w.points[point].curves.contains(&f) || w.vertical.contains(&f) || a.sides[f].iter().zip(on).any(|(side, on)| *side && on)
        };
        (0..self.region.factors.len()).filter(|&f| through(f)).fold(0, |bits, f| bits | self.bits(f))
    }
    /// The faces of the box that a whole side of a unit triangle is sent to.
    fn faces_along(&self, q: usize, side: usize) -> u8 {
        let sides = &self.region.triangles[q].arrangement.sides;
        (0..self.region.factors.len()).filter(|&f| sides[f][side]).fold(0, |bits, f| bits | self.bits(f))
    }
    fn bits(&self, factor: usize) -> u8 {
        self.region.faces[factor].iter().fold(0, |bits, face| bits | 1 << face)
    }
    /// The contracted curve through a point of a wall, by its image.
    fn image_at(&self, q: usize, wall: usize, point: usize) -> Option<usize> {
        let w = &self.region.triangles[q].arrangement.walls[wall];
        let mut factors = w.points[point].curves.iter().chain(&w.vertical);
        factors.find_map(|f| self.nearest_image(q, *f, self.place(q, wall, point)))
    }
    /// The image of a factor that is contracted: the one near to the value of the map at a point of it.
    fn nearest_image(&self, q: usize, factor: usize, at: [f64; 2]) -> Option<usize> {
        let images = self.on_curve.get(&factor)?;
        let p = self.charts[q].at(at);
        let far = |k: &usize| distance(self.images[*k], p);
        images.iter().copied().min_by(|a, b| far(a).total_cmp(&far(b)))
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
    /// The name of a point of a wall.
    fn wall_name(&self, q: usize, wall: usize, point: usize) -> Name {
        let at = self.place(q, wall, point);
        match () {
            () if wall == 0 => self.name_on(q, 0, at[1]),
            () if point == 0 => self.name_on(q, 1, at[0]),
            () if point + 1 == self.region.triangles[q].arrangement.walls[wall].points.len() => self.name_on(q, 2, at[0]),
            () => Name::Inner,
        }
    }

    /// The image of a point of a unit triangle, put on the faces of the box that it is known to be on.
    fn image(&self, q: usize, at: [f64; 2], faces: u8) -> Point3 {
        let mut p = self.charts[q].at(at);
        for face in (0..6).filter(|f| faces >> f & 1 == 1) {
            p[face / 2] = if face % 2 == 0 { -self.half_width } else { self.half_width };
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
        distance(p, q) <= self.options.longest && off.iter().all(|&d| d <= 0.3 * self.tolerance_at(middle(p, q)))
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
            let left = (1..walls[0].points.len() - 1).filter(|&p| t.is_real(0, p)).map(|p| self.place(q, 0, p)[1]);
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
            let both: Vec<usize> = (0..4).filter(|&q| sides_of(q)[side] == (side, sign)).collect();
            let based = self.places_on(side, &both);
            places.extend(based.iter().flat_map(|b| b.1).filter(|x| (0.0..=1.0).contains(x)));
            places.sort_by(f64::total_cmp);
            places.dedup();
            let at = |x: f64| self.charts[both[0]].at(on_side(side, x));
            let mut list = Vec::new();
            for w in places.windows(2) {
                let inside = both.iter().any(|&q| self.side_is_inside(q, side, 0.5 * (w[0] + w[1])));
                if based.iter().any(|b| b.0 == w[0] || b.0 == w[1]) {
                    list.push((w[0], inside));
                    continue;
                }
                let bit = if inside { self.side_bit(both[0], side, w[0], w[1]) } else { 0 };
                if let Some(line) = self.border_line(both[0], bit, on_side(side, w[0]), on_side(side, w[1])) {
                    let place = |at: &[f64; 2]| if side == 0 { at[1] } else { at[0] };
                    list.extend(line[..line.len() - 1].iter().map(|at| (place(at), inside)));
                    continue;
                }
                let mut stack = vec![(w[0], w[1], 0)];
                while let Some((a, b, depth)) = stack.pop() {
                    // A contracted side has one image, but what leaves it there turns, the faster the nearer to base points.
                    let rough = || match self.on_side[side] {
                        None => !self.is_fine(&at, a, b),
                        Some(_) if based.is_empty() => false,
                        Some(_) => {
                            let near = based.iter().map(|p| (a - p.0).abs().min((b - p.0).abs())).fold(1.0 / 16.0, f64::min);
                            b - a > near || depth < TURNS && self.charts[both[0]].turns([a, 0.5 * (a + b), b].map(|x| on_side(side, x)))
                        }
                    };
                    let signed = || self.charts[both[0]].keeps_sign([a, b, a].map(|x| on_side(side, x)), 0);
                    if inside && depth < self.halvings && list.len() < VERTICES && !(self.stop)() && (rough() || !signed()) {
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
            let p = (1..walls[0].points.len()).filter(|&p| self.place(q, 0, p)[1] < x).count();
            return t.holds_segment(0, p);
        }
        let k = walls[1..walls.len() - 1].iter().filter(|w| w.u.to_f64() < x).count();
        let cells = &t.inside[k];
        if side == 1 { cells[0] } else { cells[cells.len() - 1] }
    }

    /// One unit triangle: its vertices and triangles are added to the surface.
    fn chart(&self, q: usize, sides: &Sides, global: &mut BTreeMap<(Name, usize, usize), u32>, surface: &mut Surface) {
        if !self.region.triangles[q].inside.iter().flatten().any(|inside| *inside) {
            return;
        }
        let mut cdt = Cdt::new();
        let mut constraints: Vec<[spade::handles::FixedVertexHandle; 2]> = Vec::new();
        let keys = sides_of(q);
        let name_on = |side: usize, x: f64| self.name_on(q, side, x);
        let mut on_sides = BTreeMap::new();
        for (side, key) in keys.iter().enumerate() {
            let mut before = None;
            let mut last = (0, 0);
            for (i, &(x, inside)) in sides[key].iter().enumerate() {
                let next = if inside { (self.faces_along(q, side), self.side_bit(q, side, x, sides[key][i + 1].0)) } else { (0, 0) };
                let Ok(v) = cdt.insert(Node { name: name_on(side, x), ..Node::inner(on_side(side, x), 0) }) else { continue };
                // Corners belong to two sides.
                let all = on_sides.entry(v.index()).or_insert((0u8, 0u64));
                *all = (all.0 | last.0 | next.0, all.1 | last.1 | next.1);
                let node = cdt.vertex_data_mut(v);
                (node.faces, node.borders) = *all;
                last = next;
                if let Some(b) = before {
                    constraints.push([b, v]);
                }
                before = inside.then_some(v);
            }
        }
        // Points of walls in the region, with the faces that they are on; those on sides are there already.
        let t = &self.region.triangles[q];
        let walls = &t.arrangement.walls;
        let mut at_wall = BTreeMap::new();
        let here = || self.sites.range((q, 0, 0)..(q + 1, 0, 0)).map(|s| s.1);
        let passed: Vec<(usize, usize)> = here().flat_map(|s| &s.arcs).flat_map(|x| x.passed(&t.arrangement)).collect();
        for (k, wall) in walls.iter().enumerate() {
            let top = wall.points.len() - 1;
            for p in 0..=top {
                if !t.holds_point(k, p) || passed.contains(&(k, p)) {
                    continue;
                }
                let at = self.place(q, k, p);
                let name = self.wall_name(q, k, p);
                let faces = self.faces_at(q, k, p);
                let apex = faces == 0b11_1111;
                if (k == 0 || p == 0 || p == top) && !t.is_real(k, p) && !apex {
                    continue;
                }
                let borders = self.region.sides_of_point(q, k, p);
                let node = Node { at, name, faces, image: if apex { None } else { self.image_at(q, k, p) }, apex, borders };
                // The line of a side goes on inside.
                let is_line = |f: &usize| self.region.lines.get(*f).is_none_or(|l| *l != 0 && !self.is_drawn_inside(*f));
                if borders == 0 && faces == 0 && wall.points[p].curves.iter().chain(&wall.vertical).all(is_line) {
                    continue;
                }
                if let Ok(v) = cdt.insert(node) {
                    at_wall.insert((k, p), v);
                }
            }
        }
        // Base points with the rectangles around them.
        let mut rays: BTreeMap<(usize, usize), Ray> = BTreeMap::new();
        let mut apexes: BTreeMap<usize, usize> = BTreeMap::new();
        for (&(_, k, p), site) in self.sites.range((q, 0, 0)..(q + 1, 0, 0)) {
            let Some(&apex) = at_wall.get(&(k, p)) else { continue };
            apexes.insert(apex.index(), site.fan);
            let fan = &self.fans[site.fan];
            for sector in fan.sectors.iter().filter(|s| s.inside) {
                let Some(ends) = self.sector_ends(q, site, fan, sector) else { continue };
                let mut insert = |at: [f64; 2], ray: Ray| {
                    let name = match () {
                        () if at[0] == 0.0 => name_on(0, at[1]),
                        () if at[1] == 0.0 => name_on(1, at[0]),
                        () if at[1] == 1.0 - at[0] && site.at[0] + site.at[1] == 1.0 => name_on(2, at[0]),
                        () => Name::Inner,
                    };
                    let arc = site.arcs.iter().find(|x| x.ray == ray && x.end == at);
                    let faces = arc.map_or(0, |x| self.bits(x.curve));
                    let image = arc.and_then(|x| self.nearest_image(q, x.curve, at));
                    let v = cdt.insert(Node { name, image, ..Node::inner(at, faces) }).ok()?;
                    rays.insert((v.index(), site.fan), ray);
                    Some(v)
                };
                for (k, backward) in sector.rays {
                    let d = &fan.directions[k];
                    let same: Vec<_> = self.ring(q, site, d, backward).into_iter().map(|at| insert(at, (d.key(), backward))).collect();
                    for w in same.windows(2) {
                        if let [Some(a), Some(b)] = *w {
                            constraints.extend([[apex, a], [apex, b], [a, b]]);
                        }
                    }
                }
                let ends =
                    [(0, ends[0]), (1, ends[1])].map(|(i, at)| insert(at, (fan.directions[sector.rays[i].0].key(), sector.rays[i].1)));
                if let [Some(a), Some(b)] = ends {
                    constraints.extend([[apex, a], [apex, b], [a, b]]);
                }
            }
        }
        let mut lines: Vec<Vec<(usize, Vec<[f64; 2]>)>> = Vec::new();
        let mut in_order = true;
        for k in 0..t.arrangement.slabs.len() {
            let drawn = self.drawn(q, k);
            let mut over = Columns::new(&t.arrangement, k);
            let mut here_lines = Vec::new();
            for i in drawn {
                let arc = t.arrangement.slabs[k].arcs[i];
                let (faces, borders) = (self.bits(arc.curve), self.region.side_of_arc(q, k, i));
                let stretch = self.stretch(q, k, i);
                let line = match self.gluing.line(Track::Arc(q, k, i)) {
                    Some(line) => line.clone(),
                    None => self.polyline(q, &stretch, i, &mut over, &mut in_order),
                };
                if stretch.is_open() {
                    // From a vertex of a rectangle, or a point of a wall, to the next.
                    let ends = [(0, at_wall.get(&(k, arc.left))), (line.len() - 1, at_wall.get(&(k + 1, arc.right)))];
                    let vertex = |(at, known): (usize, Option<&spade::handles::FixedVertexHandle>), based: bool, cdt: &mut Cdt| {
                        if based {
                            let image = self.nearest_image(q, arc.curve, line[at]);
                            cdt.insert(Node { image, borders, ..Node::inner(line[at], faces) }).ok()
                        } else {
                            known.copied()
                        }
                    };
                    let mut before = vertex(ends[0], stretch.based[0], &mut cdt);
                    let last = vertex(ends[1], stretch.based[1], &mut cdt);
                    for &at in &line[1..line.len() - 1] {
                        let image = self.nearest_image(q, arc.curve, at);
                        let Ok(v) = cdt.insert(Node { image, borders, ..Node::inner(at, faces) }) else { continue };
                        constraints.extend(before.map(|b| [b, v]));
                        before = Some(v);
                    }
                    constraints.extend(before.zip(last).map(|(a, b)| [a, b]));
                }
                here_lines.push((i, stretch.whole(line)));
            }
            lines.push(here_lines);
        }
        for k in 0..walls.len() {
            self.vertical(q, k, &mut |node| cdt.insert(node).ok(), &at_wall, &mut constraints);
        }
        let mut crossing = false;
        for [a, b] in constraints {
            if a != b && cdt.can_add_constraint(a, b) {
                cdt.add_constraint(a, b);
            } else {
                crossing |= a != b;
            }
        }
        if crossing || !in_order {
            surface
                .unproven
                .push("arcs of the region's boundary are closer together than rounding, or could not be drawn to the end".into());
        }
        let us: Vec<f64> = walls.iter().map(|w| w.u.to_f64()).collect();
        let inside = |at: [f64; 2]| {
            let k = us[1..us.len() - 1].partition_point(|&u| u < at[0]);
            let below = lines[k].iter().rev().find(|(_, line)| height(line, at[0]) < at[1]).map(|l| l.0);
            t.inside[k][below.unwrap_or(0)]
        };
        for at in self.gluing.points(q) {
            let _ = cdt.insert(Node::inner(at, 0));
        }
        let mut handles: BTreeMap<[u64; 2], _> = cdt.vertices().map(|v| (v.data().at.map(f64::to_bits), v.fix())).collect();
        let rings = self.rings_around(q);
        for (at, _) in &rings {
            let place = at.map(f64::to_bits);
            if inside(*at) && !handles.contains_key(&place) {
                handles.extend(cdt.insert(Node::inner(*at, 0)).ok().map(|v| (place, v)));
            }
        }
        let fixed: BTreeSet<(u32, u32)> = cdt
            .undirected_edges()
            .filter(|e| e.is_constraint_edge())
            .map(|e| e.vertices().map(|v| v.index() as u32))
            .flat_map(|[a, b]| [(a, b), (b, a)])
            .collect();
        // Edges that are there at the beginning only.
        for (at, legs) in &rings {
            for leg in legs {
                let [a, b] = [at, leg].map(|x| handles.get(&x.map(f64::to_bits)).copied());
                if let Some((a, b)) = a.zip(b).filter(|(a, b)| a != b && cdt.can_add_constraint(*a, *b)) {
                    cdt.add_constraint(a, b);
                }
            }
        }
        let nodes: Vec<Node> = cdt.vertices().map(|v| *v.data()).collect();
        let (mut plain, mut at_apex) = (Vec::new(), Vec::new());
        for face in cdt.inner_faces() {
            let v = face.vertices();
            if is_sliver(v.map(|v| *v.data())) || !inside(center(v.map(|v| v.data().at))) {
                continue;
            }
            let t = v.map(|v| v.index() as u32);
            match (0..3).find(|&i| v[i].data().apex) {
                Some(i) => at_apex.push([0, 1, 2].map(|k| t[(i + k) % 3])),
                None => plain.push(t),
            }
        }
        let measure = InChart { builder: self, q };
        let rim: Vec<[u32; 2]> = at_apex.iter().map(|&[_, a, b]| [a, b]).collect();
        let mut plane = Plane::new(nodes, plain, &|a, b| fixed.contains(&(a, b)), &rim, &measure);
        let most = if self.halvings < HALVINGS { self.options.triangles.min(OPEN_TRIANGLES) } else { self.options.triangles };
        let room = most.saturating_sub(surface.triangles.len());
        let ended = plane.refine(room, &measure, self.stop);
        if ended.unsound > 0 {
            surface.unproven.push("W is not proved to keep its sign on every triangle".into());
        }
        if ended.clashes > 0 {
            surface.unproven.push("edges fall together next to double or contracted curves".into());
        }
        if ended.coarse > 0 {
            surface.unproven.push("the triangles are not everywhere as near to the surface as asked for".into());
        }
        let mut vertex = |k: u32| {
            let node = &plane.nodes[k as usize];
            let key = match self.merged(q, node) {
                Name::Inner => (Name::Inner, q, k as usize),
                name => (name, 0, 0),
            };
            *global.entry(key).or_insert_with(|| {
                let kind = match key.0 {
                    Name::Image(_) => Kind::Contracted,
                    _ if node.faces > 0 => Kind::Box,
                    Name::Double(_) => Kind::Double,
                    _ if node.borders > 0 => Kind::Border,
                    _ => Kind::Ordinary,
                };
                surface.points.push(measure.image(node));
                surface.faces.push(node.faces);
                surface.double.push(matches!(key.0, Name::Double(_)));
                surface.kinds.push(kind);
                surface.points.len() as u32 - 1
            })
        };
        let mut made: Vec<Made> = Vec::new();
        for t in &plane.triangles {
            let nodes = t.map(|v| &plane.nodes[v as usize]);
            made.push((t.map(&mut vertex), nodes.map(|n| n.at), nodes.map(|n| n.borders)));
        }
        let mut opened = Vec::new();
        for [p, a, b] in at_apex {
            let Some(&fan) = apexes.get(&(p as usize)) else { continue };
            let ray = |v: u32| rays.get(&(v as usize, fan)).copied();
            let way: Vec<(u32, [f64; 2])> = plane.way([a, b]).into_iter().map(|v| (vertex(v), plane.nodes[v as usize].at)).collect();
            opened.push(([vertex(a), vertex(b)], way, [p, a, b], ray(a).zip(ray(b)), fan));
        }
        for ([from, to], way, corners, directions, fan) in opened {
            let Some((first, second)) = directions else {
                surface.unproven.push("triangles at base points are left out".to_owned());
                continue;
            };
            let [p, a, b] = corners.map(|v| plane.nodes[v as usize].at);
            let double = |surface: &mut Surface, global: &mut BTreeMap<_, _>, class: usize| {
                add(surface, global, Name::Double(class), (self.gluing.image(class), 0), Kind::Double)
            };
            let sector = self.fans[fan].sector_between(first, second);
            // From the rectangle to the seam, with what lies between on a double curve.
            let seam_end = |surface: &mut Surface, global: &mut BTreeMap<_, _>, d: &Direction, at: [f64; 2]| {
                let (name, point, faces) = self.seam_vertex(fan, d);
                let name = self.gluing.name(&key(name, 0, at)).unwrap_or(name);
                let kind = match (name, faces) {
                    (Name::Image(_), _) => Kind::Contracted,
                    (_, 1..) => Kind::Box,
                    (Name::Double(_), _) => Kind::Double,
                    _ => Kind::Seam,
                };
                let point = match name {
                    Name::Image(k) => self.images[k],
                    Name::Double(k) => self.gluing.image(k),
                    _ => point,
                };
                (add(surface, global, name, (point, faces), kind), p)
            };
            let [mut first, second] = [(first, a, from), (second, b, to)].map(|(ray, at, vertex)| {
                let mut path = vec![(vertex, at)];
                path.extend(self.gluing.spoke(fan, ray, at).iter().map(|&(class, at)| (double(surface, global, class), at)));
                let d = self.fans[fan].directions.iter().find(|d| d.key() == ray.0).expect("a direction of the fan");
                let site = self.sites.range((q, 0, 0)..(q + 1, 0, 0)).map(|s| s.1).find(|s| s.fan == fan);
                let faces = surface.faces[vertex as usize];
                if path.len() == 1 && surface.kinds[vertex as usize] != Kind::Contracted {
                    let on_ray = site.map_or_else(Vec::new, |s| self.points_on_ray(q, s, &self.fans[fan], d, ray.1, at));
                    let kind = if faces > 0 { Kind::Box } else { Kind::Ordinary };
                    path.extend(
                        on_ray.into_iter().enumerate().map(|(k, x)| (add(surface, global, Name::Ray(fan, ray, k), (x, faces), kind), p)),
                    );
                }
                path.push(seam_end(surface, global, d, at));
                path
            });
            // From one seam to another one.
            if let Some(corner) = sector.and_then(|s| s.corner.as_ref()) {
                first.push(seam_end(surface, global, corner, p));
            }
            // What lies between two rays need not lie in the straight triangle: then the strip has no parameters but those of the base point.
            let is_straight = !self.fans[fan].is_tree() || self.charts[q].keeps_sign([p, a, b], self.fans[fan].multiplicity);
            let folds = |ray: Ray| self.fans[fan].directions.iter().any(|d| d.key() == ray.0 && self.fans[fan].is_fold(d));
            let first_is_double = surface.double[first[0].0 as usize] || directions.is_some_and(|d| folds(d.0));
            // A strip between both, from the rectangle on.
            let is_even = !self.fans[fan].is_tree();
            let (mut i, mut j) = (0, 0);
            let mut push = |t: [PathVertex; 3]| made.push((t.map(|t| t.0), t.map(|t| if is_straight { t.1 } else { p }), [0; 3]));
            if !way.is_empty() {
                // Those on the way that bounds the triangles outside have no other edges to vertices that are shared.
                for t in around(&surface.points, first[1], &[&first[..1], &way, &second[..1]].concat(), second[1]) {
                    push(t);
                }
                (i, j) = (1, 1);
            }
            if is_even {
                while i + 1 < first.len() || j + 1 < second.len() {
                    // Edges from the seam's end of a double curve to the rectangle: the other diagonals would be there twice where the curve is folded.
                    let on_second = i + 1 == first.len() || (j + 1 < second.len() && !first_is_double);
                    push([first[i], second[j], if on_second { second[j + 1] } else { first[i + 1] }]);
                    if on_second { j += 1 } else { i += 1 }
                }
            } else {
                between(&surface.points, &first[i..], &second[j..]).into_iter().for_each(push);
            }
        }
        for (triangle, corners, borders) in made {
            surface.borders.push(borders);
            surface.triangles.push(triangle);
            surface.charts.push(q as u8);
            surface.corners.push(corners);
        }
    }

    /// The curve that is drawn on a wall between a point and the next, if one is.
    fn drawn_on(&self, q: usize, wall: usize, point: usize) -> Option<usize> {
        let t = &self.region.triangles[q];
        let w = &t.arrangement.walls[wall];
        if wall == 0 || wall + 1 == t.arrangement.walls.len() || point + 1 >= w.points.len() {
            return None;
        }
        let is_curve = |f: &&usize| self.is_drawn_inside(**f);
        match t.sides_held(wall, point) {
            [false, false] => None,
            [true, true] => w.vertical.iter().find(is_curve).copied(),
            _ => w.vertical.first().copied(),
        }
    }

    /// A drawn stretch of a wall after a point, from rectangle to rectangle around base points, and its vertices.
    fn upright(&self, q: usize, wall: usize, point: usize) -> (Stretch, Vec<[f64; 2]>) {
        let mut ends = [point, point + 1].map(|p| self.place(q, wall, p));
        let mut rays = [None; 2];
        for (k, end) in ends.iter_mut().enumerate() {
            if let Some(site) = self.sites.get(&(q, wall, point + k)) {
                let arc = site.arcs.iter().find(|x| x.chain.is_empty() && x.right == (k == 0));
                rays[k] = arc.map(|x| (site.fan, x.ray, site.at));
                *end = arc.map_or(*end, |x| x.end);
            }
        }
        let [a, b] = ends;
        let is_contracted = self.drawn_on(q, wall, point).is_some_and(|f| self.on_curve.contains_key(&f));
        let based = rays.map(|r| r.is_some());
        let stretch = Stretch { before: vec![], from: a, to: b, after: vec![], based, rays };
        if let Some(line) = self.border_line(q, self.region.side_of_wall(q, wall, point), a, b) {
            return (stretch, line.into_iter().map(|at| [a[0], at[1]]).collect());
        }
        let mut line = vec![a];
        let mut stack = vec![(a[1], b[1], 0)];
        while let Some((x, y, depth)) = stack.pop() {
            let at = |v: f64| self.charts[q].at([a[0], v]);
            let m = 0.5 * (x + y);
            let turns = || is_contracted && depth < TURNS && self.charts[q].turns([x, m, y].map(|v| [a[0], v]));
            if depth < self.halvings && line.len() < VERTICES && !(self.stop)() && (!self.is_fine(&at, x, y) || turns()) {
                stack.extend([(m, y, depth + 1), (x, m, depth + 1)]);
            } else {
                line.push([a[0], y]);
            }
        }
        (stretch, line)
    }

    /// Stretches of walls that are drawn.
    fn vertical(
        &self,
        q: usize,
        wall: usize,
        insert: &mut dyn FnMut(Node) -> Option<spade::handles::FixedVertexHandle>,
        at_wall: &BTreeMap<(usize, usize), spade::handles::FixedVertexHandle>,
        constraints: &mut Vec<[spade::handles::FixedVertexHandle; 2]>,
    ) {
        for p in 0..self.region.triangles[q].arrangement.walls[wall].points.len() - 1 {
            let Some(curve) = self.drawn_on(q, wall, p) else { continue };
            let (faces, borders) = (self.bits(curve), self.region.side_of_wall(q, wall, p));
            let (stretch, mut line) = self.upright(q, wall, p);
            if let Some(known) = self.gluing.line(Track::Wall(q, wall, p)) {
                line.clone_from(known);
            }
            let last = line.len() - 1;
            let mut before = None;
            for (i, &at) in line.iter().enumerate() {
                // From points of the wall, or from the rectangles around base points.
                let known = match i {
                    0 if !stretch.based[0] => at_wall.get(&(wall, p)).copied(),
                    i if i == last && !stretch.based[1] => at_wall.get(&(wall, p + 1)).copied(),
                    _ => insert(Node { image: self.nearest_image(q, curve, at), borders, ..Node::inner(at, faces) }),
                };
                let Some(next) = known else { continue };
                constraints.extend(before.map(|b| [b, next]));
                before = Some(next);
            }
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
            None => self.gluing.name(&key(node.name, q, node.at)).unwrap_or(node.name),
        }
    }

    fn is_drawn_inside(&self, factor: usize) -> bool {
        self.on_curve.contains_key(&factor) || self.double.contains(&factor) || self.creased.contains(&factor)
    }
    /// The arcs of a slab that are drawn: those that have the region on one side, or on both and are contracted, double or cuspidal.
    fn drawn(&self, q: usize, slab: usize) -> Vec<usize> {
        let t = &self.region.triangles[q];
        let inside = &t.inside[slab];
        let is_curve = |i: usize| self.is_drawn_inside(t.arrangement.slabs[slab].arcs[i].curve);
        (1..inside.len()).filter(|&i| inside[i - 1] != inside[i] || inside[i] && is_curve(i)).collect()
    }
}

/// A triangle: its vertices, their parameters, the sides of the domain that they are on.
type Made = ([u32; 3], [[f64; 2]; 3], [u64; 3]);

/// The vertex of a name that all unit triangles share.
fn add(
    surface: &mut Surface,
    global: &mut BTreeMap<(Name, usize, usize), u32>,
    name: Name,
    (point, faces): (Point3, u8),
    kind: Kind,
) -> u32 {
    *global.entry((name, 0, 0)).or_insert_with(|| {
        surface.points.push(point);
        surface.faces.push(faces);
        surface.double.push(matches!(name, Name::Double(_)));
        surface.kinds.push(kind);
        surface.points.len() as u32 - 1
    })
}

/// Whether a triangle, counterclockwise, lies beyond the side u + v = 1, whose points are on that line but for rounding.
fn is_sliver(nodes: [Node; 3]) -> bool {
    let on_line = |n: &Node| matches!(n.name, Name::Side(2, ..) | Name::Corner(1 | 2));
    nodes.iter().all(on_line) && {
        let first = (0..3).min_by(|&i, &j| nodes[i].at[0].total_cmp(&nodes[j].at[0])).unwrap_or(0);
        nodes[(first + 1) % 3].at[0] < nodes[(first + 2) % 3].at[0]
    }
}

fn center(at: [[f64; 2]; 3]) -> [f64; 2] {
    [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0)
}
