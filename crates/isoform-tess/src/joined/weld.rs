//! Welding: coincident vertices of several surfaces get one index.

use super::{SAME_PLACE_DISTANCE, Seams};
use crate::claim::Claim;
use crate::finding::Finding;
use crate::patch::Patch;
use crate::surface::Surface;
use crate::winding::{CutCurve, Neighbours, Relative};
use isoform_algebra::RBig;
use isoform_geom::{UnionFind, sub};
use std::collections::{BTreeMap, BTreeSet};

/// A vertex of the surface of a patch.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchVertex {
    pub(super) patch: usize,
    pub(super) vertex: u32,
}

/// Returns the vertices at the corners of a patch, with their exact points of space.
fn corner_vertices(patch: &Patch, s: &Surface, half_width: f64) -> Vec<([RBig; 3], u32)> {
    let mut found = Vec::new();
    for side in 0..4 {
        let [x, y, z, w] = patch.side(side)[0];
        if w.is_zero() {
            continue;
        }
        let exact = [x, y, z].map(|x| x / w);
        let at = exact.each_ref().map(|x| x.to_f64().value());
        let bits = 1u64 << side | 1 << ((side + 3) % 4);
        let is_near = |v: u32| {
            let off = sub(s.points[v as usize], at);
            off.iter()
                .all(|x| x.abs() <= SAME_PLACE_DISTANCE * half_width)
        };
        for (t, borders) in s.triangles.iter().zip(&s.borders) {
            for k in (0..3).filter(|&k| borders[k] & bits != 0 && is_near(t[k])) {
                found.push((exact.clone(), t[k]));
            }
        }
    }
    found
}

/// The vertices of all surfaces, numbered surface by surface; coincident ones are in one set.
struct Vertices {
    /// Index of the first vertex of each surface, followed by the total.
    offsets: Vec<u32>,
    sets: UnionFind,
}

impl Vertices {
    fn new(surfaces: &[Surface]) -> Self {
        let mut offsets = vec![0u32];
        for s in surfaces {
            offsets.push(offsets[offsets.len() - 1] + s.points.len() as u32);
        }
        let sets = UnionFind::new(offsets[surfaces.len()] as usize);
        Self { offsets, sets }
    }
    fn number(&self, of: PatchVertex) -> u32 {
        self.offsets[of.patch] + of.vertex
    }
    fn root(&mut self, of: PatchVertex) -> u32 {
        self.sets.root(self.number(of))
    }
    fn unite(&mut self, [a, b]: [PatchVertex; 2]) {
        self.sets.unite(self.number(a), self.number(b));
    }
    /// Unites the vertices at corners of patches that are one point of space.
    fn unite_corners(&mut self, patches: &[Patch], surfaces: &[Surface], half_width: f64) {
        let mut corners: BTreeMap<[RBig; 3], PatchVertex> = BTreeMap::new();
        for (patch, s) in surfaces.iter().enumerate() {
            for (point, vertex) in corner_vertices(&patches[patch], s, half_width) {
                let here = PatchVertex { patch, vertex };
                let first = *corners.entry(point).or_insert(here);
                self.unite([first, here]);
            }
        }
    }
}

/// The joined surface under construction.
struct Welding {
    joined: Surface,
    vertices: Vertices,
    /// Indices of the joined surface's vertices, by the roots of the sets.
    numbers: BTreeMap<u32, u32>,
    /// Sides of its patch on which each corner of each triangle lies, as bits, without the sides
    /// shared with other patches.
    unshared: Vec<[u64; 3]>,
}

impl Welding {
    /// Returns the index of a vertex, which is added if it is new.
    fn vertex(&mut self, s: &Surface, of: PatchVertex) -> u32 {
        let root = self.vertices.root(of);
        let joined = &mut self.joined;
        *self.numbers.entry(root).or_insert_with(|| {
            let v = of.vertex as usize;
            joined.points.push(s.points[v]);
            joined.kinds.push(s.kinds[v]);
            joined.faces.push(s.faces[v]);
            joined.double.push(s.double[v]);
            joined.points.len() as u32 - 1
        })
    }
    /// Adds the triangles of a patch that still have three distinct corners.
    fn add(&mut self, patch: usize, s: &Surface, shared: u64) {
        // Pieces of different patches stay separate until they are oriented together.
        let before = self.joined.winding.pieces as u32;
        self.joined.winding.pieces += s.winding.pieces;
        for (i, t) in s.triangles.iter().enumerate() {
            let v = t.map(|vertex| self.vertex(s, PatchVertex { patch, vertex }));
            if v[0] == v[1] || v[1] == v[2] || v[2] == v[0] {
                continue;
            }
            self.joined.triangles.push(v);
            self.joined.charts.push(s.charts[i]);
            self.joined.corners.push(s.corners[i]);
            self.joined.borders.push(s.borders[i]);
            self.joined.patches.push(patch as u32);
            self.joined.pieces.push(before + s.pieces[i]);
            self.unshared.push(s.borders[i].map(|b| b & !shared));
        }
        let mut winding = s.winding.clone();
        winding.renumber(|vertex| {
            let root = self.vertices.root(PatchVertex { patch, vertex });
            self.numbers.get(&root).copied()
        });
        self.joined.winding.cut.extend(winding.cut);
    }
}

