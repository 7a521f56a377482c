//! Smooth pieces of the surface of a labelled mesh, and their loci.
//!
//! A part of a mesh has one smooth function, or several that join smoothly: the flat top of a
//! plate, the blend and the wall of a boss have one label and three functions. The limits of these
//! divide the part ([`SmoothPart::limits`]).

use crate::BrepError;
use crate::contacts::{Contact, ContactSearch};
use crate::cut::LabelledMesh;
use crate::locus::Locus;
use crate::piece::{SmoothPiece, triangles_of_part};
use crate::seams::Seams;
use crate::stray::parts_on_surface;
use crate::surfaces::{Recognize, SurfacePart};
use crate::topology::{across_sides, components};
use crate::whole::{SolidPiece, piece_named};
use isoform_geom::brep::Surface;
use isoform_geom::{Aabb, Field, Mesh, Parts, Point3, SmoothPart, Solid};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The surface of a solid as triangles that are labelled by their smooth pieces.
pub struct Pieces {
    pub(crate) mesh: LabelledMesh,
    pub(crate) list: Vec<SmoothPiece>,
    /// Names of the parts of the mesh.
    pub(crate) names: Vec<String>,
}

/// Returns the smooth pieces of the surface of a solid: its labelled mesh, divided where the
/// functions of a part change, with the surface or function of each. `smooth` are the parts of the
/// solid's pieces, if known; a piece without such parts has to lie on a surface that `recognize`
/// finds.
///
/// # Errors
/// [`BrepError::NoSurface`], [`BrepError::OffSurface`] or [`BrepError::Spindle`] if a part has
/// neither a surface nor a smooth function.
pub fn pieces(
    mesh: &Mesh,
    solid: &dyn Solid,
    smooth: Option<&Parts>,
    recognize: &Recognize<'_>,
) -> Result<Pieces, BrepError> {
    let parts = parts_on_surface(mesh, solid)?;
    let mut labelled = LabelledMesh {
        points: mesh.points.clone(),
        triangles: mesh.triangles.clone(),
        parts: parts.clone(),
        sheets: parts.clone(),
        components: parts,
        charts: vec![0; mesh.triangles.len()],
        ..LabelledMesh::default()
    };
    let mut found: Vec<PieceCandidate<'_>> = Vec::new();
    for (part, name) in mesh.parts.iter().enumerate() {
        let piece = piece_named(solid, name);
        let of_piece = |p: &&SmoothPart| p.piece == piece;
        let branches: Vec<&SmoothPart> =
            smooth.map_or(Vec::new(), |s| s.parts.iter().filter(of_piece).collect());
        let part = part as u32;
        if !labelled.parts.contains(&part) {
            continue;
        }
        if branches.iter().all(|p| p.function == branches[0].function) {
            let own = triangles_of_part(&labelled, part);
            label(&mut labelled, &own, found.len());
            found.push(PieceCandidate {
                part,
                piece,
                branches: branches.into_iter().take(1).collect(),
                is_apart: false,
            });
            continue;
        }
        let of = Seams::new(&labelled, part, SolidPiece { solid, piece }, &branches)
            .divide(&mut labelled);
        for (branches, triangles) in of.into_values() {
            label(&mut labelled, &triangles, found.len());
            found.push(PieceCandidate {
                part,
                piece,
                branches,
                is_apart: false,
            });
        }
    }
    let bounds = mesh.bounds();
    take_apart(&mut labelled, &mut found, |found, nodes| {
        found.surface(nodes, "", bounds, solid, recognize).is_ok()
    })?;
    let contacts = separate(&mut labelled, solid, smooth, &found, mesh.bounds());
    labelled.charts = vec![0; labelled.triangles.len()];
    let mut list = Vec::with_capacity(found.len());
    for (found, nodes) in found.iter().zip(found_nodes(&labelled, &found)) {
        let name = &mesh.parts[found.part as usize];
        list.push(found.piece(nodes, name, mesh.bounds(), solid, recognize)?);
    }
    for Contact { labels, limit } in contacts {
        for label in labels {
            list[label as usize].limits.push(limit.clone());
        }
    }
    share_surfaces(&mut list);
    Ok(Pieces {
        mesh: labelled,
        list,
        names: mesh.parts.clone(),
    })
}

