//! Where sheets that cross are joined: every vertex on the double curve gets vertices at all its
//! partners, the other parameters with the same image.
//!
//! The curve is walked through piece by piece: arcs over slabs, stretches of walls, sides of the
//! unit triangles. What is special there (points of walls, rectangles around base points, pinch
//! points) comes first, so that its partners are vertices, too; then the rest.

use super::closing::UPON;
use super::geometry::distance;
use super::names::{Key, Name, Node, Ray, key, name_of, name_on};
use super::opening::Openings;
use super::places::{distance2, in_plane, on_side, place_in, place_on, sides_of};
use super::sides::{Sides, add_place};
use super::stretch::{Columns, Stretch};
use crate::double::Fibres;
use crate::finding::{Finding, JoinedCurve, Phase};
use crate::surface::{DoubleArc, Point3};
use isoform_geom::{dot, norm, sub};
use std::collections::{BTreeMap, BTreeSet};

/// A vertex on a piece of the double curve.
#[derive(Clone, Debug)]
struct Knot {
    at: [f64; 2],
    /// Its parameter (s : t : w), a base point for what is on a seam.
    parameter: [f64; 3],
    key: Key,
    image: Point3,
    /// Stays where it is.
    fixed: bool,
    class: Option<usize>,
}

/// Where a piece of the double curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Track {
    /// Quadrant, slab, place in it.
    Arc(usize, usize, usize),
    /// Quadrant, wall, point of it.
    Wall(usize, usize, usize),
    /// Side and sign, number of the stretch on it.
    Side(usize, i64, usize),
    /// A seam that runs twice through its points: base point, number of the stretch.
    Seam(usize, usize),
}

struct Piece {
    track: Track,
    q: usize,
    knots: Vec<Knot>,
    /// The rays of base points in which it begins and ends.
    rays: [Option<(usize, Ray)>; 2],
}

impl Piece {
    fn is_seam(&self) -> bool {
        matches!(self.track, Track::Seam(..))
    }
    /// The coordinate along it.
    fn along(&self, at: [f64; 2]) -> f64 {
        match self.track {
            Track::Wall(..) | Track::Side(0, ..) => at[1],
            _ => at[0],
        }
    }
}

/// How near to its neighbours on a piece a vertex is left out, per distance at which vertices lie
/// upon each other.
pub(super) const CROWDED: f64 = 8.0;

/// How far from the end of an arc, in the parameters, a place that rounding puts onto the wall
/// there may be: what is on an arc with a vertical tangent is half the digits from its end.
const AT_END: f64 = 1e-7;

/// A vertex between a rectangle and a seam: its class and parameters.
type SpokeVertex = (usize, [f64; 2]);

/// What is glued.
#[derive(Default)]
pub(super) struct Gluing {
    /// The class of each vertex on the double curve.
    classes: BTreeMap<Key, Name>,
    images: Vec<Point3>,
    /// A parameter (s : t : w) of each class.
    parameters: Vec<[f64; 3]>,
    /// The classes in which sheets meet: others join the border of a fundamental domain.
    meeting: BTreeSet<usize>,
    /// Vertices of arcs and walls between their ends, and of sides.
    lines: BTreeMap<Track, Vec<[f64; 2]>>,
    /// Vertices between rectangles and seams, from the rectangle on.
    spokes: BTreeMap<(usize, Ray, [u64; 2]), Vec<SpokeVertex>>,
    points: Vec<(usize, [f64; 2])>,
    /// Chords of a double curve that was traced, by unit triangles.
    pub(super) chords: Vec<(usize, [Node; 2])>,
    pub(super) arcs: Vec<DoubleArc>,
    /// Whether it was given up before there were arcs.
    pub(super) is_stopped: bool,
    pub(super) findings: Vec<Finding>,
}

impl Gluing {
    /// Whether any vertices have been given partners.
    pub(super) fn is_anything_joined(&self) -> bool {
        !self.classes.is_empty()
    }
    /// The name of a vertex that it shares with its partners.
    pub(super) fn name(&self, key: &Key) -> Option<Name> {
        self.classes.get(key).copied()
    }
    /// Isolated points of the double curve that are vertices, in a unit triangle.
    pub(super) fn points(&self, q: usize) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().filter(move |p| p.0 == q).map(|p| p.1)
    }
    pub(super) fn image(&self, class: usize) -> Point3 {
        self.images[class]
    }
    /// A new class of vertices in which sheets meet: their image, and one of their parameters.
    pub(super) fn add_class(&mut self, image: Point3, parameter: [f64; 3]) -> usize {
        self.images.push(image);
        self.parameters.push(parameter);
        self.meeting.insert(self.images.len() - 1);
        self.images.len() - 1
    }
    pub(super) fn name_class(&mut self, key: Key, class: usize) {
        self.classes.insert(key, Name::Double(class));
    }
    pub(super) fn set_line(&mut self, track: Track, line: Vec<[f64; 2]>) {
        self.lines.insert(track, line);
    }
    /// Whether sheets meet in a class.
    pub(super) fn is_double(&self, class: usize) -> bool {
        self.meeting.contains(&class)
    }
    pub(super) fn line(&self, track: Track) -> Option<&Vec<[f64; 2]>> {
        self.lines.get(&track)
    }
    pub(super) fn spoke(&self, fan: usize, ray: Ray, ring: [f64; 2]) -> &[SpokeVertex] {
        self.spokes
            .get(&(fan, ray, ring.map(f64::to_bits)))
            .map_or(&[], Vec::as_slice)
    }
}