/// Welds the surfaces of patches into one: identifies the vertices of each pair, and vertices at
/// corners of patches that are one point.
pub(super) fn weld(
    patches: &[Patch],
    surfaces: Vec<Surface>,
    seams: &Seams,
    half_width: f64,
) -> Surface {
    let mut vertices = Vertices::new(&surfaces);
    for pair in &seams.pairs {
        vertices.unite(*pair);
    }
    vertices.unite_corners(patches, &surfaces, half_width);
    let mut welding = Welding {
        joined: Surface {
            is_double_curve_known: surfaces.iter().all(|s| s.is_double_curve_known),
            is_outside: !surfaces.is_empty() && surfaces.iter().all(|s| s.is_outside),
            sheets: surfaces.iter().map(|s| s.sheets).max().unwrap_or(0),
            tolerance: surfaces.iter().map(|s| s.tolerance).fold(0.0, f64::max),
            ..Surface::default()
        },
        vertices,
        numbers: BTreeMap::new(),
        unshared: Vec::new(),
    };
    for (k, s) in surfaces.into_iter().enumerate() {
        welding.add(k, &s, seams.shared[k]);
        let joined = &mut welding.joined;
        joined.double_curve.extend(s.double_curve);
        joined.solitary_arcs.extend(s.solitary_arcs);
        match k {
            0 => joined.decisions = s.decisions,
            _ => joined.decisions.join(&s.decisions),
        }
        let named = |f: Finding| f.attributed_to(&patches[k].name);
        joined.findings.extend(s.findings.into_iter().map(named));
    }
    let Welding {
        mut joined,
        unshared,
        ..
    } = welding;
    if patches.len() > 1 {
        joined
            .decisions
            .decide([Claim::Sides], [Claim::Sides.usual()]);
    }
    check(&mut joined, &unshared, seams.most);
    wind(&mut joined);
    joined.check_winding();
    joined
}

/// Orients the pieces of patches consistently along common sides. Where more than two triangles
/// meet, only triangles of one patch count as neighbours.
fn wind(s: &mut Surface) {
    let uses = s.uses();
    let cut = std::mem::take(&mut s.winding.cut);
    let is_cut: BTreeSet<[u32; 2]> = cut.iter().map(|e| e.vertices).collect();
    let piece = |s: &Surface, k: u32| s.pieces[k as usize];
    let at_edge = |(edge, u): (&[u32; 2], &Vec<(u32, bool)>)| match u[..] {
        [a, b] if !is_cut.contains(edge) => Some(Neighbours {
            along: CutCurve::Sides,
            edge: *edge,
            of: [piece(s, a.0), piece(s, b.0)],
            same_way: a.1 == b.1,
        }),
        _ => None,
    };
    let neighbours: Vec<Neighbours> = uses.iter().filter_map(at_edge).collect();
    let mut of_pieces = Relative::new(s.winding.pieces, neighbours);
    for k in cut.iter().flat_map(|e| uses.get(&e.vertices)).flatten() {
        let joined = of_pieces.pieces[piece(s, k.0) as usize];
        of_pieces.unorientable[joined as usize] = true;
    }
    let pieces = s.pieces.iter().map(|&p| p as usize);
    let relative = Relative {
        pieces: pieces.clone().map(|p| of_pieces.pieces[p]).collect(),
        turned: pieces.map(|p| of_pieces.turned[p]).collect(),
        unorientable: of_pieces.unorientable,
        cut: cut.into_iter().chain(of_pieces.cut).collect(),
    };
    s.wind(&relative);
}

/// Checks that the mesh ends only on the box and on sides of a single patch; at most `most` sides
/// are one curve.
fn check(s: &mut Surface, unshared: &[[u64; 3]], most: usize) {
    let uses = s.edges(unshared);
    let open = s.open_edges(&uses);
    let crowded = uses
        .iter()
        .filter(|(e, (n, _))| *n > most.max(2) && !s.is_double(e))
        .count();
    if open > 0 {
        s.findings.push(Finding::SidesApart(open));
    }
    if crowded > 0 {
        s.findings.push(Finding::SidesCrowded(crowded));
    }
}
