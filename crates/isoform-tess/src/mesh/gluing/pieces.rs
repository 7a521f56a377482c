//! Pieces of the double curve, with the vertices on them.

use super::Track;
use crate::fan::Direction;
use crate::mesh::geometry::distance;
use crate::mesh::names::{ClassId, Key, Name, Ray, key, name_on};
use crate::mesh::opening::{ALL_FACES, Openings};
use crate::mesh::places::{distance2, in_plane, on_side, place_in};
use crate::mesh::sides::{SideId, Sides, quadrants_at};
use crate::mesh::stretch::{Columns, Stretch};
use crate::surface::Point3;
use isoform_algebra::Wall;

/// Vertex on a piece of the double curve.
#[derive(Clone, Debug)]
pub(super) struct PieceVertex {
    pub(super) at: [f64; 2],
    /// Parameter (s : t : w); for a vertex on a seam, the base point.
    pub(super) parameter: [f64; 3],
    pub(super) key: Key,
    pub(super) image: Point3,
    /// True if the vertex may not be moved.
    pub(super) fixed: bool,
    pub(super) class: Option<ClassId>,
}

/// Piece of the double curve in one unit triangle.
pub(super) struct CurvePiece {
    pub(super) track: Track,
    pub(super) q: usize,
    pub(super) knots: Vec<PieceVertex>,
    /// Rays of base points in which the piece begins and ends.
    pub(super) rays: [Option<(usize, Ray)>; 2],
}

impl CurvePiece {
    pub(super) fn is_seam(&self) -> bool {
        matches!(self.track, Track::Seam(..))
    }
    /// Returns the index of the vertex that ends the segment over a coordinate of the piece, and
    /// the point of the segment there.
    fn place_over(&self, x: f64) -> Option<(usize, [f64; 2])> {
        let knot = |j: usize| self.knots[j].at;
        let is_over = |&j: &usize| self.along(knot(j - 1)) <= x && x <= self.along(knot(j));
        let j = (1..self.knots.len()).find(is_over)?;
        let (a, b) = (knot(j - 1), knot(j));
        let t = (x - self.along(a)) / (self.along(b) - self.along(a));
        Some((j, [0, 1].map(|i| a[i] + t * (b[i] - a[i]))))
    }
    /// Returns the coordinate of a point along the piece.
    pub(super) fn along(&self, at: [f64; 2]) -> f64 {
        match self.track {
            Track::Wall(..) | Track::Side(0, ..) => at[1],
            _ => at[0],
        }
    }
    /// Returns the name of a vertex on the piece.
    pub(super) fn name(&self, at: [f64; 2]) -> Name {
        match self.track {
            Track::Side(side, ..) => name_on(self.q, side, self.along(at)),
            _ => Name::Inner,
        }
    }
    /// Moves a place exactly onto the side or wall on which the piece lies.
    pub(super) fn onto(&self, at: [f64; 2]) -> [f64; 2] {
        match self.track {
            Track::Side(side, ..) => on_side(side, self.along(at)),
            Track::Wall(..) => [self.knots[0].at[0], at[1]],
            Track::Arc(..) | Track::Seam(..) => at,
        }
    }
}

/// Pieces of the double curve and of the border of a fundamental domain.
pub(super) struct CurvePieces<'a> {
    pub(super) open: &'a Openings<'a>,
    pub(super) pieces: Vec<CurvePiece>,
}

impl<'a> CurvePieces<'a> {
    pub(super) fn new(open: &'a Openings<'a>, sides: &Sides) -> Self {
        let mut pieces = Vec::new();
        for q in 0..4 {
            let a = &open.atlas.region.triangles[q].arrangement;
            for slab in 0..a.slabs.len() {
                open.arc_pieces(q, slab, &mut pieces);
            }
            for wall in 1..a.walls.len() - 1 {
                open.wall_pieces(q, wall, &mut pieces);
            }
        }
        // A contracted curve is a single vertex.
        let curves = open.curves;
        let is_double = |side: usize| curves.double_sides[side] && curves.on_side[side].is_none();
        for (&id, places) in sides.iter().filter(|s| is_double(s.0.0)) {
            open.side_pieces(id, places, &mut pieces);
        }
        // Deck transformations map such a seam to itself, and the fundamental domain has one of the
        // two points.
        let has_deck = open.atlas.region.deck.is_some();
        let is_used = |f: &usize| !has_deck && open.sites.values().any(|s| s.fan == *f);
        for fan in (0..open.fans.len()).filter(is_used) {
            open.seam_pieces(fan, &mut pieces);
        }
        Self { open, pieces }
    }