/// Splits a piece that is on no single surface into its connected components, if its function has
/// no limits: the product of two planes, for example, vanishes on both.
fn take_apart(
    mesh: &mut LabelledMesh,
    found: &mut Vec<PieceCandidate<'_>>,
    is_known: impl Fn(&PieceCandidate<'_>, &[Point3]) -> bool,
) -> Result<(), BrepError> {
    let across = across_sides(&mesh.triangles)?;
    let of = &mesh.sheets;
    let (set_of, count) = components(&across, |a, b| of[a as usize] == of[b as usize]);
    let mut sets: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (t, set) in set_of.iter().enumerate() {
        sets[*set as usize].push(t as u32);
    }
    let nodes = found_nodes(mesh, found);
    for piece in 0..found.len() {
        let is_own = |set: &&Vec<u32>| mesh.sheets[set[0] as usize] as usize == piece;
        let own: Vec<&Vec<u32>> = sets.iter().filter(is_own).collect();
        let is_whole = found[piece].branches.iter().all(|b| b.limits.is_empty());
        if own.len() > 1 && is_whole && !is_known(&found[piece], &nodes[piece]) {
            found[piece].is_apart = true;
            for set in &own[1..] {
                label(mesh, set, found.len());
                found.push(found[piece].clone());
            }
        }
    }
    Ok(())
}

/// Moves the borders along which pieces touch onto the functions of the tree that separate them.
fn separate(
    mesh: &mut LabelledMesh,
    solid: &dyn Solid,
    smooth: Option<&Parts>,
    found: &[PieceCandidate<'_>],
    bounds: Aabb,
) -> Vec<Contact> {
    let parts = smooth.map_or(&[][..], |s| &s.parts);
    let candidates: Vec<Arc<dyn Field>> = parts.iter().map(|p| p.field.clone()).collect();
    let [x, y, z] = bounds.size();
    let touching = ContactSearch {
        solid,
        piece_of: &found.iter().map(|f| f.piece).collect::<Vec<_>>(),
        part_of: &found.iter().map(|f| f.part).collect::<Vec<_>>(),
        candidates: &candidates,
        size: x.max(y).max(z),
    };
    touching.separate(mesh)
}

/// Labels triangles by their piece.
fn label(mesh: &mut LabelledMesh, triangles: &[u32], piece: usize) {
    for t in triangles {
        mesh.sheets[*t as usize] = piece as u32;
    }
}

/// A piece whose locus is not known yet.
#[derive(Clone)]
struct PieceCandidate<'a> {
    part: u32,
    /// Piece of the solid.
    piece: u32,
    /// Smooth parts of its function, if known.
    branches: Vec<&'a SmoothPart>,
    /// True if its function has other pieces, on surfaces of their own.
    is_apart: bool,
}

impl PieceCandidate<'_> {
    /// Returns true if a point is where the function is that of the piece.
    fn holds(&self, p: Point3) -> bool {
        let all = |b: &&SmoothPart| b.limits.iter().all(|l| l.value(p) >= 0.0);
        self.branches.iter().any(all)
    }

    /// Returns the exact surface that the piece lies on.
    fn surface(
        &self,
        nodes: &[Point3],
        name: &str,
        bounds: Aabb,
        solid: &dyn Solid,
        recognize: &Recognize<'_>,
    ) -> Result<Surface, BrepError> {
        let function = |p: Point3| match self.branches.first() {
            Some(smooth) => {
                let jet = smooth.field.jet(p);
                (jet.v, jet.g)
            }
            None => solid.gradient(self.piece, p),
        };
        let of = SurfacePart {
            function: &function,
            bounds,
            name,
        };
        of.surface(nodes, recognize)
    }

    /// Returns the piece with its surface or function.
    fn piece(
        &self,
        nodes: Vec<Point3>,
        name: &str,
        bounds: Aabb,
        solid: &dyn Solid,
        recognize: &Recognize<'_>,
    ) -> Result<SmoothPiece, BrepError> {
        let smooth = self.branches.first();
        let surface = self.surface(&nodes, name, bounds, solid, recognize);
        let locus = match (surface, smooth) {
            (Ok(surface), _) => Locus::Exact(surface),
            (Err(error), None) => return Err(error),
            (Err(_), Some(smooth)) => Locus::Zero(smooth.field.clone()),
        };
        let limits = self.branches.iter().flat_map(|b| b.limits.iter().cloned());
        Ok(SmoothPiece {
            part: self.part,
            locus,
            nodes,
            limits: limits.collect(),
            function: smooth.filter(|_| !self.is_apart).map(|s| s.function),
        })
    }
}

/// Returns the nodes that each piece is recognised from: those at which its own function applies,
/// or, for a part with one function, those that it shares with no other piece, since nodes lie near
/// a smooth seam and not on it. All nodes if only a few remain.
fn found_nodes(mesh: &LabelledMesh, found: &[PieceCandidate<'_>]) -> Vec<Vec<Point3>> {
    let mut of: Vec<Vec<u32>> = vec![Vec::new(); mesh.points.len()];
    for (corners, piece) in mesh.triangles.iter().zip(&mesh.sheets) {
        for v in corners {
            if !of[*v as usize].contains(piece) {
                of[*v as usize].push(*piece);
            }
        }
    }
    let (mut inner, mut all) = (vec![Vec::new(); found.len()], vec![Vec::new(); found.len()]);
    for (v, labels) in of.iter().enumerate() {
        let p = mesh.points[v];
        for piece in labels.iter().map(|k| *k as usize) {
            all[piece].push(p);
            let of = &found[piece];
            let has_limits = of.branches.iter().any(|b| !b.limits.is_empty());
            if if has_limits {
                of.holds(p)
            } else {
                labels.len() == 1
            } {
                inner[piece].push(p);
            }
        }
    }
    let each = inner.into_iter().zip(all);
    // Fewer nodes away from the borders do not determine a surface.
    each.map(|(inner, all)| if inner.len() < 12 { all } else { inner })
        .collect()
}

/// Copies the surface of a larger piece to pieces of equal function without one, such as slivers.
fn share_surfaces(list: &mut [SmoothPiece]) {
    let known: BTreeMap<usize, Locus> = list
        .iter()
        .filter(|p| p.locus.surface().is_some())
        .filter_map(|p| Some((p.function?, p.locus.clone())))
        .collect();
    for piece in list.iter_mut().filter(|p| p.locus.surface().is_none()) {
        if let Some(locus) = piece.function.and_then(|f| known.get(&f)) {
            piece.locus = locus.clone();
        }
    }
}