impl Openings<'_> {
    /// Finds the vertices of the double curve and their partners. Sides of the unit triangles that
    /// are double get their places.
    pub(super) fn glue(
        &self,
        sides: &mut Sides,
        pinches: &[[f64; 3]],
        isolated: &[[f64; 3]],
        fibres: Option<&Fibres>,
    ) -> Gluing {
        let mut gluing = Gluing::default();
        let mut pieces = self.pieces(sides);
        self.add_pinches(&mut pieces, pinches);
        for fixed in [true, false] {
            for k in 0..pieces.len() {
                let mut j = 0;
                while j < pieces[k].knots.len() {
                    let knot = &pieces[k].knots[j];
                    if knot.class.is_none() && knot.fixed == fixed {
                        if !fixed && self.is_crowded(&pieces[k], j) {
                            pieces[k].knots.remove(j);
                            continue;
                        }
                        let (image, parameter) = (knot.image, knot.parameter);
                        self.join(&mut pieces, k, j, gluing.images.len());
                        gluing.images.push(image);
                        gluing.parameters.push(parameter);
                    }
                    j += 1;
                    if self.atlas.control.is_stopped() {
                        gluing.is_stopped = true;
                        gluing.findings.push(Finding::Stopped(Phase::Partners));
                        return gluing;
                    }
                }
            }
        }
        self.settle(&mut gluing, pieces, sides, fibres);
        self.join_isolated(&mut gluing, isolated, sides);
        gluing
    }

    /// Whether a vertex lies upon one of those next to it, so that it is better left out.
    fn is_crowded(&self, piece: &Piece, j: usize) -> bool {
        let near = |k: usize| {
            piece.knots.get(k).is_some_and(|other| {
                distance(other.image, piece.knots[j].image) < CROWDED * UPON * self.atlas.half_width
            })
        };
        near(j.wrapping_sub(1)) || near(j + 1)
    }

    /// Isolated real points of singular curves, and images of contracted ones: those with one image
    /// become one vertex.
    fn join_isolated(&self, gluing: &mut Gluing, isolated: &[[f64; 3]], sides: &mut Sides) {
        let close = 1e-9 * self.atlas.half_width;
        let mut points: Vec<(usize, [f64; 2], Point3, Name)> = Vec::new();
        for &p in isolated {
            for q in 0..4 {
                let Some(at) = place_on(q, p) else {
                    continue;
                };
                let name = name_of(q, p, at);
                let image = self.atlas.charts[q].at(at);
                if self
                    .atlas
                    .region
                    .domain
                    .as_ref()
                    .is_some_and(|d| d.is_outside(in_plane(q, at)))
                {
                    continue;
                }
                // Base points have no image, and none of their own.
                if image.iter().all(|x| x.abs() <= self.atlas.half_width) {
                    points.push((q, at, image, name));
                }
            }
        }
        for &(q, at, image, name) in &points {
            let contracted = self
                .curves
                .images
                .iter()
                .position(|&p| distance(p, image) < close)
                .map(Name::Image);
            let double = gluing
                .images
                .iter()
                .position(|&p| distance(p, image) < close)
                .map(Name::Double);
            let others = points
                .iter()
                .filter(|o| distance(o.2, image) < close)
                .any(|o| o.0 != q || distance2(o.1, at) > 1e-12);
            if !(contracted.is_some() || double.is_some() || others) {
                continue;
            }
            if let Name::Side(side, sign, bits) = name {
                add_place(sides, (side, sign), f64::from_bits(bits));
            }
            let shared = contracted.or(double).unwrap_or_else(|| {
                gluing.images.push(image);
                gluing.parameters.push(in_plane(q, at));
                gluing.meeting.insert(gluing.images.len() - 1);
                Name::Double(gluing.images.len() - 1)
            });
            gluing.classes.insert(key(name, q, at), shared);
            if name == Name::Inner {
                gluing.points.push((q, at));
            }
        }
        // Contracted curves with one image are one vertex already; a double curve may go through
        // it.
        for (k, &p) in self.curves.images.iter().enumerate() {
            let is_met = |c: usize| {
                distance(gluing.images[c], p) < close
                    && (self.curves.glued || self.curves.leads_to(k, gluing.parameters[c]))
            };
            for name in gluing.classes.values_mut() {
                if matches!(name, Name::Double(c) if is_met(*c)) {
                    *name = Name::Image(k);
                }
            }
        }
    }

    fn knot(&self, q: usize, at: [f64; 2], name: Name, faces: u8, fixed: bool) -> Knot {
        Knot {
            at,
            parameter: in_plane(q, at),
            key: key(name, q, at),
            image: self.atlas.image(q, at, faces),
            fixed,
            class: None,
        }
    }
    fn seam_knot(&self, at: [f64; 2], fan: usize, ray: Ray) -> Option<Knot> {
        let d = self.fans[fan]
            .directions
            .iter()
            .find(|d| d.key() == ray.0)?;
        let (name, image, _) = self.seam_vertex(fan, d);
        Some(Knot {
            at,
            parameter: self.fans[fan].point,
            key: key(name, 0, at),
            image,
            fixed: true,
            class: None,
        })
    }

    fn pieces(&self, sides: &Sides) -> Vec<Piece> {
        let mut pieces = Vec::new();
        for q in 0..4 {
            let a = &self.atlas.region.triangles[q].arrangement;
            for slab in 0..a.slabs.len() {
                let mut over = Columns::new(a, slab);
                for i in self.curves.drawn(q, slab) {
                    let arc = a.slabs[slab].arcs[i];
                    let stretch = self.stretch(q, slab, i);
                    if !self.curves.has_partners(arc.curve) || !stretch.is_open() {
                        continue;
                    }
                    let line = self.polyline(q, &stretch, i, &mut over, &mut true);
                    pieces.push(self.piece(
                        Track::Arc(q, slab, i),
                        q,
                        &line,
                        &stretch,
                        [(slab, arc.left), (slab + 1, arc.right)],
                    ));
                }
            }
            for wall in 1..a.walls.len() - 1 {
                for p in 0..a.walls[wall].points.len() - 1 {
                    if self
                        .curves
                        .drawn_on(q, wall, p)
                        .is_some_and(|f| self.curves.has_partners(f))
                    {
                        let (stretch, line) = self.upright(q, wall, p);
                        pieces.push(self.piece(
                            Track::Wall(q, wall, p),
                            q,
                            &line,
                            &stretch,
                            [(wall, p), (wall, p + 1)],
                        ));
                    }
                }
            }
        }
        // Curves that are contracted have one vertex.
        let is_double =
            |side: usize| self.curves.double_sides[side] && self.curves.on_side[side].is_none();
        for (&(side, sign), places) in sides.iter().filter(|s| is_double(s.0.0)) {
            self.side_pieces(side, sign, places, &mut pieces);
        }
        // Deck transformations take such a seam to itself, and the fundamental domain has one of
        // the two points.
        let is_used = |f: &usize| {
            self.atlas.region.deck.is_none() && self.sites.values().any(|s| s.fan == *f)
        };
        for fan in (0..self.fans.len()).filter(is_used) {
            self.seam_pieces(fan, &mut pieces);
        }
        pieces
    }

    /// The stretches in the box of seams that run twice through their points.
    fn seam_pieces(&self, fan: usize, pieces: &mut Vec<Piece>) {
        let f = &self.fans[fan];
        let mut number = 0;
        for seam in f.doubled() {
            let n = seam.len();
            let inside = |k: usize| seam[k % n].1;
            // All the way around it ends where it began: in a fold, if there is one.
            let fold = || (0..n).find(|&k| f.is_fold(seam[k].0));
            let first = (0..n)
                .find(|&k| inside(k) && !inside(k + n - 1))
                .or_else(fold)
                .unwrap_or(0);
            let knot = |k: usize| {
                let d = seam[k % n].0;
                let (name, image, _) = self.seam_vertex(fan, d);
                Knot {
                    at: d.at,
                    parameter: f.point,
                    key: key(name, 0, d.at),
                    image,
                    fixed: true,
                    class: None,
                }
            };
            let mut knots: Vec<Knot> = Vec::new();
            for k in first..first + n {
                if inside(k) {
                    if knots.is_empty() {
                        knots.push(knot(k));
                    }
                    knots.push(knot(k + 1));
                }
                if !knots.is_empty() && (!inside(k) || k + 1 == first + n) {
                    pieces.push(Piece {
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

    fn piece(
        &self,
        track: Track,
        q: usize,
        line: &[[f64; 2]],
        stretch: &Stretch,
        walls: [(usize, usize); 2],
    ) -> Piece {
        let mut knots: Vec<Knot> = line
            .iter()
            .map(|&at| self.knot(q, at, Name::Inner, 0, false))
            .collect();
        let last = knots.len() - 1;
        for (end, (wall, point)) in [(0, walls[0]), (last, walls[1])] {
            let based = stretch.based[usize::from(end > 0)];
            knots[end] = match based {
                true => self.knot(q, line[end], Name::Inner, 0, true),
                false => self.knot(
                    q,
                    line[end],
                    self.atlas.wall_name(q, wall, point),
                    self.atlas.faces_at(q, wall, point),
                    true,
                ),
            };
        }
        let seam =
            |k: usize| stretch.rays[k].and_then(|(fan, ray, at)| self.seam_knot(at, fan, ray));
        let (first, end) = (seam(0), seam(1));
        knots.splice(0..0, first);
        knots.extend(end);
        Piece {
            track,
            q,
            knots,
            rays: [0, 1].map(|k| stretch.rays[k].map(|r| (r.0, r.1))),
        }
    }

    fn side_pieces(&self, side: usize, sign: i64, places: &[(f64, bool)], pieces: &mut Vec<Piece>) {
        let both: Vec<usize> = (0..4)
            .filter(|&q| sides_of(q)[side] == (side, sign))
            .collect();
        let q = both[0];
        let based = self.places_on(side, &both);
        let mut number = 0;
        let mut run: Vec<f64> = Vec::new();
        for &(x, inside) in places {
            if !run.is_empty() || inside {
                run.push(x);
            }
            let is_base = based.iter().any(|b| b.0 == x);
            if run.len() > 1 && (!inside || is_base) {
                let base_of = |x: f64| {
                    based
                        .iter()
                        .any(|b| b.0 == x)
                        .then(|| self.side_ray(side, &both, x))
                        .flatten()
                };
                let ends = [run[0], run[run.len() - 1]];
                // From the base point along the side: to larger places at the beginning, to smaller
                // ones at the end.
                let rays = [(ends[0], run[1]), (ends[1], run[run.len() - 2])].map(|(base, to)| {
                    let (fan, at) = base_of(base)?;
                    Some((
                        fan,
                        self.fans[fan].ray_along(q, side, on_side(side, to))?,
                        at,
                    ))
                });
                let mut knots: Vec<Knot> = Vec::new();
                for (k, &x) in run.iter().enumerate() {
                    let ray = if k == 0 {
                        rays[0]
                    } else if k + 1 == run.len() {
                        rays[1]
                    } else {
                        None
                    };
                    let at = on_side(side, x);
                    match ray {
                        Some((fan, ray, _)) => knots.extend(self.seam_knot(at, fan, ray)),
                        None => {
                            let name = name_on(q, side, x);
                            let fixed =
                                k == 0 || k + 1 == run.len() || self.is_hard(side, &both, x);
                            let faces = self.faces_on(side, &both, x);
                            knots.push(self.knot(q, at, name, faces, fixed));
                        }
                    }
                }
                pieces.push(Piece {
                    track: Track::Side(side, sign, number),
                    q,
                    knots,
                    rays: rays.map(|r| r.map(|r| (r.0, r.1))),
                });
                number += 1;
                run.clear();
                if inside {
                    run.push(x);
                }
            }
            if !inside {
                run.clear();
            }
        }
    }
    /// The base point at a place of a side.
    fn side_ray(&self, side: usize, both: &[usize], x: f64) -> Option<(usize, [f64; 2])> {
        let at = on_side(side, x);
        self.sites
            .iter()
            .find(|(key, site)| both.contains(&key.0) && distance2(site.at, at) < 1e-12)
            .map(|(_, site)| (site.fan, at))
    }
    /// Whether a place of a side is a point of a wall that a curve goes through, or a vertex of a
    /// rectangle.
    fn is_hard(&self, side: usize, both: &[usize], x: f64) -> bool {
        self.places_on(side, both).iter().any(|b| b.1.contains(&x))
            || self.wall_points_on(side, both).iter().any(|p| p.0 == x)
    }
    fn faces_on(&self, side: usize, both: &[usize], x: f64) -> u8 {
        self.wall_points_on(side, both)
            .iter()
            .filter(|p| p.0 == x)
            .fold(0, |bits, p| bits | p.1)
    }
    /// Places of a side that curves go through, with the faces of the box that these belong to.
    fn wall_points_on(&self, side: usize, both: &[usize]) -> Vec<(f64, u8)> {
        let mut found = Vec::new();
        for &q in both {
            let t = &self.atlas.region.triangles[q];
            let walls = &t.arrangement.walls;
            let points: Vec<(usize, usize)> = match side {
                0 => (0..walls[0].points.len()).map(|p| (0, p)).collect(),
                1 => (0..walls.len()).map(|k| (k, 0)).collect(),
                _ => (0..walls.len())
                    .map(|k| (k, walls[k].points.len() - 1))
                    .collect(),
            };
            for (k, p) in points
                .into_iter()
                .filter(|&(k, p)| t.is_real(k, p) && t.holds_point(k, p))
            {
                let at = self.atlas.place(q, k, p);
                let faces = self.atlas.faces_at(q, k, p);
                found.push((
                    if side == 0 { at[1] } else { at[0] },
                    if faces == 0b11_1111 { 0 } else { faces },
                ));
            }
        }
        found
    }

    /// Makes vertices of the pinch points.
    fn add_pinches(&self, pieces: &mut [Piece], pinches: &[[f64; 3]]) {
        for &p in pinches {
            for piece in pieces.iter_mut().filter(|p| !p.is_seam()) {
                let Some(at) = place_in(piece.q, p) else {
                    continue;
                };
                let x = piece.along(at);
                let Some(j) = (1..piece.knots.len()).find(|&j| {
                    piece.along(piece.knots[j - 1].at) <= x && x <= piece.along(piece.knots[j].at)
                }) else {
                    continue;
                };
                let (a, b) = (piece.knots[j - 1].at, piece.knots[j].at);
                let t = (x - piece.along(a)) / (piece.along(b) - piece.along(a));
                let on = [0, 1].map(|i| a[i] + t * (b[i] - a[i]));
                // On the piece but for its sagitta.
                let image = self.atlas.charts[piece.q].at(at);
                if distance(self.atlas.charts[piece.q].at(on), image) > self.atlas.options.tolerance
                    || distance2(on, at) > 0.1
                {
                    continue;
                }
                let near = |k: &usize| distance2(piece.knots[*k].at, at) < 1e-9;
                match [j - 1, j].iter().find(|k| near(k)) {
                    Some(&k) => piece.knots[k].fixed = true,
                    None => {
                        let name = self.piece_name(piece, at);
                        let knot = self.knot(piece.q, at, name, 0, true);
                        piece.knots.insert(j, knot);
                    }
                }
            }
        }
    }
    fn piece_name(&self, piece: &Piece, at: [f64; 2]) -> Name {
        match piece.track {
            Track::Side(side, ..) => name_on(piece.q, side, piece.along(at)),
            _ => Name::Inner,
        }
    }

    /// Finds the partners of a vertex and gives them, and it, a class.
    fn join(&self, pieces: &mut [Piece], k: usize, j: usize, class: usize) {
        let image = pieces[k].knots[j].image;
        let own = pieces[k].knots[j].key;
        let parameter = pieces[k].knots[j].parameter;
        pieces[k].knots[j].class = Some(class);
        let close = 1e-9 * self.atlas.half_width;
        for piece in pieces.iter_mut() {
            // Vertices that are there already, other ends of pieces that meet in the same parameter
            // among them.
            for knot in piece
                .knots
                .iter_mut()
                .filter(|x| x.fixed || x.class.is_some() || x.key == own)
            {
                if knot.class.is_none_or(|c| c == class)
                    && distance(knot.image, image) < close
                    && self.curves.may_share(parameter, knot.parameter)
                {
                    knot.class = Some(class);
                }
            }
            // All partners on seams are directions already.
            if piece.is_seam() {
                continue;
            }
            let mut i = 1;
            while i < piece.knots.len() {
                let (a, b) = (&piece.knots[i - 1], &piece.knots[i]);
                let skip = a.class == Some(class) || b.class == Some(class);
                if !skip
                    && let Some(at) = self.partner(piece, i, image)
                    && self.curves.may_share(parameter, in_plane(piece.q, at))
                {
                    self.insert(piece, i, at, image, class);
                }
                i += 1;
            }
        }
    }

    /// The parameter near to a segment of a piece with a given image, if there is one.
    fn partner(&self, piece: &Piece, i: usize, image: Point3) -> Option<[f64; 2]> {
        let (a, b) = (&piece.knots[i - 1], &piece.knots[i]);
        let d: Point3 = std::array::from_fn(|k| b.image[k] - a.image[k]);
        let x: Point3 = std::array::from_fn(|k| image[k] - a.image[k]);
        let length = d.iter().map(|d| d * d).sum::<f64>();
        if length == 0.0 {
            return None;
        }
        let t = d.iter().zip(x).map(|(d, x)| d * x).sum::<f64>() / length;
        let off = x
            .iter()
            .zip(d)
            .map(|(x, d)| (x - t.clamp(0.0, 1.0) * d).powi(2))
            .sum::<f64>()
            .sqrt();
        if off > 2.0 * self.atlas.options.tolerance {
            return None;
        }
        if self.is_fold(piece) {
            return self.partner_on_fold(piece, i, image, t);
        }
        let (from, to) = (piece.along(a.at), piece.along(b.at));
        let s = t.clamp(0.02, 0.98);
        let mut at = [0, 1].map(|k| a.at[k] + s * (b.at[k] - a.at[k]));
        let chart = &self.atlas.charts[piece.q];
        let mut last = f64::INFINITY;
        for _ in 0..60 {
            let p = chart.at(at);
            let r: Point3 = std::array::from_fn(|k| image[k] - p[k]);
            let residual = r.iter().map(|r| r * r).sum::<f64>().sqrt();
            if !residual.is_finite() {
                return None;
            }
            let [_, by_u, by_v] = chart.tangents(at);
            let columns = [by_u, by_v];
            let dot = |x: &Point3, y: &Point3| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
            let [m, n] = &columns;
            let (e, f, g) = (dot(m, m), dot(m, n), dot(n, n));
            let (p, q) = (dot(m, &r), dot(n, &r));
            let det = e * g - f * f;
            let delta = [(g * p - f * q) / det, (e * q - f * p) / det];
            if delta.iter().any(|d| !d.is_finite()) {
                return None;
            }
            if residual < 1e-13 * self.atlas.half_width
                || (residual < 1e-10 * self.atlas.half_width && residual >= 0.5 * last)
            {
                let x = piece.along(at);
                return (x > from - 1e-10 && x < to + 1e-10 && self.is_on(piece, at))
                    .then(|| self.onto(piece, at));
            }
            last = residual;
            at = [at[0] + delta[0], at[1] + delta[1]];
            if at.iter().any(|x| !(-0.1..=1.1).contains(x)) {
                return None;
            }
        }
        None
    }
    /// The parameter with a given image on a fold, across which the map has no derivative: along the
    /// curve alone, from a place between the ends of the segment.
    fn partner_on_fold(
        &self,
        piece: &Piece,
        i: usize,
        image: Point3,
        place: f64,
    ) -> Option<[f64; 2]> {
        /// Half the step of difference quotients along the segment: they need no more digits for
        /// each step to gain some.
        const STEP: f64 = 1e-4;
        let ends = [i - 1, i].map(|k| piece.knots[k].at);
        let at = |t: f64| {
            self.on_curve_of(
                piece,
                [0, 1].map(|k| ends[0][k] + t * (ends[1][k] - ends[0][k])),
            )
        };
        let value = |t: f64| self.atlas.charts[piece.q].at(at(t));
        let mut t = place.clamp(0.02, 0.98);
        for _ in 0..60 {
            let rest = sub(image, value(t));
            if norm(rest) < 1e-12 * self.atlas.half_width {
                return (t > 0.0 && t < 1.0).then(|| self.onto(piece, at(t)));
            }
            let slope = sub(value(t + STEP), value(t - STEP)).map(|x| x / (2.0 * STEP));
            t += dot(slope, rest) / dot(slope, slope);
            if !(-0.1..=1.1).contains(&t) {
                return None;
            }
        }
        None
    }
    /// Whether a parameter is on the curve of a piece, not on another one that crosses it.
    fn is_on(&self, piece: &Piece, at: [f64; 2]) -> bool {
        match piece.track {
            Track::Arc(q, slab, i) => {
                match Columns::new(&self.atlas.region.triangles[q].arrangement, slab).at(at[0], i) {
                    Some(v) => (v - at[1]).abs() < 1e-8,
                    // On a wall but for rounding, where other arcs may end, too.
                    None => [0, piece.knots.len() - 1]
                        .iter()
                        .any(|&k| distance2(piece.knots[k].at, at) < AT_END),
                }
            }
            Track::Wall(..) => (piece.knots[0].at[0] - at[0]).abs() < 1e-8,
            Track::Side(side, ..) => distance2(on_side(side, piece.along(at)), at) < 1e-8,
            Track::Seam(..) => false,
        }
    }
    /// Exactly on the side that a piece lies on.
    fn onto(&self, piece: &Piece, at: [f64; 2]) -> [f64; 2] {
        match piece.track {
            Track::Side(side, ..) => on_side(side, piece.along(at)),
            Track::Wall(..) => [piece.knots[0].at[0], at[1]],
            Track::Arc(..) | Track::Seam(..) => at,
        }
    }

    /// Puts a partner between two vertices of a piece, or moves one of them there that is not
    /// needed where it is.
    fn insert(&self, piece: &mut Piece, i: usize, at: [f64; 2], image: Point3, class: usize) {
        let name = self.piece_name(piece, at);
        let length = distance(piece.knots[i - 1].image, piece.knots[i].image);
        for k in [i - 1, i] {
            let knot = &mut piece.knots[k];
            if distance2(knot.at, at) < 1e-10 {
                // There already; or the vertex itself, which has its class.
                knot.class = knot.class.or(Some(class));
                return;
            }
            if !knot.fixed && knot.class.is_none() && distance(knot.image, image) < 0.35 * length {
                *knot = Knot {
                    at,
                    parameter: in_plane(piece.q, at),
                    key: key(name, piece.q, at),
                    image,
                    fixed: false,
                    class: Some(class),
                };
                return;
            }
        }
        piece.knots.insert(
            i,
            Knot {
                at,
                parameter: in_plane(piece.q, at),
                key: key(name, piece.q, at),
                image,
                fixed: false,
                class: Some(class),
            },
        );
    }

    /// The vertices in their places, and the arcs in space.
    fn settle(
        &self,
        gluing: &mut Gluing,
        pieces: Vec<Piece>,
        sides: &mut Sides,
        fibres: Option<&Fibres>,
    ) {
        let mut edges: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for piece in &pieces {
            for w in piece.knots.windows(2) {
                if let [Some(a), Some(b)] = [w[0].class, w[1].class] {
                    *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
                }
            }
        }
        // Two sheets at least meet in each piece, if they do not belong to the same one that a
        // pinch point folds, or the other one is not real.
        let mut single = 0;
        for piece in &pieces {
            let alone = |w: &&[Knot]| match [w[0].class, w[1].class] {
                [Some(a), Some(b)] => edges.get(&[a.min(b), a.max(b)]).copied().unwrap_or(0) < 2,
                _ => true,
            };
            let mut lonely: Vec<&[Knot]> = piece.knots.windows(2).filter(alone).collect();
            if self.is_fold(piece) {
                continue;
            }
            // Partners may be outside of the domain on some of its length only.
            if let (Some(_), Some(fibres), false) =
                (&self.atlas.region.domain, fibres, piece.is_seam())
            {
                lonely.retain(|w| {
                    let at =
                        self.on_curve_of(piece, [0, 1].map(|i| 0.5 * (w[0].at[i] + w[1].at[i])));
                    let is_outside = |p: [f64; 3]| {
                        self.atlas
                            .region
                            .domain
                            .as_ref()
                            .is_some_and(|d| d.is_outside(p))
                    };
                    !fibres.is_alone(
                        self.atlas.charts[piece.q].at(at),
                        in_plane(piece.q, at),
                        &is_outside,
                    )
                });
            }
            if let Some(w) = lonely.get(lonely.len() / 2) {
                let at = [0, 1].map(|i| 0.5 * (w[0].at[i] + w[1].at[i]));
                let middle = || {
                    if piece.is_seam() {
                        w[0].image
                    } else {
                        self.atlas.charts[piece.q].at(at)
                    }
                };
                let knot = w.iter().find(|k| !k.fixed).map_or_else(middle, |k| k.image);
                if !fibres
                    .is_some_and(|f| f.is_met_by_conjugates(knot, self.atlas.region.deck.as_ref()))
                {
                    single += lonely.len();
                }
            }
        }
        if single > 0 {
            let curve = match self.curves.glued {
                true => JoinedCurve::Double,
                false => JoinedCurve::FundamentalDomain,
            };
            let edges = single;
            gluing
                .findings
                .push(Finding::PartnersMissing { edges, curve });
        }
        let mut done = BTreeSet::new();
        for mut piece in pieces {
            let mut classes: Vec<usize> = piece.knots.iter().filter_map(|k| k.class).collect();
            if self.is_border(&piece) {
                classes.clear();
            }
            gluing.meeting.extend(&classes);
            let mut run: Vec<usize> = Vec::new();
            let mut sheets = 0;
            for w in classes.windows(2) {
                let edge = [w[0].min(w[1]), w[0].max(w[1])];
                let n = edges.get(&edge).copied().unwrap_or(0);
                if !done.insert(edge) || (n != sheets && !run.is_empty()) {
                    self.close(gluing, &mut run, sheets);
                }
                if run.last() != Some(&w[0]) {
                    run = vec![w[0]];
                }
                if edges.remove(&edge).is_some() {
                    sheets = n;
                    run.push(w[1]);
                } else {
                    run.clear();
                }
            }
            self.close(gluing, &mut run, sheets);
            for knot in &piece.knots {
                if let Some(class) = knot.class {
                    gluing.classes.insert(knot.key, Name::Double(class));
                }
            }
            // Between base points and their rectangles.
            for (end, ray) in piece.rays.into_iter().enumerate() {
                let Some((fan, ray)) = ray else { continue };
                if end == 1 {
                    piece.knots.reverse();
                }
                let first = (1..piece.knots.len())
                    .find(|&j| piece.knots[j].fixed && self.is_ring(&piece, &piece.knots[j]))
                    .unwrap_or(1);
                let ring = piece
                    .knots
                    .get(first)
                    .map_or([0; 2], |k| k.at.map(f64::to_bits));
                let inner: Vec<Knot> = piece.knots.drain(..first).collect();
                let list = inner[1..]
                    .iter()
                    .rev()
                    .filter_map(|k| Some((k.class?, k.at)))
                    .collect();
                gluing.spokes.insert((fan, ray, ring), list);
                if end == 1 {
                    piece.knots.reverse();
                }
            }
            match piece.track {
                Track::Side(side, sign, _) => {
                    let places = sides.get_mut(&(side, sign)).expect("the side");
                    let (Some(first), Some(last)) = (piece.knots.first(), piece.knots.last())
                    else {
                        continue;
                    };
                    let (from, to) = (piece.along(first.at), piece.along(last.at));
                    places.retain(|p| p.0 <= from || p.0 >= to);
                    let at = places.partition_point(|p| p.0 <= from);
                    let inner: Vec<(f64, bool)> = piece.knots[1..piece.knots.len() - 1]
                        .iter()
                        .map(|k| (piece.along(k.at), true))
                        .collect();
                    places.splice(at..at, inner);
                }
                Track::Seam(..) => {}
                track => {
                    gluing
                        .lines
                        .insert(track, piece.knots.iter().map(|k| k.at).collect());
                }
            }
        }
    }
    /// Whether a piece is on the border of a fundamental domain, and goes on.
    fn is_border(&self, piece: &Piece) -> bool {
        let is_side = |side: usize| {
            self.atlas
                .region
                .deck
                .as_ref()
                .is_some_and(|d| d.seams.sides[side])
        };
        self.is_of(piece, &|f| self.curves.seams.contains(&f), &is_side)
    }
    /// Whether the surface ends in a piece: others may end there, or not.
    fn is_fold(&self, piece: &Piece) -> bool {
        let is_side = |side: usize| self.atlas.region.is_fold_side(side);
        self.is_of(piece, &|f| self.atlas.region.is_fold(f), &is_side)
    }
    /// Whether a piece lies on some factors or sides of unit triangles.
    fn is_of(
        &self,
        piece: &Piece,
        is_factor: &dyn Fn(usize) -> bool,
        is_side: &dyn Fn(usize) -> bool,
    ) -> bool {
        let arrangement = |q: usize| &self.atlas.region.triangles[q].arrangement;
        match piece.track {
            Track::Arc(q, slab, i) => is_factor(arrangement(q).slabs[slab].arcs[i].curve),
            Track::Wall(q, wall, _) => {
                let lines = &arrangement(q).walls[wall].vertical;
                lines.iter().any(|&f| is_factor(f))
            }
            Track::Side(side, ..) => is_side(side),
            Track::Seam(..) => false,
        }
    }
    /// The point of a piece over, or beside, one of its chords.
    fn on_curve_of(&self, piece: &Piece, at: [f64; 2]) -> [f64; 2] {
        match piece.track {
            Track::Arc(q, slab, i) => {
                Columns::new(&self.atlas.region.triangles[q].arrangement, slab)
                    .at(at[0], i)
                    .map_or(at, |v| [at[0], v])
            }
            _ => at,
        }
    }
    fn is_ring(&self, piece: &Piece, knot: &Knot) -> bool {
        let x = knot.at;
        self.sites
            .iter()
            .filter(|s| s.0.0 == piece.q || matches!(piece.track, Track::Side(..)))
            .any(|(_, s)| {
                let (h, v) = (self.widths[s.fan], s.height);
                let on_arc = s.arcs.iter().any(|a| a.end == x);
                on_arc || (x[0] - s.at[0]).abs() == h || (x[1] - s.at[1]).abs() == v
            })
    }
    fn close(&self, gluing: &mut Gluing, run: &mut Vec<usize>, sheets: usize) {
        if run.len() > 1 && sheets > 1 {
            let points = run.iter().map(|&c| gluing.images[c]).collect();
            gluing.arcs.push(DoubleArc { points, sheets });
        }
        run.clear();
    }
}
