//! Opening of base points: rectangles around them, with vertices in the directions of their fans.
//!
//! A triangle with a base point as a corner becomes a quadrilateral, whose fourth side is a piece
//! of the seam curve.

mod fitting;
mod matching;
mod rays;
mod refining;
mod rings;
mod site;

use super::atlas::Atlas;
use super::geometry::distance;
use super::names::{ImageId, Name};
use super::places::distance2;
use super::special::SpecialCurves;
use super::{MAX_BISECTIONS, MAX_OPEN_BISECTIONS};
use crate::base::BasePoint;
use crate::fan::{Direction, Fan};
use crate::finding::{Finding, Phase};
use crate::surface::Point3;
use isoform_algebra::Poly;
use isoform_control::Stopped;
pub(super) use rings::RingVertex;
pub(super) use site::{Site, SiteArc};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum half width of a rectangle, in the unit triangle.
const MAX_HALF_WIDTH: f64 = 1.0 / 16.0;

/// The fans of the base points.
pub(super) struct Fans {
    fans: Vec<Fan>,
    findings: Vec<Finding>,
}

impl Fans {
    /// Computes the fans of all base points; if that is stopped, returns no fans but a finding.
    pub(super) fn new(atlas: &Atlas<'_>, points: &[BasePoint], w: &Poly) -> Self {
        let points = if atlas.region.is_clear { &[] } else { points };
        let fans: Result<Vec<Fan>, Stopped> = points
            .iter()
            .map(|p| Fan::new(p, atlas.region, w, atlas.control))
            .collect();
        match fans {
            Ok(fans) => Self {
                fans,
                findings: Vec::new(),
            },
            // The base points are left open.
            Err(Stopped) => Self {
                fans: Vec::new(),
                findings: vec![Finding::Stopped(Phase::Tangents)],
            },
        }
    }
    /// Returns the images of seams that are a single point.
    pub(super) fn contracted(&self) -> Vec<Point3> {
        self.fans
            .iter()
            .filter(|f| f.problem.is_none())
            .flat_map(|f| f.contracted().collect::<Vec<_>>())
            .collect()
    }
}

/// Bits of all faces of the box; only base points are on all of them.
pub(super) const ALL_FACES: u8 = 0b11_1111;

/// A point of a wall: quadrant, wall, and index on the wall.
pub(super) type WallPoint = (usize, usize, usize);

/// The seam of a node of a fan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SeamId {
    pub(super) fan: usize,
    pub(super) node: usize,
}

/// The opened base points in the region.
pub(super) struct Openings<'a> {
    pub(super) atlas: &'a Atlas<'a>,
    pub(super) curves: &'a SpecialCurves<'a>,
    pub(super) fans: Vec<Fan>,
    /// Base points, by points of walls.
    pub(super) sites: BTreeMap<WallPoint, Site>,
    /// Half widths of the rectangles around base points, by fan.
    pub(super) widths: Vec<f64>,
    /// Seams in which the surface ends.
    pub(super) folded: BTreeSet<SeamId>,
    /// Maximum number of bisections of intervals of curves.
    pub(super) halvings: usize,
    pub(super) findings: Vec<Finding>,
}

impl<'a> Openings<'a> {
    /// Returns true if a base point in the region has infinitely near ones.
    pub(super) fn has_trees(&self) -> bool {
        let mut sites = self.sites.values();
        sites.any(|s| self.fans[s.fan].is_tree())
    }
    /// Finds the base points in the region and the rectangles around them.
    pub(super) fn new(
        atlas: &'a Atlas<'a>,
        curves: &'a SpecialCurves<'a>,
        Fans { fans, findings }: Fans,
    ) -> Self {
        let mut open = Self {
            atlas,
            curves,
            widths: vec![MAX_HALF_WIDTH; fans.len()],
            fans,
            sites: BTreeMap::new(),
            folded: BTreeSet::new(),
            halvings: MAX_BISECTIONS,
            findings,
        };
        open.folded = open.folded_seams();
        let mut problems = open.find_sites();
        if !open.sites.is_empty() {
            problems.extend(open.match_arcs());
            if !open.fit() {
                problems.push(Finding::BasePointRough);
            }
        }
        if !problems.is_empty() {
            open.halvings = MAX_OPEN_BISECTIONS;
        }
        open.findings.extend(problems);
        open
    }
}