    /// Makes the pinch points vertices of their pieces.
    pub(super) fn add_pinches(&mut self, pinches: &[[f64; 3]]) {
        for &p in pinches {
            for piece in self.pieces.iter_mut().filter(|p| !p.is_seam()) {
                if let Some(at) = place_in(piece.q, p) {
                    self.open.add_pinch(piece, at);
                }
            }
        }
    }
}

impl Openings<'_> {
    pub(super) fn knot(
        &self,
        q: usize,
        at: [f64; 2],
        name: Name,
        faces: u8,
        fixed: bool,
    ) -> PieceVertex {
        PieceVertex {
            at,
            parameter: in_plane(q, at),
            key: key(name, q, at),
            image: self.atlas.image(q, at, faces),
            fixed,
            class: None,
        }
    }
    /// Returns the vertex of a seam in a direction.
    fn seam_knot(&self, at: [f64; 2], fan: usize, d: &Direction) -> PieceVertex {
        let (name, image, _) = self.seam_vertex(fan, d);
        PieceVertex {
            at,
            parameter: self.fans[fan].point,
            key: key(name, 0, at),
            image,
            fixed: true,
            class: None,
        }
    }
    /// Returns the vertex of a seam in which a ray ends.
    fn ray_knot(&self, at: [f64; 2], fan: usize, ray: Ray) -> Option<PieceVertex> {
        let mut directions = self.fans[fan].directions.iter();
        let d = directions.find(|d| d.key() == ray.0)?;
        Some(self.seam_knot(at, fan, d))
    }

    /// Adds the arcs over a slab that have partners.
    fn arc_pieces(&self, q: usize, slab: usize, pieces: &mut Vec<CurvePiece>) {
        let a = &self.atlas.region.triangles[q].arrangement;
        let mut over = Columns::new(a, slab);
        for i in self.curves.drawn(q, slab) {
            let arc = a.slabs[slab].arcs[i];
            let stretch = self.stretch(q, slab, i);
            if self.curves.has_partners(arc.curve) && stretch.is_open() {
                let line = self.polyline(q, &stretch, i, &mut over, &mut true);
                let ends = [(slab, arc.left), (slab + 1, arc.right)];
                pieces.push(self.piece(Track::Arc(q, slab, i), q, &line, &stretch, ends));
            }
        }
    }
    /// Adds the segments of a wall that have partners.
    fn wall_pieces(&self, q: usize, wall: usize, pieces: &mut Vec<CurvePiece>) {
        let points = &self.atlas.region.triangles[q].arrangement.walls[wall].points;
        for p in 0..points.len() - 1 {
            let curve = self.curves.drawn_on(q, wall, p);
            if curve.is_some_and(|f| self.curves.has_partners(f)) {
                let (stretch, line) = self.upright(q, wall, p);
                let ends = [(wall, p), (wall, p + 1)];
                pieces.push(self.piece(Track::Wall(q, wall, p), q, &line, &stretch, ends));
            }
        }
    }
    /// Returns the piece of a polyline between two points of walls, or between the rectangles
    /// around them.
    fn piece(
        &self,
        track: Track,
        q: usize,
        line: &[[f64; 2]],
        stretch: &Stretch,
        ends: [(usize, usize); 2],
    ) -> CurvePiece {
        let last = line.len() - 1;
        let on_wall = |at: [f64; 2], (wall, point): (usize, usize)| {
            let name = self.atlas.wall_name(q, wall, point);
            let faces = self.atlas.faces_at(q, wall, point);
            self.knot(q, at, name, faces, true)
        };
        let knot = |(k, &at): (usize, &[f64; 2])| {
            let end = match k {
                0 => 0,
                _ if k == last => 1,
                _ => return self.knot(q, at, Name::Inner, 0, false),
            };
            match stretch.based[end] {
                true => self.knot(q, at, Name::Inner, 0, true),
                false => on_wall(at, ends[end]),
            }
        };
        let seam = |k: usize| {
            let (fan, ray, at) = stretch.rays[k]?;
            self.ray_knot(at, fan, ray)
        };
        let inner = line.iter().enumerate().map(knot);
        let knots = seam(0).into_iter().chain(inner).chain(seam(1)).collect();
        CurvePiece {
            track,
            q,
            knots,
            rays: stretch.rays.map(|r| r.map(|(fan, ray, _)| (fan, ray))),
        }
    }

    /// Returns the pieces, in the box, of seams that traverse each of their points twice.
    fn seam_pieces(&self, fan: usize, pieces: &mut Vec<CurvePiece>) {
        let f = &self.fans[fan];
        let mut number = 0;
        for seam in f.doubled() {
            let n = seam.len();
            let inside = |k: usize| seam[k % n].1;
            // A seam that lies in the box as a whole ends where it began: in a fold, if there is
            // one.
            let fold = || (0..n).find(|&k| f.is_fold(seam[k].0));
            let begins = |k: &usize| inside(*k) && !inside(k + n - 1);
            let first = (0..n).find(begins).or_else(fold).unwrap_or(0);
            let knot = |k: usize| {
                let d = seam[k % n].0;
                self.seam_knot(d.at, fan, d)
            };
            let mut knots: Vec<PieceVertex> = Vec::new();
            for k in first..first + n {
                if inside(k) {
                    if knots.is_empty() {
                        knots.push(knot(k));
                    }
                    knots.push(knot(k + 1));
                }
                if !knots.is_empty() && (!inside(k) || k + 1 == first + n) {
                    pieces.push(CurvePiece {
                        track: Track::Seam(fan, number),
                        q: 0,
                        knots: std::mem::take(&mut knots),
                        rays: [None; 2],
                    });
                    number += 1;
                }
            }
        }
    }

    /// Returns the pieces of a side in the region.
    fn side_pieces(&self, id: SideId, places: &[(f64, bool)], pieces: &mut Vec<CurvePiece>) {
        let stop = SideStops::new(self, id);
        let runs = runs_inside(places, &|x| stop.is_base(x));
        for (number, run) in runs.into_iter().enumerate() {
            // Along the side, away from the base point: to larger places at the beginning, to
            // smaller ones at the end.
            let last = run.len() - 1;
            let rays = [(run[0], run[1]), (run[last], run[last - 1])]
                .map(|(base, to)| stop.ray(self, base, to));
            let knot = |(k, &x): (usize, &f64)| {
                let ray = match k {
                    0 => rays[0],
                    _ if k == last => rays[1],
                    _ => None,
                };
                match ray {
                    Some((fan, ray)) => self.ray_knot(on_side(id.0, x), fan, ray),
                    None => Some(stop.knot(self, x, k == 0 || k == last)),
                }
            };
            pieces.push(CurvePiece {
                track: Track::Side(id.0, id.1, number),
                q: stop.quadrants[0],
                knots: run.iter().enumerate().filter_map(knot).collect(),
                rays,
            });
        }
    }

    /// Returns the places of a side through which curves pass, with the faces of the box to which
    /// the curves belong.
    fn wall_points_on(&self, side: usize, quadrants: &[usize]) -> Vec<(f64, u8)> {
        let mut found = Vec::new();
        for &q in quadrants {
            let t = &self.atlas.region.triangles[q];
            let walls = &t.arrangement.walls;
            let points = points_on_side(walls, side).into_iter();
            for (k, p) in points.filter(|&(k, p)| t.is_real(k, p) && t.holds_point(k, p)) {
                let at = self.atlas.place(q, k, p);
                let faces = self.atlas.faces_at(q, k, p);
                let place = if side == 0 { at[1] } else { at[0] };
                found.push((place, if faces == ALL_FACES { 0 } else { faces }));
            }
        }
        found
    }

    /// Makes a pinch point a vertex, if it is on a piece.
    fn add_pinch(&self, piece: &mut CurvePiece, at: [f64; 2]) {
        let x = piece.along(at);
        let Some((j, on)) = piece.place_over(x) else {
            return;
        };
        // The point is on the piece up to its sagitta.
        let chart = &self.atlas.charts[piece.q];
        if distance(chart.at(on), chart.at(at)) > self.atlas.options.tolerance
            // A pinch point on a piece is near the chord below it, in the parameters.
            || distance2(on, at) > 0.1
        {
            return;
        }
        // A nearer vertex is the pinch point.
        let near = |k: &usize| distance2(piece.knots[*k].at, at) < 1e-9;
        match [j - 1, j].into_iter().find(near) {
            Some(k) => piece.knots[k].fixed = true,
            None => {
                let knot = self.knot(piece.q, at, piece.name(at), 0, true);
                piece.knots.insert(j, knot);
            }
        }
    }
}

