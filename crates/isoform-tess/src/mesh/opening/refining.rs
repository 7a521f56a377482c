//! Refinement of the directions of base points, until seams and rectangles are near the surface.
//!
//! A sector between two rays is tested in three ways: its pieces of the seam (`SeamQuality`), its
//! part of the rectangle in each unit triangle (`SectorStrip`), and the sign of W in between. A
//! sector that fails gets a direction in between; if no direction helps, the rectangle is too
//! large.

use super::Openings;
use super::site::{Site, SiteArc};
use crate::fan::{Direction, Fan, Sector};
use crate::mesh::chart::keeps_sign_on;
use crate::mesh::geometry::{distance, middle};
use crate::mesh::names::Ray;
use crate::surface::Point3;
use isoform_geom::distance_to_segment;
use std::collections::BTreeSet;

/// Result of the test of a sector.
enum SectorVerdict {
    Fine,
    /// The sector needs this direction inside.
    Split(Direction),
    /// The rectangle has to be smaller.
    TooLarge,
}

/// Quality of the chords of a sector's seam, updated for each of its unit triangles.
struct SeamQuality {
    /// Pieces of the seam: one, or two that meet in a corner.
    pieces: Vec<[Point3; 2]>,
    /// True while no further direction is needed.
    fine: bool,
    /// Length of the longest piece or, in trees, of the longest edge of the rectangle.
    longest: f64,
    /// Index of the piece that is to be split first.
    worse: usize,
}

/// Sector of a fan in a unit triangle: the part of a rectangle between two rays.
struct SectorStrip<'a> {
    open: &'a Openings<'a>,
    fan: &'a Fan,
    sector: &'a Sector,
    q: usize,
    site: &'a Site,
    /// Places where its rays leave the rectangle.
    ends: [[f64; 2]; 2],
}

fn cross([a, b]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    a * y - b * x
}
fn halfway(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
}

