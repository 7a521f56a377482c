//! Meshes of functions fitted to points, restricted to the surface near the points.

use crate::mesh_model::{ModelMesh, mesh_solid};
use crate::meshing::usual_size;
use crate::{Implicit, MeshModelError, MeshModelOptions};
use isoform_check::{self as check, Limits, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, OnePiece, Point3, UnionFind, cross, middle, norm, sub};
use std::collections::{HashMap, HashSet};

/// Name of the part of triangles near points.
const SEEN_PART: &str = "surface";
/// Name of the part of triangles without points near them.
const UNSEEN_PART: &str = "unseen";

/// Maximum diagonal of a hole that counts as covered by points, in cells of the spline, measured
/// from one cell behind the points around it. Gaps of uneven sampling are smaller (4.2 in half of
/// the vertices of a rocker arm); regions that a scanner missed are larger.
const MAX_GAP_CELLS: f64 = 5.0;

/// Treatment of the surface far from all points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unseen {
    /// The surface is left out there, and gets a border.
    #[default]
    Cut,
    /// The surface is kept there, as a part called `unseen`.
    Close,
}

/// Meshes a function fitted to points and certifies the mesh, like
/// [`mesh_model`](crate::mesh_model) for a program; a surface that is cut may have a border. Meshes
/// of tetrahedra are not cut. Without a given box, the surface of a spline is searched from
/// the box of its points, and that of a polynomial is meshed in this box.
///
/// # Errors
/// [`MeshModelError`] if the mesh cannot be computed, or on a stop.
pub fn mesh_spline(
    spline: &Implicit,
    unseen: Unseen,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    let solid = OnePiece::new(spline.clone(), SEEN_PART);
    let domain = spline.domain();
    let region = options.mesh.region.unwrap_or(domain);
    let mut options = options.clone();
    options.size = options.size.or_else(|| Some(usual_size(region)));
    options.mesh.start = domain;
    if matches!(spline, Implicit::Polynomial(_)) {
        // A polynomial may be positive far away from its points.
        options.mesh.region = Some(region);
    }
    let mut made = mesh_solid(&solid, &options, control)?;
    let mesh = &mut made.meshed.mesh;
    let mut is_seen = seen_triangles(mesh, spline);
    drop_strays(mesh, spline, &mut is_seen);
    if is_seen.iter().all(|s| *s) {
        return Ok(made);
    }
    if unseen == Unseen::Cut && mesh.tets.is_empty() {
        join_fans(mesh, &mut is_seen);
        made.cut = is_seen.iter().filter(|s| !**s).count();
        cut(mesh, &is_seen);
        let wanted = check::Options {
            size: Some(made.options.size),
            region: made.options.region,
            limits: Limits {
                has_border: true,
                ..options.limits
            },
            ..check::Options::default()
        };
        made.certificate = certify(mesh, Some(&solid), &wanted, control);
    } else {
        let part = mesh.parts.len() as u32;
        mesh.parts.push(UNSEEN_PART.to_owned());
        mesh.triangle_parts.resize(mesh.triangles.len(), 0);
        for (p, seen) in mesh.triangle_parts.iter_mut().zip(&is_seen) {
            if !seen {
                *p = part;
            }
        }
    }
    Ok(made)
}

/// Returns, for each triangle, true if it lies near points, or in a small gap between them.
fn seen_triangles(mesh: &Mesh, spline: &Implicit) -> Vec<bool> {
    let corners = |t: &[u32; 3]| t.map(|v| mesh.points[v as usize]);
    let mut seen: Vec<bool> = mesh
        .triangles
        .iter()
        .map(|t| spline.is_seen(middle(corners(t))))
        .collect();
    let mut sets = UnionFind::new(mesh.triangles.len());
    let mut touches_seen = vec![false; mesh.triangles.len()];
    let mut by_edge: HashMap<[u32; 2], usize> = HashMap::new();
    for (i, t) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let Some(j) = by_edge.insert([a.min(b), a.max(b)], i) else {
                continue;
            };
            match (seen[i], seen[j]) {
                (false, false) => {
                    sets.unite(i as u32, j as u32);
                }
                (false, true) => touches_seen[i] = true,
                (true, false) => touches_seen[j] = true,
                (true, true) => {}
            }
        }
    }
    let mut boxes = vec![(Aabb::EMPTY, false); mesh.triangles.len()];
    for (i, t) in mesh.triangles.iter().enumerate().filter(|(i, _)| !seen[*i]) {
        let (bounds, touches) = &mut boxes[sets.root(i as u32) as usize];
        corners(t).iter().for_each(|p: &Point3| bounds.add(*p));
        *touches |= touches_seen[i];
    }
    for i in 0..seen.len() {
        if !seen[i] {
            let (bounds, touches) = boxes[sets.root(i as u32) as usize];
            seen[i] = touches && bounds.diagonal() <= MAX_GAP_CELLS * spline.spacing();
        }
    }
    seen
}