/// Constraints on vertices of a side: rectangles of base points, and curves that pass through it.
struct SideStops {
    id: SideId,
    quadrants: Vec<usize>,
    /// Base points, with the ends of their rectangles.
    rectangles: Vec<(f64, [f64; 2])>,
    curves: Vec<(f64, u8)>,
}

impl SideStops {
    fn new(open: &Openings<'_>, id: SideId) -> Self {
        let quadrants = quadrants_at(id);
        Self {
            id,
            rectangles: open.places_on(id.0, &quadrants),
            curves: open.wall_points_on(id.0, &quadrants),
            quadrants,
        }
    }
    fn is_base(&self, x: f64) -> bool {
        self.rectangles.iter().any(|b| b.0 == x)
    }
    /// Returns the ray along the side from a base point towards a place.
    fn ray(&self, open: &Openings<'_>, base: f64, to: f64) -> Option<(usize, Ray)> {
        let at = on_side(self.id.0, base);
        let mut sites = open.sites.iter().filter(|_| self.is_base(base));
        let is_there =
            // Places along a side are equal up to rounding.
            |q: usize, place: [f64; 2]| self.quadrants.contains(&q) && distance2(place, at) < 1e-12;
        let (_, site) = sites.find(|(key, site)| is_there(key.0, site.at))?;
        let to = on_side(self.id.0, to);
        let ray = open.fans[site.fan].ray_along(self.quadrants[0], self.id.0, to)?;
        Some((site.fan, ray))
    }
    /// Returns the vertex at a place; it is fixed at ends, at points of walls through which a curve
    /// passes, and at vertices of rectangles.
    fn knot(&self, open: &Openings<'_>, x: f64, is_end: bool) -> PieceVertex {
        let (q, side) = (self.quadrants[0], self.id.0);
        let here = self.curves.iter().filter(|p| p.0 == x);
        let faces = here.clone().fold(0, |bits, p| bits | p.1);
        let is_corner = self.rectangles.iter().any(|b| b.1.contains(&x));
        let fixed = is_end || is_corner || here.count() > 0;
        open.knot(q, on_side(side, x), name_on(q, side, x), faces, fixed)
    }
}