impl Openings<'_> {
    /// Finds the points of walls that are base points in the region, and returns the obstacles to
    /// opening them.
    fn find_sites(&mut self) -> Vec<Finding> {
        let mut problems = Vec::new();
        let region = self.atlas.region;
        if region.is_clear {
            return problems;
        }
        for (q, t) in region.triangles.iter().enumerate() {
            for (k, wall) in t.arrangement.walls.iter().enumerate() {
                for p in 0..wall.points.len() {
                    if t.holds_point(k, p) && self.atlas.faces_at(q, k, p) == ALL_FACES {
                        match self.site_at(q, k, p) {
                            Ok(site) => {
                                self.sites.insert((q, k, p), site);
                            }
                            Err(problem) => problems.push(problem),
                        }
                    }
                }
            }
        }
        problems
    }

    /// Returns the base point at a point of a wall.
    fn site_at(&self, q: usize, wall: usize, point: usize) -> Result<Site, Finding> {
        let region = self.atlas.region;
        if region.domain.is_some() && region.sides_of_point(q, wall, point) != 0 {
            return Err(Finding::BasePointOnSide);
        }
        let at = self.atlas.place(q, wall, point);
        // Both are known to rounding.
        let is_here = |f: &Fan| f.place(q).is_some_and(|x| distance2(x, at) < 1e-9);
        let fan = self
            .fans
            .iter()
            .position(is_here)
            .ok_or(Finding::BasePointUnrecognised)?;
        match &self.fans[fan].problem {
            Some(problem) => Err(problem.clone()),
            None => Ok(Site::new(fan, at)),
        }
    }

    /// Shrinks rectangles and adds directions until they fit; returns false if they never do.
    fn fit(&mut self) -> bool {
        self.widths = self
            .fans
            .iter()
            // Rays at infinitely near base points differ in high powers of the width only, which
            // has to be large to separate them.
            .map(|f| if f.is_tree() { 0.25 } else { MAX_HALF_WIDTH })
            .collect();
        let mut smaller = vec![0; self.fans.len()];
        // In each round, rectangles shrink or directions are added; base points that need more
        // rounds are left rough.
        for _ in 0..60 {
            if self.atlas.control.is_stopped() {
                return false;
            }
            let mut too_large = self.fit_rectangles();
            if too_large.is_empty() {
                too_large = self.refine_directions();
            }
            if too_large.is_empty() {
                return true;
            }
            // A rectangle of a tree shrinks at most forty times.
            let is_hopeless = |&f: &usize| self.fans[f].is_tree() && smaller[f] == 40;
            if too_large.iter().any(is_hopeless) {
                return false;
            }
            for f in too_large {
                self.widths[f] *= if self.fans[f].is_tree() { 0.75 } else { 0.5 };
                smaller[f] += 1;
            }
        }
        false
    }

    /// Iterates over the base points in a unit triangle, by quadrant, wall and point.
    pub(super) fn sites_in(&self, q: usize) -> impl Iterator<Item = (&WallPoint, &Site)> {
        self.sites.range((q, 0, 0)..(q + 1, 0, 0))
    }
    /// Returns the vertex of a seam in a direction: its name, which may be the image of a
    /// contracted curve, its position and its faces.
    pub(super) fn seam_vertex(&self, fan: usize, d: &Direction) -> (Name, Point3, u8) {
        let f = &self.fans[fan];
        let p = f.seam(d);
        let mut images: Vec<ImageId> = d
            .factors
            .iter()
            .filter_map(|f| self.curves.on_curve.get(f))
            .flatten()
            .copied()
            .collect();
        images.extend(
            f.sides_along(d)
                .filter_map(|side| self.curves.on_side[side]),
        );
        if f.is_contracted(d) {
            images.extend(self.curves.images().map(|x| x.0));
        }
        // Where a contracted curve leads to the point, the seam reaches its image up to this
        // distance.
        let close = 1e-6 * self.atlas.half_width;
        let near = |k: &ImageId| distance(self.curves.image(*k), p) <= close;
        match images.into_iter().find(near) {
            Some(k) => (Name::Image(k), self.curves.image(k), 0),
            None => (Name::Seam(fan, d.key()), p, d.faces),
        }
    }

    /// Returns the intersections of rectangles around base points with a side of the unit
    /// triangles: the place of each base point, and the places of the two vertices next to it.
    pub(super) fn places_on(&self, side: usize, quadrants: &[usize]) -> Vec<(f64, [f64; 2])> {
        let mut places: Vec<(f64, [f64; 2])> = Vec::new();
        for (&(q, _, _), site) in &self.sites {
            let ([u, v], h) = (site.at, self.widths[site.fan]);
            let (on, x, step) = [
                (u == 0.0, v, site.height),
                (v == 0.0, u, h),
                (u + v == 1.0, u, h),
            ][side];
            if quadrants.contains(&q) && on {
                places.push((x, [x - step, x + step]));
            }
        }
        places
    }
}
