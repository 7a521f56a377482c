//! Directions of base points, as many as seams and rectangles need to be near the surface.
//!
//! A sector between two rays is looked at in three ways: its pieces of the seam ([`Sight`]), its
//! part of the rectangle in each unit triangle ([`Wedge`]), and the sign of W in between. What is
//! too rough gets a direction in between; where no direction helps, the rectangle is too large.

use super::Openings;
use super::site::{Site, SiteArc};
use crate::fan::{Direction, Fan, Sector};
use crate::mesh::chart::keeps_sign_on;
use crate::mesh::geometry::{distance, middle};
use crate::mesh::names::Ray;
use crate::surface::Point3;
use isoform_geom::distance_to_segment;
use std::collections::BTreeSet;

/// Directions of a base point at most: with more it is left rough.
const DIRECTIONS: usize = 2000;
/// The distance from the middle of an edge of the rectangle of a tree at which the image of the
/// middle of its parameters may be, per length of the edge: farther off, triangles beside it are
/// uneven.
const UNEVEN: f64 = 0.15;
/// A chord of the seam is split when the seam bulges beyond it by more than this many widths of the
/// strip: vertices on the rectangle would lie on the wrong side of the chord.
const ROOM: f64 = 1.0;
/// Chords of the seam that are shorter than this, per longest edge allowed, are not split for their
/// bulge.
const SHORT: f64 = 0.003;
/// Seams shorter than this, in tolerances, are not what is rough about a sector: an arc is too far
/// from its tangent.
const LEAST: f64 = 0.1;
/// The share of tolerances for trees, where rays of several nodes crowd.
const LEAST_IN_TREES: f64 = 0.01;

/// The verdict on a sector.
enum Verdict {
    Fine,
    /// Another direction.
    Split(Direction),
    /// A smaller rectangle.
    TooLarge,
}

/// The chords of a sector's seam, as they are seen while its unit triangles are looked at.
struct Sight {
    /// The pieces of the seam: one, or one to the corner and one from there.
    pieces: Vec<[Point3; 2]>,
    /// Whether no direction is wanted so far.
    fine: bool,
    /// The length of the longest piece or, in trees, edge of the rectangle.
    longest: f64,
    /// The piece that is to be split first.
    worse: usize,
}

/// A sector of a fan in a unit triangle: the part of a rectangle between two rays.
struct Wedge<'a> {
    open: &'a Openings<'a>,
    fan: &'a Fan,
    sector: &'a Sector,
    q: usize,
    site: &'a Site,
    /// The places where its rays leave the rectangle.
    ends: [[f64; 2]; 2],
}

fn cross([a, b]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    a * y - b * x
}
fn halfway(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
}

