//! From the region to triangles: arcs and sides as polylines on the surface, a constrained Delaunay
//! triangulation of each unit triangle, and refinement until every triangle is near the surface and
//! W keeps its sign on it.
//!
//! Between two walls of an arrangement the polylines of arcs have their vertices over the same u,
//! in the order of the arcs: they cannot cross, and what they bound is the region up to isotopy.

mod atlas;
mod border;
mod chart;
mod closing;
mod contraction;
mod curves;
mod drawing;
pub(crate) mod fineness;
mod folds;
mod geometry;
mod gluing;
mod in_chart;
pub(crate) mod matching;
mod names;
mod opening;
mod places;
mod plane;
mod stretch;
mod strips;
pub(crate) mod traced;
mod unit;

use crate::analysis::Analysis;
use crate::claim::{Claim, Grade};
use crate::fan::{Direction, Fan};
use crate::finding::Finding;
use crate::map::Map;
use crate::region::Region;
use crate::surface::{Kind, MeshOptions, Point3, Surface};
use atlas::Atlas;
use closing::finish;
pub(crate) use curves::Curves;
use fineness::Fineness;
use geometry::{distance, longest, middle};
use gluing::{Gluing, Track};
use isoform_algebra::Arrangement;
use isoform_control::Control;
use matching::Place;
use names::{Name, Node, Ray, key, name_on};
use places::{in_plane, on_side, place_in, sides_of};
use rayon::iter::{
    IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator,
};
use std::collections::{BTreeMap, BTreeSet};
use unit::{Joined, Unit};

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
    let atlas = Atlas::new(map, region, options, &changes.fineness, control);
    let mut builder = Builder {
        atlas: &atlas,
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
    let tolerance = |p: Point3| atlas.tolerance_at(p);
    let mut surface = finish(surface, atlas.half_width, curves.glued, &tolerance);
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

struct Builder<'a> {
    atlas: &'a Atlas<'a>,
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
    /// The contracted curve through a point of a wall, by its image.
    fn image_at(&self, q: usize, wall: usize, point: usize) -> Option<usize> {
        let w = &self.atlas.region.triangles[q].arrangement.walls[wall];
        let mut factors = w.points[point].curves.iter().chain(&w.vertical);
        factors.find_map(|f| self.nearest_image(q, *f, self.atlas.place(q, wall, point)))
    }
    /// The image of a factor that is contracted: the one near to the value of the map at a point of
    /// it.
    fn nearest_image(&self, q: usize, factor: usize, at: [f64; 2]) -> Option<usize> {
        let images = self.on_curve.get(&factor)?;
        let p = self.atlas.charts[q].at(at);
        let far = |k: &usize| distance(self.images[*k], p);
        images
            .iter()
            .copied()
            .min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    /// Places along the sides that both triangles use.
    fn sides(&self) -> Sides {
        let mut sides: BTreeMap<(usize, i64), Vec<f64>> = BTreeMap::new();
        for q in 0..4 {
            let t = &self.atlas.region.triangles[q];
            let walls = &t.arrangement.walls;
            let keys = sides_of(q);
            for key in keys {
                sides.entry(key).or_default();
            }
            let left = (1..walls[0].points.len() - 1)
                .filter(|&p| t.is_real(0, p))
                .map(|p| self.atlas.place(q, 0, p)[1]);
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
            let at = |x: f64| self.atlas.charts[both[0]].at(on_side(side, x));
            let mut list = Vec::new();
            for w in places.windows(2) {
                let inside = both
                    .iter()
                    .any(|&q| self.atlas.side_is_inside(q, side, 0.5 * (w[0] + w[1])));
                if based.iter().any(|b| b.0 == w[0] || b.0 == w[1]) {
                    list.push((w[0], inside));
                    continue;
                }
                let bit = if inside {
                    self.atlas.side_bit(both[0], side, w[0], w[1])
                } else {
                    0
                };
                if let Some(line) = self.atlas.border_line(
                    both[0],
                    bit,
                    [w[0], w[1]].map(|x| on_side(side, x)),
                    self.halvings,
                ) {
                    let place = |at: &[f64; 2]| if side == 0 { at[1] } else { at[0] };
                    list.extend(line[..line.len() - 1].iter().map(|at| (place(at), inside)));
                    continue;
                }
                let mut stack = vec![(w[0], w[1], 0)];
                while let Some((a, b, depth)) = stack.pop() {
                    // A contracted side has one image, but what leaves it there turns, the faster
                    // the nearer to base points.
                    let rough = || match self.on_side[side] {
                        None => !self.atlas.is_fine(&at, a, b),
                        Some(_) if based.is_empty() => false,
                        Some(_) => {
                            let near = based
                                .iter()
                                .map(|p| (a - p.0).abs().min((b - p.0).abs()))
                                .fold(1.0 / 16.0, f64::min);
                            b - a > near
                                || depth < TURNS
                                    && self.atlas.charts[both[0]]
                                        .turns([a, 0.5 * (a + b), b].map(|x| on_side(side, x)))
                        }
                    };
                    let signed = || {
                        self.atlas.charts[both[0]]
                            .keeps_sign([a, b, a].map(|x| on_side(side, x)), 0)
                    };
                    if inside
                        && depth < self.halvings
                        && list.len() < VERTICES
                        && !self.atlas.control.is_stopped()
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
