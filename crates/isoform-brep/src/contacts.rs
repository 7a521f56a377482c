//! Contacts of two parts along a third piece of the tree.
//!
//! A bar with round ends is the union of a box and two cylinders: the side of the box continues
//! smoothly into the cylinder where the end of the box, which is not part of the surface, crosses
//! both. There the two parts meet at a zero angle, and the border of their labels is accurate to
//! only half the digits. Hence the piece that separates them is sought in the tree, and the border
//! is moved onto it.

use crate::cut::{Cut, LabelledMesh, crossing, imprint};
use crate::locus::{Distance, Locus};
use crate::newton::{POINT_TOLERANCE, meet};
use crate::topology::{ends_of, longest_side};
use crate::whole::SolidPiece;
use isoform_geom::{Field, Point3, Solid, UnionFind, cross, norm};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Two labels that touch along the zeros of a function.
pub(crate) struct Contact {
    pub(crate) labels: [u32; 2],
    pub(crate) limit: Arc<dyn Field>,
}

/// The limit that separates two labels, and true if the first lies beyond it, where it is negative.
struct SeparatingLimit {
    limit: Arc<dyn Field>,
    is_first_beyond: bool,
}

/// Input of the search for contacts.
pub(crate) struct ContactSearch<'a> {
    pub(crate) solid: &'a dyn Solid,
    /// Piece of the solid by label of the triangles (`LabelledMesh::sheets`).
    pub(crate) piece_of: &'a [u32],
    /// Part of the mesh by label.
    pub(crate) part_of: &'a [u32],
    /// Functions that may separate two parts.
    pub(crate) candidates: &'a [Arc<dyn Field>],
    /// Largest side of the box of the model.
    pub(crate) size: f64,
}

/// Two labels, with the nodes of a connected run of their border along which they touch.
type ContactRun = ([u32; 2], BTreeSet<u32>);

impl ContactSearch<'_> {
    /// Moves the borders along which parts touch onto the pieces of the tree that separate them.
    pub(crate) fn separate(&self, mesh: &mut LabelledMesh) -> Vec<Contact> {
        let mut made = Vec::new();
        for (labels, run) in self.runs(mesh) {
            let band = band(mesh, labels, &run);
            if let Some(found) = self.separating(mesh, labels, &run, &band) {
                self.move_border(mesh, labels, &band, &found);
                let limit = found.limit;
                made.push(Contact { labels, limit });
            }
        }
        made
    }

    /// Returns the distances of a point from two labels' pieces, and the sine between their
    /// normals.
    fn at(&self, labels: [u32; 2], p: Point3) -> ([f64; 2], f64) {
        let [a, b] = labels.map(|k| self.whole(k).distance(p));
        ([a.0.abs(), b.0.abs()], norm(cross(a.1, b.1)))
    }

    fn whole(&self, label: u32) -> SolidPiece<'_> {
        SolidPiece {
            solid: self.solid,
            piece: self.piece_of[label as usize],
        }
    }

    /// Returns the runs of borders along which pieces touch.
    fn runs(&self, mesh: &LabelledMesh) -> Vec<ContactRun> {
        let mut border: BTreeMap<[u32; 2], Vec<[u32; 2]>> = BTreeMap::new();
        for (labels, ends) in borders(mesh) {
            let [a, b] = labels.map(|k| self.piece_of[k as usize]);
            // At a larger sine the parts do not touch. A node that a tenth of a radius lies between
            // it and the contact still counts.
            let touches = |v: &u32| self.at(labels, mesh.points[*v as usize]).1 <= 0.3;
            if a != b && ends.iter().all(touches) {
                border.entry(labels).or_default().push(ends);
            }
        }
        let runs = border.into_iter().flat_map(|(labels, sides)| {
            let each = connected(&sides).into_iter();
            each.map(move |nodes| (labels, nodes))
        });
        runs.collect()
    }

    /// Returns the piece of the tree that separates the nodes of two labels near a run of their
    /// border; the one nearest to the border.
    fn separating(
        &self,
        mesh: &LabelledMesh,
        labels: [u32; 2],
        run: &BTreeSet<u32>,
        band: &[u32],
    ) -> Option<SeparatingLimit> {
        let sided = self.nodes_by_label(mesh, labels, band);
        let reach = longest_side(band.iter().map(|t| mesh.corners(*t)));
        let nearest = |limit: &Arc<dyn Field>| {
            let locus = Locus::Zero(limit.clone());
            let is_first_beyond = is_first_beyond(&locus, &sided, reach)?;
            let off = run
                .iter()
                .map(|v| locus.distance(mesh.points[*v as usize]).0.abs());
            let off = off.fold(0.0, f64::max);
            let touch = |v: &u32| self.meet_there(labels, &locus, mesh.points[*v as usize]);
            (off <= reach && run.iter().all(touch)).then_some((off, is_first_beyond))
        };
        let all = self
            .candidates
            .iter()
            .filter_map(|c| Some((nearest(c)?, c)));
        let ((_, is_first_beyond), limit) = all.min_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
        Some(SeparatingLimit {
            limit: limit.clone(),
            is_first_beyond,
        })
    }

    /// Returns the nodes of triangles that clearly belong to one of the labels, with true for the
    /// first.
    fn nodes_by_label(
        &self,
        mesh: &LabelledMesh,
        labels: [u32; 2],
        band: &[u32],
    ) -> Vec<(Point3, bool)> {
        let nodes: BTreeSet<u32> = corners(mesh, band).collect();
        let points = nodes.into_iter().map(|v| mesh.points[v as usize]);
        points
            .filter_map(|p| Some((p, self.is_first(labels, p)?)))
            .collect()
    }

    /// Returns true if a point of the surface belongs to the first label, false for the second;
    /// `None` if both are near.
    fn is_first(&self, labels: [u32; 2], p: Point3) -> Option<bool> {
        let [a, b] = self.at(labels, p).0;
        // A node clearly belongs to the nearer part if the other one is ten times as far away.
        let is_clear = a.max(b) > POINT_TOLERANCE * self.size && a.max(b) > 10.0 * a.min(b);
        is_clear.then_some(a < b)
    }

    /// Returns true if the limit crosses both pieces in one point near a given one.
    fn meet_there(&self, labels: [u32; 2], limit: &Locus, p: Point3) -> bool {
        let q = meet::<dyn Distance>([&self.whole(labels[0]) as &dyn Distance, limit], p);
        let distances = self.at(labels, q).0;
        distances.iter().all(|d| *d <= POINT_TOLERANCE * self.size)
    }

    /// Divides a band of triangles along a limit, and labels them by their side of it.
    fn move_border(
        &self,
        mesh: &mut LabelledMesh,
        labels: [u32; 2],
        band: &[u32],
        found: &SeparatingLimit,
    ) {
        let locus = Locus::Zero(found.limit.clone());
        for t in band {
            mesh.charts[*t as usize] = 0;
        }
        let cut = Cut {
            own: band,
            number: 0,
            locus: &locus,
            crossing: &|ends| crossing(ends, &self.whole(labels[0]), &locus),
            is_vertex: &|_| false,
        };
        let new = imprint(mesh, &cut);
        for t in band.iter().chain(&new).map(|t| *t as usize) {
            let is_beyond = mesh.charts[t] != 0;
            let label = labels[usize::from(is_beyond != found.is_first_beyond)];
            mesh.sheets[t] = label;
            mesh.parts[t] = self.part_of[label as usize];
            mesh.components[t] = mesh.parts[t];
        }
    }
}