/// Returns the runs of places whose intervals are in the region, from base point to base point.
fn runs_inside(places: &[(f64, bool)], is_base: &dyn Fn(f64) -> bool) -> Vec<Vec<f64>> {
    let mut runs = Vec::new();
    let mut run: Vec<f64> = Vec::new();
    for &(x, inside) in places {
        if !run.is_empty() || inside {
            run.push(x);
        }
        if run.len() > 1 && (!inside || is_base(x)) {
            runs.push(std::mem::take(&mut run));
            if inside {
                run.push(x);
            }
        }
        if !inside {
            run.clear();
        }
    }
    runs
}

/// Returns the points of walls on a side of the unit triangle, by wall and index.
fn points_on_side(walls: &[Wall], side: usize) -> Vec<(usize, usize)> {
    let all = 0..walls.len();
    match side {
        0 => (0..walls[0].points.len()).map(|p| (0, p)).collect(),
        1 => all.map(|k| (k, 0)).collect(),
        _ => all.map(|k| (k, walls[k].points.len() - 1)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::runs_inside;

    #[test]
    fn runs_end_where_the_region_does_and_in_base_points() {
        let places = [
            (0.0, true),
            (0.1, true),
            (0.2, false),
            (0.3, false),
            (0.4, true),
            (0.5, true),
            (0.6, true),
            (1.0, false),
        ];
        let all = [vec![0.0, 0.1, 0.2], vec![0.4, 0.5, 0.6, 1.0]];
        assert_eq!(runs_inside(&places, &|_| false), all);
        let cut = [vec![0.0, 0.1, 0.2], vec![0.4, 0.5], vec![0.5, 0.6, 1.0]];
        assert_eq!(runs_inside(&places, &|x| x == 0.5), cut);
    }
}
