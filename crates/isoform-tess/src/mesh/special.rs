//! Curves of the parameters that are drawn inside the region: contracted and double curves, and
//! cuspidal edges.

use super::Curves;
use super::atlas::Atlas;
use super::geometry::distance;
use super::names::ImageId;
use crate::deck::value;
use crate::map::Map;
use crate::surface::Point3;
use isoform_algebra::{Poly, RBig};
use isoform_geom::{cross, norm};
use std::collections::{BTreeMap, BTreeSet};

/// Magnitude of a form, relative to the size of its terms, up to which it is zero.
const MAX_ZERO_RATIO: f64 = 1e-7;

/// Roles of the factors of the region, and of the lines s = 0, t = 0, w = 0, besides poles and
/// faces of the box: contracted curves, double curves and cuspidal edges.
pub(super) struct SpecialCurves<'a> {
    atlas: &'a Atlas<'a>,
    /// Images of contracted curves.
    images: Vec<Point3>,
    /// Images of each contracted factor of the region; `on_side` has that of each contracted line.
    pub(super) on_curve: BTreeMap<usize, Vec<ImageId>>,
    pub(super) on_side: [Option<ImageId>; 3],
    /// Factors of the region that are double curves, including those on the border of a fundamental
    /// domain.
    pub(super) double: BTreeSet<usize>,
    /// Factors of the region that are cuspidal edges.
    creased: BTreeSet<usize>,
    /// Factors of the region on the border of a fundamental domain.
    pub(super) seams: BTreeSet<usize>,
    /// True for each of the lines that is a double curve.
    pub(super) double_sides: [bool; 3],
    /// True if sheets that cross are joined.
    pub(super) glued: bool,
}

impl<'a> SpecialCurves<'a> {
    /// Computes the roles from the map and the curves by which its region was decomposed.
    pub(super) fn new(atlas: &'a Atlas<'a>, map: &Map, curves: &Curves) -> Self {
        let mut found = Self {
            atlas,
            images: Vec::new(),
            on_curve: BTreeMap::new(),
            on_side: [None; 3],
            double: BTreeSet::new(),
            creased: BTreeSet::new(),
            seams: BTreeSet::new(),
            double_sides: curves.double_sides,
            glued: curves.glued,
        };
        found.find_contracted_lines(map);
        found.find_factors(curves);
        // Several sheets may end in one curve.
        if curves.glued {
            found.double.extend(atlas.region.folds());
            (0..3).for_each(|k| found.double_sides[k] |= atlas.region.is_fold_side(k));
        }
        found
    }

    /// Finds out which of the lines s = 0, t = 0, w = 0 the map contracts to a point.
    fn find_contracted_lines(&mut self, map: &Map) {
        for side in 0..3 {
            let on: [Poly; 4] = map.forms().each_ref().map(|f| f.set(side, &RBig::ZERO));
            let rest: Vec<&Poly> = on.iter().filter(|f| !f.is_zero()).collect();
            if rest.windows(2).all(|w| w[0].is_associate(w[1])) {
                let [x, y, z, w] = on
                    .each_ref()
                    .map(|f| f.leading_coefficient().to_f64().value());
                self.on_side[side] = Some(self.image_of([x / w, y / w, z / w]));
            }
        }
    }

    /// Assigns the factors of the curves in the region, in the order of [`Curves::forms`].
    fn find_factors(&mut self, curves: &Curves) {
        let mut extra = self.atlas.region.extra.iter();
        for (_, images) in &curves.contracted {
            let images: Vec<ImageId> = images.iter().map(|&p| self.image_of(p)).collect();
            for &f in extra.next().into_iter().flatten() {
                self.on_curve.entry(f).or_default().extend(&images);
            }
        }
        let mut factors =
            |n: usize| -> BTreeSet<usize> { extra.by_ref().take(n).flatten().copied().collect() };
        self.double = factors(curves.double.len());
        self.creased = factors(curves.creased.len());
        self.seams = factors(curves.seams().len());
        self.double.extend(&self.seams);
    }

    /// Adds the images of further contracted curves: seams that are a single point.
    pub(super) fn add_images(&mut self, images: &[Point3]) {
        for &p in images {
            self.image_of(p);
        }
    }