impl<'a> Wedge<'a> {
    /// None if the sector does not lead into the unit triangle.
    fn new(
        open: &'a Openings<'a>,
        fan: &'a Fan,
        sector: &'a Sector,
        (q, site): (usize, &'a Site),
    ) -> Option<Self> {
        let ends = open.sector_ends(q, site, fan, sector)?;
        Some(Self {
            open,
            fan,
            sector,
            q,
            site,
            ends,
        })
    }
    fn image(&self, at: [f64; 2]) -> Point3 {
        self.open.atlas.charts[self.q].at(at)
    }
    fn seen_from_base(&self, x: [f64; 2]) -> [f64; 2] {
        [x[0] - self.site.at[0], x[1] - self.site.at[1]]
    }
    /// Whether two places follow each other around the base point in the sense of the fan.
    fn are_in_turn(&self, a: [f64; 2], b: [f64; 2]) -> bool {
        let turn = cross(self.seen_from_base(a), self.seen_from_base(b));
        if self.fan.keeps_turn(self.q) {
            turn > 0.0
        } else {
            turn < 0.0
        }
    }
    /// Whether an end lies beyond the other: an arc that bends away from its tangent may be beyond
    /// the next direction.
    fn is_turned_over(&self) -> bool {
        let [a, b] = self.ends;
        !self.are_in_turn(a, b)
    }
    /// The edge of the rectangle, in space.
    fn chord(&self) -> [Point3; 2] {
        self.ends.map(|x| self.image(x))
    }
    /// The surface at the middle of the edge of the rectangle.
    fn middle(&self) -> Point3 {
        self.image(halfway(self.ends[0], self.ends[1]))
    }
    /// The drawn arc in an end, if there is one.
    fn arc(&self, end: usize) -> Option<&SiteArc> {
        let (k, backward) = self.sector.rays[end];
        let ray = (self.fan.directions[k].key(), backward);
        let mut arcs = self.site.arcs.iter();
        arcs.find(|x| x.ray == ray && x.end == self.ends[end])
    }
    /// Whether straight pieces from points of the seam may stand for the rays. In trees strips have
    /// vertices in between.
    fn are_rays_near(&self, seam: [Point3; 2]) -> bool {
        self.fan.is_tree()
            || (0..2).all(|end| {
                let at = self.ends[end];
                let (k, backward) = self.sector.rays[end];
                // Halfway on an arc, not on its chord: it is the arc that bounds the surface.
                let halfway = match self.arc(end) {
                    Some(arc) => arc.middle,
                    None => {
                        let d = &self.fan.directions[k];
                        self.open.ray(self.q, self.site, d, backward).halfway(at)
                    }
                };
                let piece = [seam[end], self.image(at)];
                self.open.is_near_chord(self.image(halfway), piece)
            })
    }
    /// Whether there is no room between the edge of the rectangle and a chord of the seam: beyond
    /// the chord, others at the rectangle would lie on the wrong side of it.
    fn is_crowded_by(&self, seam: Point3, chord: [Point3; 2]) -> bool {
        let on = self.middle();
        let bulge = distance_to_segment(seam, chord);
        let width = distance_to_segment(on, chord).min(distance(on, seam));
        bulge > ROOM * width
    }
    /// Whether the edge of the rectangle is near the surface.
    fn is_near(&self) -> bool {
        let (on, chord) = (self.middle(), self.chord());
        let straight = middle(chord[0], chord[1]);
        if !self.fan.is_tree() {
            return self.open.is_near(on, straight, chord);
        }
        // In trees, where the map is far from even, the point may slide along the chord, but not so
        // far that triangles beside it were uneven.
        let off = distance(on, straight);
        let is_even = off <= UNEVEN * distance(chord[0], chord[1])
            || off <= 0.5 * self.open.atlas.tolerance_at(on);
        is_even && self.open.is_near_chord(on, chord)
    }
    /// Whether W keeps its sign between the base point and the rectangle.
    fn keeps_sign(&self) -> bool {
        let ([a, b], fan) = (self.ends, self.fan);
        let chart = &self.open.atlas.charts[self.q];
        chart.keeps_sign([self.site.at, a, b], fan.multiplicity)
            // The parameters inside are in a cell of the region, in which W has no zero; what is
            // left are edges of the rectangle that leave it.
            || fan.is_tree()
                && chart.keeps_sign([a, b, a], 0)
                && fan.keeps_sign(self.q, self.sector, &self.outline(), &keeps_sign_on)
    }
    /// Parameters on the outline: on arcs, on rays that are bent, and on the edge of the rectangle.
    fn outline(&self) -> Vec<[f64; 2]> {
        let [a, b] = self.ends;
        let mut points = vec![a, b];
        for (end, (k, backward)) in self.sector.rays.into_iter().enumerate() {
            let d = &self.fan.directions[k];
            if let Some(arc) = self.arc(end) {
                points.push(arc.middle);
            } else if let Some(reach) = self.open.ray(self.q, self.site, d, backward).reach() {
                let shares = [0.25, 0.5, 0.75].into_iter();
                points
                    .extend(shares.filter_map(|t| self.fan.on_ray(self.q, d, backward, t * reach)));
            }
        }
        points.extend((1..8).map(|i| [0, 1].map(|k| a[k] + f64::from(i) / 8.0 * (b[k] - a[k]))));
        points
    }
    /// The piece of the seam whose middle ray is farther away from the ends.
    fn wider_piece(&self) -> usize {
        let chord = self.chord();
        let apart = [0, 1].map(|piece| {
            let (d, backward) = self.fan.between(self.sector, piece);
            let found = self.open.ray(self.q, self.site, &d, backward).end();
            found
                .map(|x| self.image(x))
                .map_or(0.0, |p| distance(p, chord[0]).min(distance(p, chord[1])))
        });
        usize::from(apart[1] > apart[0])
    }
    /// Whether arcs with one tangent are in their order on the rectangle, and W keeps its sign
    /// between them.
    fn are_arcs_apart(&self) -> bool {
        let chart = &self.open.atlas.charts[self.q];
        self.sector.rays.iter().all(|&(k, backward)| {
            let d = &self.fan.directions[k];
            let ring = self.open.ray(self.q, self.site, d, backward).vertices();
            ring.windows(2).all(|w| {
                chart.keeps_sign([self.site.at, w[0], w[1]], self.fan.multiplicity)
                    && cross(self.seen_from_base(w[0]), self.seen_from_base(w[1])) > 0.0
            })
        })
    }
    /// Whether a ray leaves the rectangle between the ends.
    fn is_between(&self, d: &Direction, backward: bool) -> bool {
        let [a, b] = self.ends;
        let at = self.open.ray(self.q, self.site, d, backward).end();
        at.is_some_and(|x| self.are_in_turn(a, x) && self.are_in_turn(x, b))
    }
    /// The ray towards the middle of the edge of the rectangle, from a piece of the seam.
    fn ray_to_middle(&self, piece: usize) -> Option<(Direction, bool)> {
        let to = halfway(self.ends[0], self.ends[1]);
        self.fan.toward(self.q, to, self.sector, piece)
    }
}

impl Openings<'_> {
    /// More directions, until seams and rectangles are near the surface and W keeps its sign.
    /// Returns the base points whose rectangles are too large for that.
    pub(super) fn refine_directions(&mut self) -> Vec<usize> {
        let mut too_large = Vec::new();
        for f in 0..self.fans.len() {
            let mut fan = self.fans[f].clone();
            let sites: Vec<(usize, &Site)> = self
                .sites
                .iter()
                .filter(|s| s.1.fan == f)
                .map(|(key, s)| (key.0, s))
                .collect();
            if sites.is_empty() || self.refine_fan(&mut fan, &sites) {
                self.fans[f] = fan;
            } else {
                too_large.push(f);
            }
        }
        too_large
    }

