//! Curved surfaces about a facet: hypotheses from the facets around it are grown as far as they
//! hold, and the one that explains most is kept.

use super::evidence::shows;
use super::flat::MAX_AREA_RATIO;
use super::free::FreeFacets;
use super::mesh::Facets;
use super::part::{FacetPart, MAX_FITTED_TRIANGLES, corners, exact, follows, grow};
use crate::chart::{Primitive, PrimitiveKind, unit};
use crate::fit::{Precision, fit};
use crate::start::starts;
use isoform_geom::{Point3, dot};
use rayon::prelude::*;

/// Maximum number of triangles of each set that hypotheses are made from, and the maximum ratio of
/// the areas of neighbours in it. Small sets stay within small faces, large ones show the curvature
/// of fine meshes; one face often has facets of one size.
const HYPOTHESIS_SETS: [(usize, f64); 7] = [
    (7, 1.5),
    (24, 1.5),
    (7, MAX_AREA_RATIO),
    (14, MAX_AREA_RATIO),
    (48, MAX_AREA_RATIO),
    (200, f64::INFINITY),
    (800, f64::INFINITY),
];
/// Curved kinds, the simplest first. Developable ones come before the sphere, though that has fewer
/// parameters, since any two rings of vertices lie on a sphere.
const KINDS: [PrimitiveKind; 4] = [
    PrimitiveKind::Cylinder,
    PrimitiveKind::Cone,
    PrimitiveKind::Sphere,
    PrimitiveKind::Torus,
];

