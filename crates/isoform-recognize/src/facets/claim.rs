//! Assignment of triangles to surfaces: planes that cannot be facets first, then curved surfaces,
//! the remaining flat pieces, and finally pieces of one surface merged.

use super::flat::{Flats, has_many_corners};
use super::free::FreeFacets;
use super::mesh::Facets;
use super::part::{FacetPart, exact, follows, normals, turn};
use crate::chart::{Primitive, PrimitiveKind};
use crate::labels::UNLABELLED;
use isoform_control::{Control, Stopped};
use isoform_geom::Point3;
use rayon::prelude::*;

/// Maximum number of seed facets that lead to no curved surface before the search ends, and its
/// increase for each surface found: free-form faces have thousands of facets, each of which takes
/// some milliseconds.
const MAX_FAILED_SEEDS: (usize, usize) = (60, 10);
/// Maximum number of passes over the facets; a pass that finds no surface is the last.
const MAX_PASSES_OVER_FACETS: usize = 5;
/// Maximum number of flat pieces connected over smooth edges that are each taken for a plane; more
/// of them are a free-form face.
const MAX_CONNECTED_PLANES: usize = 3;

/// Parts of a mesh, and the part of each triangle.
pub(crate) struct Claims {
    pub(crate) parts: Vec<FacetPart>,
    pub(crate) taken: Vec<u32>,
}

/// Finds the parts of a mesh.
pub(crate) fn claim(
    mesh: &Facets,
    flats: &Flats,
    control: &Control<'_>,
) -> Result<Claims, Stopped> {
    let mut claims = Claims {
        parts: Vec::new(),
        taken: vec![UNLABELLED; mesh.triangles.len()],
    };
    let plain = |k: &u32| flats.is_plain(mesh, *k);
    let pieces = 0..flats.pieces.len() as u32;
    let plain: Vec<u32> = pieces.into_par_iter().filter(plain).collect();
    for k in plain {
        claims.add(flats.pieces[k as usize].clone());
    }
    claims.add_bent(mesh, flats, control)?;
    claims.give_rings(mesh);
    claims.complete(mesh);
    claims.add_flat(mesh, flats);
    claims.join(mesh);
    Ok(claims)
}

impl Claims {
    fn add(&mut self, part: FacetPart) {
        let id = self.parts.len() as u32;
        for t in &part.triangles {
            self.taken[*t as usize] = id;
        }
        self.parts.push(part);
    }