    /// Splits the sectors of a fan. False if its rectangle is too large.
    fn refine_fan(&self, fan: &mut Fan, sites: &[(usize, &Site)]) -> bool {
        // By their rays: splitting one leaves the others as they are.
        let mut done: BTreeSet<[Ray; 2]> = BTreeSet::new();
        'again: loop {
            for s in 0..fan.sectors.len() {
                let sector = &fan.sectors[s];
                let name = sector
                    .rays
                    .map(|(k, backward)| (fan.directions[k].key(), backward));
                if !sector.inside || done.contains(&name) {
                    continue;
                }
                if self.atlas.control.is_stopped() {
                    return false;
                }
                match self.judge(fan, sector, sites) {
                    Verdict::Fine => {
                        done.insert(name);
                    }
                    Verdict::Split(d) if fan.directions.len() < DIRECTIONS => {
                        fan.split(d);
                        continue 'again;
                    }
                    Verdict::Split(_) | Verdict::TooLarge => return false,
                }
            }
            return true;
        }
    }

    /// The verdict on a sector.
    fn judge(&self, fan: &Fan, sector: &Sector, sites: &[(usize, &Site)]) -> Verdict {
        let ends = sector.rays.map(|(k, _)| fan.seam(&fan.directions[k]));
        let wedges: Vec<Wedge<'_>> = sites
            .iter()
            .filter_map(|&site| Wedge::new(self, fan, sector, site))
            .collect();
        let mut sight = self.seam_sight(fan, sector, ends);
        for wedge in &wedges {
            if wedge.is_turned_over() || !wedge.are_rays_near(ends) {
                return Verdict::TooLarge;
            }
            sight.take_in(wedge);
            if !wedge.are_arcs_apart() {
                return Verdict::TooLarge;
            }
        }
        let least = if fan.is_tree() { LEAST_IN_TREES } else { LEAST };
        if sight.fine {
            Verdict::Fine
        } else if sight.longest < least * self.atlas.tolerance_at(ends[0]) {
            Verdict::TooLarge
        } else if fan.is_tree() {
            direction_between(fan, sector, &wedges, sight.worse)
                .map_or(Verdict::TooLarge, Verdict::Split)
        } else {
            Verdict::Split(fan.between(sector, 0).0)
        }
    }

    /// Whether the chords of a sector's seam are near it.
    fn seam_sight(&self, fan: &Fan, sector: &Sector, ends: [Point3; 2]) -> Sight {
        let pieces: Vec<[Point3; 2]> = match &sector.corner {
            None => vec![ends],
            Some(corner) => ends.iter().map(|&p| [p, fan.seam(corner)]).collect(),
        };
        let is_rough = |(piece, ends): (usize, &[Point3; 2])| {
            !self.is_near_chord(fan.seam(&fan.between(sector, piece).0), *ends)
        };
        let rough: Vec<bool> = pieces.iter().enumerate().map(is_rough).collect();
        // Between two arcs of the double curve the strip needs vertices that are on none: another
        // sheet may have edges from one to the other, too.
        let is_end = |k: usize| {
            let d = &fan.directions[k];
            fan.is_fold(d) || d.factors.iter().any(|f| self.curves.double.contains(f))
        };
        let crowded = sector.rays.iter().all(|r| is_end(r.0));
        Sight {
            fine: !crowded && !rough.contains(&true),
            longest: pieces
                .iter()
                .map(|[p, r]| distance(*p, *r))
                .fold(0.0, f64::max),
            worse: usize::from(rough.len() > 1 && rough[1]),
            pieces,
        }
    }

    /// Whether a point of a curve is near to a straight piece that stands for it and that is not
    /// divided any more, and the piece short. It may be anywhere along it: where arcs touch faces
    /// of the box, a curve leaves its end like a square root.
    fn is_near_chord(&self, on: Point3, [p, q]: [Point3; 2]) -> bool {
        distance_to_segment(on, [p, q]) <= 0.5 * self.atlas.tolerance_at(on)
            && distance(p, q) <= self.atlas.options.longest
    }
    /// Whether the middle of a straight piece is near to the surface, and the piece short.
    fn is_near(&self, on: Point3, chord: Point3, ends: [Point3; 2]) -> bool {
        distance(on, chord) <= 0.5 * self.atlas.tolerance_at(chord)
            && distance(ends[0], ends[1]) <= self.atlas.options.longest
    }
}