/// Returns the edges between triangles of two labels, with these, the smaller label first.
fn borders(mesh: &LabelledMesh) -> Vec<([u32; 2], [u32; 2])> {
    let mut beside: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut found = Vec::new();
    for (corners, &label) in mesh.triangles.iter().zip(&mesh.sheets) {
        for k in 0..3 {
            let [a, b] = ends_of(corners, k);
            let ends = [a.min(b), a.max(b)];
            match beside.insert(ends, label) {
                Some(other) if other != label => {
                    found.push(([label.min(other), label.max(other)], ends));
                }
                _ => {}
            }
        }
    }
    found
}

/// Groups the nodes of edges by connected component.
fn connected(sides: &[[u32; 2]]) -> Vec<BTreeSet<u32>> {
    let nodes: BTreeSet<u32> = sides.iter().flatten().copied().collect();
    let number: BTreeMap<u32, u32> = nodes.iter().zip(0..).map(|(v, n)| (*v, n)).collect();
    let mut joined = UnionFind::new(nodes.len());
    for [a, b] in sides {
        joined.unite(number[a], number[b]);
    }
    let mut made: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for (v, n) in number {
        made.entry(joined.root(n)).or_default().insert(v);
    }
    made.into_values().collect()
}

/// Returns the triangles of two labels within some rings about nodes.
fn band(mesh: &LabelledMesh, labels: [u32; 2], nodes: &BTreeSet<u32>) -> Vec<u32> {
    let all = 0..mesh.triangles.len() as u32;
    let own: Vec<u32> = all
        .filter(|t| labels.contains(&mesh.sheets[*t as usize]))
        .collect();
    let mut nodes = nodes.clone();
    let mut band = Vec::new();
    // Nodes in two rings of triangles have to be on their side of the contact.
    for _ in 0..2 {
        let touches = |t: &&u32| {
            let corners = mesh.triangles[**t as usize];
            corners.iter().any(|v| nodes.contains(v))
        };
        band = own.iter().filter(touches).copied().collect();
        nodes.extend(corners(mesh, &band));
    }
    band
}

/// Returns true if the points of the first of two labels are beyond a limit and those of the second
/// before it, false for the reverse; `None` if the limit does not separate them. Points close to it
/// are ignored: meshes have them on either label.
fn is_first_beyond(limit: &Locus, sided: &[(Point3, bool)], longest: f64) -> Option<bool> {
    // True if points of the second, and of the first, label are there, by side of the limit.
    let mut there = [[false; 2]; 2];
    for (p, is_first) in sided {
        let off = limit.distance(*p).0;
        // Nodes within a tenth of an edge of the limit are ambiguous.
        if off.abs() > 0.1 * longest {
            there[usize::from(off > 0.0)][usize::from(*is_first)] = true;
        }
    }
    match there {
        [[true, false], [false, true]] => Some(true),
        [[false, true], [true, false]] => Some(false),
        _ => None,
    }
}

/// Returns the corners of triangles, with repetitions.
fn corners<'a>(mesh: &'a LabelledMesh, of: &'a [u32]) -> impl Iterator<Item = u32> + 'a {
    of.iter().flat_map(|t| mesh.triangles[*t as usize])
}