    /// Adds curved surfaces, starting from the largest facets, in passes until one finds none: once
    /// their neighbours of equal size are taken, further facets lead to surfaces.
    fn add_bent(
        &mut self,
        mesh: &Facets,
        flats: &Flats,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let pieces = 0..flats.pieces.len() as u32;
        let may = |k: &u32| has_smooth_edge(mesh, flats, *k);
        let mut order: Vec<u32> = pieces.into_par_iter().filter(may).collect();
        let area = |k: &u32| flats.areas[*k as usize];
        order.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b)));
        let (mut found, mut failures) = (0, 0);
        for pass in 0..MAX_PASSES_OVER_FACETS {
            control.report("recognize", pass as f64 / MAX_PASSES_OVER_FACETS as f64);
            let before = found;
            for piece in &order {
                let seed = flats.pieces[*piece as usize].triangles[0];
                if self.taken[seed as usize] != UNLABELLED {
                    continue;
                }
                control.check()?;
                if failures >= MAX_FAILED_SEEDS.0 + MAX_FAILED_SEEDS.1 * found {
                    return Ok(());
                }
                let free = FreeFacets {
                    mesh,
                    flats,
                    taken: &self.taken,
                    parts: &self.parts,
                };
                match free.best(*piece) {
                    Some(part) => {
                        found += 1;
                        self.add(without_cuts(mesh, part));
                    }
                    None => failures += 1,
                }
            }
            if found == before {
                break;
            }
        }
        Ok(())
    }

    /// Returns the curved surfaces found so far, with the indices of their parts.
    fn bent(&self) -> Vec<(usize, Primitive)> {
        let surfaces = self.parts.iter().map(|p| p.surface).enumerate();
        surfaces
            .filter(|s| s.1.kind != PrimitiveKind::Plane)
            .collect()
    }

    /// Moves parts all of whose facets follow larger curved parts to these, the smallest first:
    /// planes such as the middle facets of a round and of the spheres at its ends, and rings that
    /// were found before their torus.
    fn give_rings(&mut self, mesh: &Facets) {
        let bent = self.bent();
        let mut order: Vec<usize> = (0..self.parts.len()).collect();
        let size = |parts: &[FacetPart], k: usize| parts[k].triangles.len();
        order.sort_by_key(|k| (size(&self.parts, *k), *k));
        for old in order {
            let part = &self.parts[old];
            let larger: Vec<&(usize, Primitive)> = bent
                .iter()
                .filter(|(k, _)| {
                    let is_plane = part.surface.kind == PrimitiveKind::Plane;
                    *k != old && (is_plane || size(&self.parts, *k) > part.triangles.len())
                })
                .collect();
            let of = |t: &u32| {
                let mut all = larger.iter();
                all.find(|s| follows(mesh, &s.1, *t)).map(|s| s.0)
            };
            let new: Option<Vec<usize>> = part.triangles.iter().map(of).collect();
            let Some(new) = new.filter(|new| !new.is_empty()) else {
                continue;
            };
            // The top ring of a torus is flat; a flat on a sphere is not one of its facets.
            let is_one = new.iter().all(|k| *k == new[0]);
            let is_torus = self.parts[new[0]].surface.kind == PrimitiveKind::Torus;
            let is_plane = part.surface.kind == PrimitiveKind::Plane;
            if is_plane
                && is_one
                && !is_torus
                && has_many_corners(mesh, &part.surface, &part.triangles)
            {
                continue;
            }
            let moved = std::mem::take(&mut self.parts[old].triangles);
            for (t, k) in moved.into_iter().zip(new) {
                self.taken[t as usize] = k as u32;
                self.parts[k].triangles.push(t);
            }
        }
    }

    /// Adds free triangles that lie on a bent surface apart from its part.
    fn complete(&mut self, mesh: &Facets) {
        let surfaces = self.bent();
        let open =
            (0..mesh.triangles.len() as u32).filter(|t| self.taken[*t as usize] == UNLABELLED);
        let open: Vec<u32> = open.collect();
        let of = |t: &u32| {
            let mut on = surfaces.iter().filter(|s| follows(mesh, &s.1, *t));
            on.next().map(|s| (s.0, *t))
        };
        let found: Vec<(usize, u32)> = open.par_iter().filter_map(of).collect();
        for (k, t) in found {
            self.taken[t as usize] = k as u32;
            self.parts[k].triangles.push(t);
        }
        self.parts
            .iter_mut()
            .for_each(|p| p.triangles.sort_unstable());
    }

    /// Adds planes for the remaining triangles: flat pieces in short rows. Longer rows over smooth
    /// edges are faces of a free form.
    fn add_flat(&mut self, mesh: &Facets, flats: &Flats) {
        let is_left = |k: u32| {
            let first = flats.pieces[k as usize].triangles[0];
            self.taken[first as usize] == UNLABELLED
        };
        let mut rows = isoform_geom::UnionFind::new(flats.pieces.len());
        for t in 0..mesh.triangles.len() as u32 {
            for u in mesh.near(t) {
                let [a, b] = [t, *u].map(|t| flats.of[t as usize]);
                if a != b && is_left(a) && is_left(b) && flats.are_alike(mesh, [t, *u]) {
                    rows.unite(a, b);
                }
            }
        }
        let mut sizes = vec![0; flats.pieces.len()];
        (0..flats.pieces.len() as u32).for_each(|k| sizes[rows.root(k) as usize] += 1);
        let pieces = (0..flats.pieces.len() as u32).filter(|k| {
            let of = &flats.pieces[*k as usize].triangles;
            is_left(*k)
                && sizes[rows.root(*k) as usize] <= MAX_CONNECTED_PLANES
                && is_face(mesh, flats, of)
        });
        let new: Vec<FacetPart> = pieces.map(|k| flats.pieces[k as usize].clone()).collect();
        for mut part in new {
            part.triangles
                .retain(|t| self.taken[*t as usize] == UNLABELLED);
            self.add(part);
        }
    }

    /// Joins parts of one surface, the largest first, and fits each to all its vertices.
    fn join(&mut self, mesh: &Facets) {
        let mut order = std::mem::take(&mut self.parts);
        order.retain(|p| !p.triangles.is_empty());
        let key = |p: &FacetPart| (std::cmp::Reverse(p.triangles.len()), p.triangles[0]);
        order.sort_by_key(key);
        let mut joined: Vec<FacetPart> = Vec::new();
        for part in order {
            let same = joined.iter().enumerate().find_map(|(k, large)| {
                let one = together(mesh, large, &part)?;
                Some((k, one))
            });
            match same {
                Some((k, surface)) => {
                    joined[k].surface = surface;
                    joined[k].triangles.extend(part.triangles);
                }
                None => joined.push(part),
            }
        }
        self.taken.fill(UNLABELLED);
        for mut part in joined {
            part.triangles.sort_unstable();
            self.add(part);
        }
    }
}