impl Sight {
    /// Looks at the sector in a unit triangle, too.
    fn take_in(&mut self, wedge: &Wedge<'_>) {
        let (fan, sector) = (wedge.fan, wedge.sector);
        if let [chord] = self.pieces[..] {
            let seam = fan.seam(&fan.between(sector, 0).0);
            if self.longest > SHORT * wedge.open.atlas.options.longest
                && wedge.is_crowded_by(seam, chord)
            {
                self.fine = false;
            }
        }
        if fan.is_tree() {
            let [p, r] = wedge.chord();
            self.longest = self.longest.max(distance(p, r));
        }
        if !wedge.is_near() || !wedge.keeps_sign() {
            if self.fine && sector.corner.is_some() {
                self.worse = wedge.wider_piece();
            }
            self.fine = false;
        }
    }
}

/// A direction between the rays of a sector of a tree, from one of its pieces of the seam: rays of
/// two nodes, and arcs, have their order next to the base point, but not everywhere.
fn direction_between(
    fan: &Fan,
    sector: &Sector,
    wedges: &[Wedge<'_>],
    worse: usize,
) -> Option<Direction> {
    let pieces = match sector.corner {
        Some(_) => vec![worse, 1 - worse],
        None => vec![0],
    };
    let in_the_middle = pieces.iter().map(|&piece| fan.between(sector, piece));
    let to_the_middle = pieces
        .iter()
        .flat_map(|&piece| wedges.iter().filter_map(move |w| w.ray_to_middle(piece)));
    in_the_middle
        .chain(to_the_middle)
        .find(|(d, backward)| wedges.iter().all(|w| w.is_between(d, *backward)))
        .map(|(d, _)| d)
}