    /// Returns the index of an image, which is added if it is new.
    fn image_of(&mut self, p: Point3) -> ImageId {
        // Images are rounded algebraic numbers.
        let close = 1e-12 * self.atlas.half_width;
        let known = self.images.iter().position(|&q| distance(p, q) <= close);
        ImageId(known.unwrap_or_else(|| {
            self.images.push(p);
            self.images.len() - 1
        }))
    }
    /// Returns all images.
    pub(super) fn images(&self) -> impl ExactSizeIterator<Item = (ImageId, Point3)> {
        let numbered = self.images.iter().enumerate();
        numbered.map(|(k, &p)| (ImageId(k), p))
    }
    pub(super) fn image(&self, id: ImageId) -> Point3 {
        self.images[id.0]
    }

    /// Returns the contracted curve through a point of a wall, by its image.
    pub(super) fn image_at(&self, q: usize, wall: usize, point: usize) -> Option<ImageId> {
        let w = &self.atlas.region.triangles[q].arrangement.walls[wall];
        let mut factors = w.points[point].curves.iter().chain(&w.vertical);
        factors.find_map(|f| self.nearest_image(q, *f, self.atlas.place(q, wall, point)))
    }

    /// Returns the image of a contracted factor: the one nearest to the value of the map at a point
    /// of it.
    pub(super) fn nearest_image(&self, q: usize, factor: usize, at: [f64; 2]) -> Option<ImageId> {
        let images = self.on_curve.get(&factor)?;
        let p = self.atlas.charts[q].at(at);
        let far = |k: &ImageId| distance(self.image(*k), p);
        images
            .iter()
            .copied()
            .min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    /// Returns the curve that is drawn on a wall between a point and the next one, if any.
    pub(super) fn drawn_on(&self, q: usize, wall: usize, point: usize) -> Option<usize> {
        let t = &self.atlas.region.triangles[q];
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

    pub(super) fn is_drawn_inside(&self, factor: usize) -> bool {
        self.on_curve.contains_key(&factor)
            || self.double.contains(&factor)
            || self.creased.contains(&factor)
    }

    /// Returns the arcs of a slab that are drawn: those that have the region on one side, or on
    /// both and are contracted, double or cuspidal.
    pub(super) fn drawn(&self, q: usize, slab: usize) -> Vec<usize> {
        let t = &self.atlas.region.triangles[q];
        let inside = &t.inside[slab];
        let is_curve = |i: usize| self.is_drawn_inside(t.arrangement.slabs[slab].arcs[i].curve);
        (1..inside.len())
            .filter(|&i| inside[i - 1] != inside[i] || inside[i] && is_curve(i))
            .collect()
    }

    /// Returns true if a parameter lies on a contracted curve with an image, or if a deck
    /// transformation maps it to such a point, or is undefined there.
    pub(super) fn leads_to(&self, image: ImageId, p: [f64; 3]) -> bool {
        let is_on = |q: [f64; 3]| {
            let size = norm(q);
            let on_side = (0..3)
                .any(|k| self.on_side[k] == Some(image) && q[k].abs() <= MAX_ZERO_RATIO * size);
            let is_zero = |f: usize| {
                let (x, size) = value(&self.atlas.region.factors[f], q);
                x.abs() <= MAX_ZERO_RATIO * size
            };
            let mut factors = self.on_curve.iter().filter(|c| c.1.contains(&image));
            on_side || factors.any(|c| is_zero(*c.0))
        };
        is_on(p)
            || self
                .atlas
                .region
                .deck
                .as_ref()
                .is_some_and(|d| d.others(p).any(|q| q.is_none_or(is_on)))
    }

    /// Returns true if the vertices of a curve have partners; a contracted curve is a single
    /// vertex.
    pub(super) fn has_partners(&self, factor: usize) -> bool {
        self.double.contains(&factor) && !self.on_curve.contains_key(&factor)
    }

    /// Returns true if two parameters with one image may have one vertex: if sheets that cross are
    /// not joined, only equal ones and those exchanged by deck transformations.
    pub(super) fn may_share(&self, p: [f64; 3], q: [f64; 3]) -> bool {
        // Sine of the angle between two parameters that are one.
        let is_one = norm(cross(p, q)) <= 1e-9 * norm(p) * norm(q);
        self.glued
            || is_one
            || self
                .atlas
                .region
                .deck
                .as_ref()
                .is_some_and(|d| d.may_exchange(p, q))
    }
}