impl FreeFacets<'_> {
    /// Returns the curved surface about a flat piece that explains the most triangles.
    pub(crate) fn best(&self, piece: u32) -> Option<FacetPart> {
        let sets = self.sets(piece);
        let mut found = Vec::new();
        for kind in KINDS {
            found.extend(self.largest(kind, &sets, &found));
        }
        let best = simplest(found.into_iter())?;
        if !matches!(
            best.surface.kind,
            PrimitiveKind::Cylinder | PrimitiveKind::Cone
        ) {
            return Some(best);
        }
        // Each ring of facets of a sphere or a torus is also a cone.
        let wider = [self.widened(&best.triangles)];
        let known = [best];
        let found = KINDS[2..].iter();
        let found: Vec<FacetPart> = found
            .filter_map(|kind| self.largest(*kind, &wider, &known))
            .collect();
        simplest(known.into_iter().chain(found))
    }

    /// Returns sets of triangles that hypotheses are made from.
    fn sets(&self, piece: u32) -> Vec<Vec<u32>> {
        let own = self.large(piece);
        let mut beside: Vec<u32> = Vec::new();
        for t in &own {
            for u in self.mesh.near(*t) {
                let other = self.flats.of[*u as usize];
                let is_new = other != piece && !beside.contains(&other);
                if is_new && self.is_free(*u) && self.flats.are_alike(self.mesh, [*t, *u]) {
                    beside.push(other);
                }
            }
        }
        // Pairs are tried with six adjacent facets.
        beside.truncate(6);
        let beside: Vec<Vec<u32>> = beside.iter().map(|p| self.large(*p)).collect();
        let mut sets = Vec::new();
        for (k, a) in beside.iter().enumerate() {
            for b in &beside[k + 1..] {
                sets.push([&own[..], a, b].concat());
            }
        }
        for (most, factor) in HYPOTHESIS_SETS {
            let set = self.ball(own[0], most, factor);
            if !sets.contains(&set) {
                sets.push(set);
            }
        }
        sets
    }

    /// Returns the triangles of a flat piece that are comparable to its largest one: slivers may be
    /// of another face, whose facet happens to lie in an equal plane.
    fn large(&self, piece: u32) -> Vec<u32> {
        let all = self.flats.pieces[piece as usize].triangles.iter().copied();
        let area = |t: u32| self.mesh.areas[t as usize];
        let largest = all.clone().map(area).fold(0.0, f64::max);
        all.filter(|t| MAX_AREA_RATIO * area(*t) >= largest)
            .collect()
    }

    /// Returns the free triangles nearest to one, across smooth edges at which areas differ by less
    /// than a factor.
    fn ball(&self, seed: u32, most: usize, factor: f64) -> Vec<u32> {
        let (mut all, mut at) = (vec![seed], 0);
        let mut seen = std::collections::BTreeSet::from([seed]);
        while at < all.len() && all.len() < most {
            let t = all[at];
            for u in self.mesh.near(t) {
                let continues = self.flats.are_within(self.mesh, [t, *u], factor);
                if self.is_free(*u) && continues && seen.insert(*u) {
                    all.push(*u);
                }
            }
            at += 1;
        }
        all
    }

    /// Extends triangles by the free ones that continue them.
    fn widened(&self, of: &[u32]) -> Vec<u32> {
        let mut all = of.to_vec();
        for _ in 0..2 {
            let smooth = |t: &u32| {
                let near = self.mesh.near(*t).iter().copied();
                let t = *t;
                near.filter(move |u| self.is_free(*u) && self.flats.are_alike(self.mesh, [t, *u]))
            };
            let more: Vec<u32> = all.iter().flat_map(smooth).collect();
            all.extend(more);
            all.sort_unstable();
            all.dedup();
        }
        all
    }

    /// Returns the largest part of a kind that the sets lead to, other than those known.
    fn largest(
        &self,
        kind: PrimitiveKind,
        sets: &[Vec<u32>],
        known: &[FacetPart],
    ) -> Option<FacetPart> {
        let tried: Vec<Vec<Primitive>> = sets
            .par_iter()
            .map(|set| self.hypotheses(kind, set))
            .collect();
        let mut best: Option<FacetPart> = None;
        for (set, surfaces) in sets.iter().zip(tried) {
            for surface in surfaces {
                let is_known = |part: &FacetPart| {
                    is_same(self.mesh, [&surface, &part.surface], &part.triangles)
                        || is_same(self.mesh, [&surface, &part.surface], set)
                };
                if known.iter().chain(&best).any(is_known) {
                    continue;
                }
                let Some(part) = grow(self.mesh, set, surface, &|t| self.is_free(t)) else {
                    continue;
                };
                let is_larger = |b: &FacetPart| part.triangles.len() > b.triangles.len();
                if best.as_ref().is_none_or(is_larger) && shows(self, &part) {
                    best = Some(part);
                }
            }
        }
        best
    }

    /// Returns surfaces of a kind that all vertices of a set lie on.
    fn hypotheses(&self, kind: PrimitiveKind, set: &[u32]) -> Vec<Primitive> {
        let mesh = self.mesh;
        let vertices = mesh.vertices(set);
        if vertices.len() <= kind.parameters() {
            return Vec::new();
        }
        let (tangent, facets) = self.tangent_planes(set);
        let smooth = self.smooth(set, &vertices);
        let step = vertices.len().div_ceil(MAX_FITTED_TRIANGLES).max(1);
        let some = |of: &[Point3]| -> Vec<Point3> { of.iter().copied().step_by(step).collect() };
        let (points, smooth) = (some(&mesh.at(&vertices)), some(&smooth));
        let mut from = match kind {
            PrimitiveKind::Cylinder | PrimitiveKind::Cone => starts(kind, &tangent, &facets),
            _ => Vec::new(),
        };
        from.extend(starts(kind, &points, &smooth));
        let roughly = |s: &Primitive| -> Option<Primitive> {
            let (surface, squares) = fit(s, &points, Precision::Rough)?;
            // A smaller limit would lose surfaces whose fit converges slowly, a larger one takes
            // time at free-form faces.
            let limit = (100.0 * mesh.tolerance).powi(2) * points.len() as f64;
            (squares <= limit).then_some(surface)
        };
        let fitted = from.iter().filter_map(roughly);
        let fitted = fitted.filter_map(|s| exact(mesh, &s, set));
        fitted
            .filter(|s| set.iter().all(|t| follows(mesh, s, *t)))
            .collect()
    }

    /// Returns corners of facets, each with the normal of its facet: tangent planes of developable
    /// surfaces.
    fn tangent_planes(&self, set: &[u32]) -> (Vec<Point3>, Vec<Point3>) {
        let step = (3 * set.len()).div_ceil(MAX_FITTED_TRIANGLES).max(1);
        let of = |t: &u32| {
            let n = self.mesh.normals[*t as usize];
            self.mesh.corners(*t).map(|p| (p, n))
        };
        set.iter().step_by(step).flat_map(of).unzip()
    }

    /// Returns normals at vertices: the sum of those of the facets at each, weighted by area.
    fn smooth(&self, set: &[u32], vertices: &[u32]) -> Vec<Point3> {
        let mut sums = vec![[0.0; 3]; vertices.len()];
        for t in set {
            let (n, area) = (self.mesh.normals[*t as usize], self.mesh.areas[*t as usize]);
            for v in self.mesh.triangles[*t as usize] {
                let k = vertices.partition_point(|w| *w < v);
                for i in 0..3 {
                    sums[k][i] += area * n[i];
                }
            }
        }
        sums.into_iter().map(unit).collect()
    }
}

/// Returns true if two surfaces coincide over triangles that lie on one of them.
fn is_same(mesh: &Facets, [a, b]: [&Primitive; 2], of: &[u32]) -> bool {
    let mut corners = corners(mesh, of).into_iter();
    corners.all(|p| {
        let are_near = [a, b].map(|s| s.distance(p).abs() <= mesh.tolerance);
        // Normals of one surface, given twice, differ by less than 0.08°. A smaller cosine would
        // take a torus for the cone of a narrow ring of it.
        are_near == [true; 2] && dot(a.normal(p), b.normal(p)).abs() > 0.999_999
    })
}

/// Returns the first of parts, by rising kind, unless another one explains many more triangles.
fn simplest(parts: impl Iterator<Item = FacetPart>) -> Option<FacetPart> {
    parts.fold(None, |best: Option<FacetPart>, part| match best {
        // A kind with more parameters has to explain 15 % more triangles.
        Some(b) if (part.triangles.len() as f64) < 1.15 * b.triangles.len() as f64 => Some(b),
        _ => Some(part),
    })
}