impl<'a> SectorStrip<'a> {
    /// Creates the part of a sector in a unit triangle; `None` if the sector does not lead into it.
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
    /// Returns true if two places follow each other around the base point in the orientation of the
    /// fan.
    fn are_in_turn(&self, a: [f64; 2], b: [f64; 2]) -> bool {
        let turn = cross(self.seen_from_base(a), self.seen_from_base(b));
        if self.fan.keeps_turn(self.q) {
            turn > 0.0
        } else {
            turn < 0.0
        }
    }
    /// Returns true if the ends are in the wrong order: an arc that bends away from its tangent may
    /// pass the next direction.
    fn is_turned_over(&self) -> bool {
        let [a, b] = self.ends;
        !self.are_in_turn(a, b)
    }
    /// Returns the edge of the rectangle, in space.
    fn chord(&self) -> [Point3; 2] {
        self.ends.map(|x| self.image(x))
    }
    /// Returns the point of the surface at the middle of the edge of the rectangle.
    fn middle(&self) -> Point3 {
        self.image(halfway(self.ends[0], self.ends[1]))
    }
    /// Returns the drawn arc in an end, if there is one.
    fn arc(&self, end: usize) -> Option<&SiteArc> {
        let (k, backward) = self.sector.rays[end];
        let ray = (self.fan.directions[k].key(), backward);
        let mut arcs = self.site.arcs.iter();
        arcs.find(|x| x.ray == ray && x.end == self.ends[end])
    }
    /// Returns true if segments from points of the seam to the rectangle may replace the rays. In
    /// trees, strips have vertices in between.
    fn are_rays_near(&self, seam: [Point3; 2]) -> bool {
        self.fan.is_tree()
            || (0..2).all(|end| {
                let at = self.ends[end];
                let (k, backward) = self.sector.rays[end];
                // The midpoint of an arc, not of its chord: the arc bounds the surface.
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
    /// Returns true if the seam bulges beyond its chord by more than the width of the strip between
    /// the chord and the edge of the rectangle.
    fn is_crowded_by(&self, seam: Point3, chord: [Point3; 2]) -> bool {
        let on = self.middle();
        let bulge = distance_to_segment(seam, chord);
        let width = distance_to_segment(on, chord).min(distance(on, seam));
        // Otherwise vertices on the rectangle would lie on the wrong side of the chord.
        bulge > width
    }
    /// Returns true if the edge of the rectangle is near the surface.
    fn is_near(&self) -> bool {
        let (on, chord) = (self.middle(), self.chord());
        let straight = middle(chord[0], chord[1]);
        if !self.fan.is_tree() {
            return self.open.is_near(on, straight, chord);
        }
        // In trees, where the map is far from even, the point may slide along the chord, but not so
        // far that triangles next to it become uneven.
        let off = distance(on, straight);
        let is_even = off <= 0.15 * distance(chord[0], chord[1])
            || off <= 0.5 * self.open.atlas.tolerance_at(on);
        is_even && self.open.is_near_chord(on, chord)
    }
    /// Returns true if W provably keeps its sign between the base point and the rectangle.
    fn keeps_sign(&self) -> bool {
        let ([a, b], fan) = (self.ends, self.fan);
        let chart = &self.open.atlas.charts[self.q];
        chart.keeps_sign([self.site.at, a, b], fan.multiplicity)
            // The parameters inside are in a cell of the region, in which W has no zero; edges of
            // the rectangle that leave the cell remain to be tested.
            || fan.is_tree()
                && chart.keeps_sign([a, b, a], 0)
                && fan.keeps_sign(self.q, self.sector, &self.outline(), &keeps_sign_on)
    }
    /// Returns parameters on the outline: on arcs, on bent rays, and on the edge of the rectangle.
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
    /// Returns the index of the piece of the seam whose middle ray is farther away from the ends.
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
    /// Returns true if arcs with one tangent are in order on the rectangle, and W keeps its sign
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
    /// Returns true if a ray leaves the rectangle between the ends.
    fn is_between(&self, d: &Direction, backward: bool) -> bool {
        let [a, b] = self.ends;
        let at = self.open.ray(self.q, self.site, d, backward).end();
        at.is_some_and(|x| self.are_in_turn(a, x) && self.are_in_turn(x, b))
    }
    /// Returns the ray towards the middle of the edge of the rectangle, from a piece of the seam.
    fn ray_to_middle(&self, piece: usize) -> Option<(Direction, bool)> {
        let to = halfway(self.ends[0], self.ends[1]);
        self.fan.toward(self.q, to, self.sector, piece)
    }
}

impl Openings<'_> {
    /// Adds directions until seams and rectangles are near the surface and W keeps its sign.
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

    /// Splits the sectors of a fan. Returns false if its rectangle is too large.
    fn refine_fan(&self, fan: &mut Fan, sites: &[(usize, &Site)]) -> bool {
        // Sectors are identified by their rays: splitting one does not change the others.
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
                    SectorVerdict::Fine => {
                        done.insert(name);
                    }
                    // A base point with more directions is left rough.
                    SectorVerdict::Split(d) if fan.directions.len() < 2000 => {
                        fan.split(d);
                        continue 'again;
                    }
                    SectorVerdict::Split(_) | SectorVerdict::TooLarge => return false,
                }
            }
            return true;
        }
    }

    /// Tests a sector: its seam, and its part of the rectangle in each unit triangle.
    fn judge(&self, fan: &Fan, sector: &Sector, sites: &[(usize, &Site)]) -> SectorVerdict {
        let ends = sector.rays.map(|(k, _)| fan.seam(&fan.directions[k]));
        let wedges: Vec<SectorStrip<'_>> = sites
            .iter()
            .filter_map(|&site| SectorStrip::new(self, fan, sector, site))
            .collect();
        let mut sight = self.seam_sight(fan, sector, ends);
        for wedge in &wedges {
            if wedge.is_turned_over() || !wedge.are_rays_near(ends) {
                return SectorVerdict::TooLarge;
            }
            sight.take_in(wedge);
            if !wedge.are_arcs_apart() {
                return SectorVerdict::TooLarge;
            }
        }
        // Splitting a shorter seam, in tolerances, does not help: an arc is too far from its
        // tangent. In trees, rays of several nodes are dense.
        let least = if fan.is_tree() { 0.01 } else { 0.1 };
        if sight.fine {
            SectorVerdict::Fine
        } else if sight.longest < least * self.atlas.tolerance_at(ends[0]) {
            SectorVerdict::TooLarge
        } else if fan.is_tree() {
            direction_between(fan, sector, &wedges, sight.worse)
                .map_or(SectorVerdict::TooLarge, SectorVerdict::Split)
        } else {
            SectorVerdict::Split(fan.between(sector, 0).0)
        }
    }

    /// Returns the quality of the chords of a sector's seam.
    fn seam_sight(&self, fan: &Fan, sector: &Sector, ends: [Point3; 2]) -> SeamQuality {
        let pieces: Vec<[Point3; 2]> = match &sector.corner {
            None => vec![ends],
            Some(corner) => ends.iter().map(|&p| [p, fan.seam(corner)]).collect(),
        };
        let is_rough = |(piece, ends): (usize, &[Point3; 2])| {
            !self.is_near_chord(fan.seam(&fan.between(sector, piece).0), *ends)
        };
        let rough: Vec<bool> = pieces.iter().enumerate().map(is_rough).collect();
        // Between two arcs of the double curve the strip needs vertices that are on neither:
        // another sheet may have edges from one to the other, too.
        let is_end = |k: usize| {
            let d = &fan.directions[k];
            fan.is_fold(d) || d.factors.iter().any(|f| self.curves.double.contains(f))
        };
        let crowded = sector.rays.iter().all(|r| is_end(r.0));
        SeamQuality {
            fine: !crowded && !rough.contains(&true),
            longest: pieces
                .iter()
                .map(|[p, r]| distance(*p, *r))
                .fold(0.0, f64::max),
            worse: usize::from(rough.len() > 1 && rough[1]),
            pieces,
        }
    }

    /// Returns true if a point of a curve is near the chord that replaces it, and the chord is
    /// short. The point may be anywhere along the chord: where arcs touch faces of the box, a curve
    /// leaves its end like a square root.
    fn is_near_chord(&self, on: Point3, [p, q]: [Point3; 2]) -> bool {
        distance_to_segment(on, [p, q]) <= 0.5 * self.atlas.tolerance_at(on)
            && distance(p, q) <= self.atlas.options.longest
    }
    /// Returns true if the middle of a chord is near the surface, and the chord is short.
    fn is_near(&self, on: Point3, chord: Point3, ends: [Point3; 2]) -> bool {
        distance(on, chord) <= 0.5 * self.atlas.tolerance_at(chord)
            && distance(ends[0], ends[1]) <= self.atlas.options.longest
    }
}

impl SeamQuality {
    /// Updates the quality by the part of the sector in a unit triangle.
    fn take_in(&mut self, wedge: &SectorStrip<'_>) {
        let (fan, sector) = (wedge.fan, wedge.sector);
        if let [chord] = self.pieces[..] {
            let seam = fan.seam(&fan.between(sector, 0).0);
            // Shorter chords of the seam are not split for their bulge.
            if self.longest > 0.003 * wedge.open.atlas.options.longest
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

/// Returns a direction between the rays of a sector of a tree, from one of its pieces of the seam.
/// Rays of two nodes, and arcs, are in order next to the base point, but not everywhere.
fn direction_between(
    fan: &Fan,
    sector: &Sector,
    wedges: &[SectorStrip<'_>],
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
