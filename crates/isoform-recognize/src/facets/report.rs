//! Report on the parts of a mesh, in the mesh's unit and order.

use super::claim::Claims;
use super::mesh::Facets;
use super::part::FacetPart;
use super::points::{FacetPoint, at_vertices};
use crate::accuracy::with_rounding;
use crate::blends::blends;
use crate::border::{largest_first, loops, sides};
use crate::chart::{MAX_PARAMETERS, Primitive, PrimitiveKind};
use crate::cloud::Scaling;
use crate::entity::{Deviations, Entity, Face, Recognition};
use crate::faces::FaceLabels;
use crate::fit::{Precision, covariance, fit, mean, squares};
use crate::labels::UNLABELLED;
use crate::patterns::patterns;
use crate::recognize::{Options, deviations_of};
use crate::relations::{EntitySet, UncertainSurface, relations};
use crate::symmetry::symmetries;
use isoform_geom::{Point3, dot};
use rayon::prelude::*;

/// Minimum share of its area by which the facets of a part face more to one side of the surface
/// than to the other; with less the side is undecided.
const MIN_SIDE_SHARE: f64 = 0.5;

/// Returns the recognition of the mesh's own points and of those inside faces.
pub(crate) fn report(
    mesh: &Facets,
    claims: &Claims,
    inside: &[FacetPoint],
    options: &Options,
    scaling: &Scaling,
) -> Recognition {
    let at_vertices = at_vertices(mesh, claims);
    let vertices = mesh.index.iter().map(|v| at_vertices[*v as usize]);
    let labels: Vec<u32> = vertices.chain(inside.iter().map(|p| p.part)).collect();
    let mut counts = vec![0; claims.parts.len()];
    let known = labels.iter().filter(|l| **l != UNLABELLED);
    known.for_each(|l| counts[*l as usize] += 1);
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.retain(|k| counts[*k] >= options.fewest_of_part());
    order.sort_by_key(|k| (std::cmp::Reverse(counts[*k]), *k));
    let mut rank = vec![None; counts.len()];
    for (new, old) in order.iter().enumerate() {
        rank[*old] = Some(new as u32);
    }
    let noise = options.noise.map_or(mesh.rounding, |n| n / scaling.unit);
    let noise = noise.max(f64::EPSILON);
    let described = |k: &usize| describe(mesh, &claims.parts[*k], counts[*k], noise, scaling);
    let described: Vec<(Entity, UncertainSurface)> = order.par_iter().map(described).collect();
    let (entities, known): (Vec<Entity>, Vec<UncertainSurface>) = described.into_iter().unzip();
    let rank = |l: &u32| rank.get(*l as usize).copied().flatten();
    let points: Vec<Vec<Point3>> = order
        .iter()
        .map(|k| mesh.at(&mesh.vertices(&claims.parts[*k].triangles)))
        .collect();
    let of = |t: u32| rank(&claims.taken[t as usize]).map(|l| l as usize);
    let pairs = mesh.pairs().filter_map(|(t, u)| Some((of(t)?, of(u)?)));
    let pairs = pairs.filter(|(a, b)| a != b);
    let outward: Vec<i8> = entities.iter().map(|e| e.outward).collect();
    let set = EntitySet {
        known: &known,
        outward: &outward,
        points: &points,
        noise,
    };
    let patterns = patterns(&set, (scaling.unit, scaling.origin));
    let (mut faces, face_labels, facets) = faces(mesh, claims, &at_vertices, inside, rank);
    add_borders(mesh, &known, &mut faces, &facets, scaling);
    Recognition {
        faces,
        face_labels,
        symmetries: symmetries(&set, &patterns, (scaling.unit, scaling.origin)),
        patterns,
        // An edge of the mesh is an edge of both faces.
        blends: blends(&known, &points, (pairs, 1), scaling.unit),
        relations: relations(&known, noise, scaling.unit),
        entities,
        normals: normals(mesh, inside),
        labels: labels.iter().map(rank).collect(),
        noise: noise * scaling.unit,
        is_form: false,
        free: 0.0,
        is_oriented: true,
    }
}

/// Returns the faces, facets of one part that are connected along edges, the face of each point, and
/// the facets of each face.
fn faces(
    mesh: &Facets,
    claims: &Claims,
    at_vertices: &[u32],
    inside: &[FacetPoint],
    rank: impl Fn(&u32) -> Option<u32>,
) -> (Vec<Face>, Vec<Option<u32>>, Vec<Vec<u32>>) {
    let faces =
        FaceLabels::from_pieces(mesh.pieces(&claims.taken).into_iter(), mesh.triangles.len());
    // A facet of the vertex's part, for each vertex.
    let mut facets = vec![UNLABELLED; mesh.points.len()];
    for (t, corners) in (0..).zip(&mesh.triangles) {
        for v in corners {
            if claims.taken[t as usize] == at_vertices[*v as usize] {
                facets[*v as usize] = t;
            }
        }
    }
    let vertices = mesh.index.iter().map(|v| facets[*v as usize]);
    let index = vertices.chain(inside.iter().map(|p| p.triangle));
    faces.report(|k| rank(&k), index, mesh.pairs())
}