/// Returns true if triangles in one plane are a face: if they have four vertices, or if a triangle
/// has others around it and meets one of them at a sharp edge. A triangle that continues smoothly
/// into all of them is a scrap of their surface.
fn is_face(mesh: &Facets, flats: &Flats, of: &[u32]) -> bool {
    let near = mesh.near(of[0]);
    let is_sharp = |u: &u32| !flats.are_alike(mesh, [of[0], *u]);
    mesh.vertices(of).len() > 3 || near.len() >= 3 && near.iter().any(is_sharp)
}

/// Returns true if a flat piece may be a facet of a curved surface.
fn has_smooth_edge(mesh: &Facets, flats: &Flats, piece: u32) -> bool {
    flats.pieces[piece as usize].triangles.iter().any(|t| {
        let others = mesh.near(*t).iter();
        let mut others = others.filter(|u| flats.of[**u as usize] != piece);
        others.any(|u| flats.are_alike(mesh, [*t, *u]))
    })
}

/// Removes facets that are flat cuts into the surface of a part.
fn without_cuts(mesh: &Facets, mut part: FacetPart) -> FacetPart {
    let normals = |t: &u32| normals(&part.surface, mesh.corners(*t), mesh.tolerance);
    let of = |t: &u32| turn(normals(t)).acos();
    let turns: Vec<f64> = part.triangles.iter().map(of).collect();
    let mut sorted = turns.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[(sorted.len() - 1) * 90 / 100];
    let mut turns = turns.into_iter();
    // A facet over which the surface turns 2.5 times as far as over 90 % of the facets is a flat
    // cut into it.
    part.triangles
        .retain(|_| turns.next().is_some_and(|turn| turn <= 2.5 * usual));
    part
}

/// Returns the common surface of two parts; `None` if they are not pieces of one.
fn together(mesh: &Facets, large: &FacetPart, small: &FacetPart) -> Option<Primitive> {
    if large.surface.kind != small.surface.kind {
        return None;
    }
    let near = |a: &FacetPart, b: &FacetPart| {
        let some = b.triangles.iter().take(MAX_CONNECTED_PLANES);
        let mut corners = some.flat_map(|t| mesh.corners(*t));
        // Each piece of a surface is extrapolated from where it is known.
        corners.all(|p| a.surface.distance(p).abs() <= 1000.0 * mesh.tolerance)
    };
    if !near(large, small) && !near(small, large) {
        return None;
    }
    let both = [&large.triangles[..], &small.triangles].concat();
    let surface = exact(mesh, &large.surface, &both)?;
    let is_on = |p: Point3| surface.distance(p).abs() <= mesh.tolerance;
    let is_whole = both.iter().all(|t| mesh.corners(*t).into_iter().all(is_on));
    is_whole.then_some(surface)
}