/// Minimum share of a component's area in cells that hold points. Surfaces through points reach
/// 0.9; a component that only passes close to points, as an extra branch does, lies in neighbouring
/// cells.
const MIN_DATA_AREA_SHARE: f64 = 0.3;

/// Marks components that only pass close to the points as unseen.
fn drop_strays(mesh: &Mesh, spline: &Implicit, is_seen: &mut [bool]) {
    let mut sets = UnionFind::new(mesh.triangles.len());
    let mut by_node: Vec<Option<u32>> = vec![None; mesh.points.len()];
    for (i, t) in mesh
        .triangles
        .iter()
        .enumerate()
        .filter(|(i, _)| is_seen[*i])
    {
        for v in t {
            match by_node[*v as usize] {
                Some(j) => {
                    sets.unite(i as u32, j);
                }
                None => by_node[*v as usize] = Some(i as u32),
            }
        }
    }
    let mut areas = vec![[0.0; 2]; mesh.triangles.len()];
    for (i, t) in mesh
        .triangles
        .iter()
        .enumerate()
        .filter(|(i, _)| is_seen[*i])
    {
        let [a, b, c] = t.map(|v| mesh.points[v as usize]);
        let area = norm(cross(sub(b, a), sub(c, a)));
        let sums = &mut areas[sets.root(i as u32) as usize];
        sums[0] += area;
        if spline.holds_data(middle([a, b, c])) {
            sums[1] += area;
        }
    }
    for (i, seen) in is_seen.iter_mut().enumerate().filter(|(_, seen)| **seen) {
        let [all, held] = areas[sets.root(i as u32) as usize];
        *seen = held >= MIN_DATA_AREA_SHARE * all;
    }
}

/// Marks triangles as seen around nodes at which the seen ones would form several fans.
fn join_fans(mesh: &Mesh, is_seen: &mut [bool]) {
    let edges = |t: &[u32; 3]| [0, 1, 2].map(|k| (t[k], t[(k + 1) % 3]));
    loop {
        let seen = mesh.triangles.iter().zip(&*is_seen).filter(|(_, s)| **s);
        let directed: HashSet<(u32, u32)> = seen.clone().flat_map(|(t, _)| edges(t)).collect();
        let mut ends = vec![0; mesh.points.len()];
        for (a, b) in seen.flat_map(|(t, _)| edges(t)) {
            if !directed.contains(&(b, a)) {
                ends[a as usize] += 1;
                ends[b as usize] += 1;
            }
        }
        let mut is_changed = false;
        for (t, seen) in mesh.triangles.iter().zip(is_seen.iter_mut()) {
            if !*seen && t.iter().any(|v| ends[*v as usize] > 2) {
                (*seen, is_changed) = (true, true);
            }
        }
        if !is_changed {
            return;
        }
    }
}

/// Removes triangles of a surface, and nodes that become unused.
fn cut(mesh: &mut Mesh, is_kept: &[bool]) {
    let keep = |i: &usize| is_kept[*i];
    let kept: Vec<usize> = (0..mesh.triangles.len()).filter(keep).collect();
    mesh.triangles = kept.iter().map(|i| mesh.triangles[*i]).collect();
    if !mesh.triangle_mids.is_empty() {
        mesh.triangle_mids = kept.iter().map(|i| mesh.triangle_mids[*i]).collect();
    }
    if !mesh.triangle_parts.is_empty() {
        mesh.triangle_parts = kept.iter().map(|i| mesh.triangle_parts[*i]).collect();
    }
    let mut number = vec![u32::MAX; mesh.points.len()];
    let mut points = Vec::new();
    let mids = mesh.triangle_mids.as_flattened_mut();
    for v in mesh.triangles.as_flattened_mut().iter_mut().chain(mids) {
        let new = &mut number[*v as usize];
        if *new == u32::MAX {
            *new = points.len() as u32;
            points.push(mesh.points[*v as usize]);
        }
        *v = *new;
    }
    for column in &mut mesh.columns {
        let mut values = vec![0.0; points.len()];
        for (old, new) in number.iter().enumerate().filter(|(_, n)| **n != u32::MAX) {
            values[*new as usize] = column.values[old];
        }
        column.values = values;
    }
    mesh.points = points;
    // A smooth surface has no feature edges and corners.
    mesh.edges.clear();
    mesh.edge_mids.clear();
    mesh.edge_curves.clear();
    mesh.corners.clear();
}