/// Adds the borders of flat faces, given the surfaces and the facets of each face: edges of facets
/// that no other facet of the face shares.
fn add_borders(
    mesh: &Facets,
    known: &[UncertainSurface],
    faces: &mut [Face],
    members: &[Vec<u32>],
    scaling: &Scaling,
) {
    for (face, facets) in faces.iter_mut().zip(members) {
        if known[face.entity].surface.kind == PrimitiveKind::Plane {
            let sides = facets
                .iter()
                .flat_map(|t| sides(mesh.triangles[*t as usize]));
            let point = |v: u32| scaling.back(mesh.points[v as usize]);
            let rings = loops(sides).into_iter();
            let rings = rings.map(|ring| ring.into_iter().map(point).collect());
            face.border = largest_first(rings.collect());
        }
    }
}

/// Describes a part as an entity, and returns its surface with the covariance of its parameters.
fn describe(
    mesh: &Facets,
    part: &FacetPart,
    count: usize,
    noise: f64,
    scaling: &Scaling,
) -> (Entity, UncertainSurface) {
    let points = mesh.at(&mesh.vertices(&part.triangles));
    let fitted = fit(&part.surface, &points, Precision::Full);
    let mut surface = fitted.map_or(part.surface, |f| f.0).about(mean(&points));
    if surface.kind == PrimitiveKind::Cone && surface.other < 0.0 {
        surface.axis = surface.axis.map(|x| -x);
        surface.other = -surface.other;
    }
    let free = points
        .len()
        .saturating_sub(surface.kind.parameters())
        .max(1) as f64;
    let squares = squares(&surface, &points);
    // Few vertices may lie on a surface by chance more exactly than they were rounded.
    let sigma = (squares / free).sqrt().max(noise / 3.0_f64.sqrt());
    let variance = sigma * sigma;
    let covariance = covariance(&surface, &points).map(|c| {
        let c = c.map(|row| row.map(|x| x * variance));
        with_rounding(c, surface.kind, mesh.rounding)
    });
    let deviations = covariance
        .as_ref()
        .map_or(Deviations::OPEN, |c| deviations_of(&surface, c, scaling));
    let entity = Entity {
        surface: surface.quadric(scaling.unit, scaling.origin),
        deviations,
        outward: outward(mesh, part, &surface),
        points: count,
        rms: (squares / points.len() as f64).sqrt() * scaling.unit,
        extent: surface.extent(&points).map(|h| h * scaling.unit),
        label: None,
        is_explained: true,
    };
    (
        entity,
        UncertainSurface {
            surface,
            covariance: covariance.unwrap_or([[f64::INFINITY; MAX_PARAMETERS]; MAX_PARAMETERS]),
        },
    )
}

/// Returns the outer side of the surface by its facets: +1 that of its normal, −1 the opposite one,
/// 0 undecided.
fn outward(mesh: &Facets, part: &FacetPart, surface: &Primitive) -> i8 {
    let side = |t: &u32| {
        let n = surface.normal(middle_of(mesh, *t));
        mesh.areas[*t as usize] * dot(n, mesh.normals[*t as usize]).signum()
    };
    let sides: f64 = part.triangles.iter().map(side).sum();
    let share = sides / mesh.area(&part.triangles);
    i8::from(share > MIN_SIDE_SHARE) - i8::from(share < -MIN_SIDE_SHARE)
}

fn middle_of(mesh: &Facets, t: u32) -> Point3 {
    isoform_geom::middle(mesh.corners(t))
}

/// Returns unit normals: at the mesh's points the mean of the adjacent facets weighted by area,
/// inside faces those of the surface.
fn normals(mesh: &Facets, inside: &[FacetPoint]) -> Vec<Point3> {
    let mut sums = vec![[0.0; 3]; mesh.points.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        for v in corners {
            for (sum, n) in sums[*v as usize].iter_mut().zip(mesh.normals[t]) {
                *sum += mesh.areas[t] * n;
            }
        }
    }
    let at_vertices = mesh.index.iter();
    at_vertices
        .map(|v| crate::chart::unit(sums[*v as usize]))
        .chain(inside.iter().map(|p| p.normal))
        .collect()
}
