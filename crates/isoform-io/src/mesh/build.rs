//! Assembly of a [`Mesh`] from the nodes and elements of a file with their own numbers.
//!
//! Readers give a [`MeshBuilder`] nodes and elements in any order, each element with the tag of its
//! group. The builder sorts both by their numbers, replaces numbers by indices into the list of
//! nodes and tags by labels from 0, and reverses inverted tetrahedra and wedges.
//!
//! Quadrilaterals are kept only in a mesh with wedges, as sides of these; in other meshes each
//! becomes two triangles.

use super::boundary::find_curve_parts;
use crate::input::{Input, Result};
use crate::{At, ErrorKind, ReadReport};
use isoform_geom::{Curve, Mesh, Point3, cross, dot, sub};
use std::collections::BTreeMap;

const MESH_BUILD_FAILURE: &str = "cannot put the mesh together";
/// Minimum negative volume at which tetrahedra and wedges are reversed, as a share of the cube of
/// their longest edge. A smaller share would reverse flat elements because of rounding, a larger
/// one would leave thin ones inverted.
const MIN_INVERTED_VOLUME: f64 = 1e-12;
/// Maximum length of a table of node numbers, in multiples of the number of nodes; sparser numbers
/// are found by binary search.
const MAX_TABLE_RATIO: usize = 4;

/// Elements of one kind with C corners and M mid nodes.
pub(super) struct ElementList<const C: usize, const M: usize> {
    /// Name of an element in messages.
    what: &'static str,
    /// Corners, as numbers of the file until they are resolved.
    corners: Vec<[u32; C]>,
    /// Mid nodes of the elements that have some.
    mids: Vec<[u32; M]>,
    /// Group of each element; 0 for none, negative for an entity that counts only if no element has
    /// a group.
    tags: Vec<i64>,
    /// Number of each element in the file, if elements are numbered.
    numbers: Vec<u32>,
    /// Positions in the file of a sparse sample of elements, for messages.
    marks: Vec<(usize, At)>,
}

impl<const C: usize, const M: usize> ElementList<C, M> {
    fn new(what: &'static str) -> Self {
        Self {
            what,
            corners: Vec::new(),
            mids: Vec::new(),
            tags: Vec::new(),
            numbers: Vec::new(),
            marks: Vec::new(),
        }
    }
    /// Adds an element: corners, then mid nodes if it has any.
    pub(super) fn push(&mut self, nodes: &[u32], tag: i64, number: Option<u32>, at: At) {
        if self.marks.last().is_none_or(|(_, last)| *last != at)
            && self.marks.len() <= self.corners.len() / 256
        {
            self.marks.push((self.corners.len(), at));
        }
        self.corners.push(std::array::from_fn(|k| nodes[k]));
        if M > 0 && nodes.len() >= C + M {
            self.mids.push(std::array::from_fn(|k| nodes[C + k]));
        }
        self.tags.push(tag);
        self.numbers.extend(number);
    }
    /// Returns the number of elements.
    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }
    /// Returns the corners of an element, and its mid nodes if all elements have some, as numbers
    /// of the file.
    pub(super) fn get(&self, i: usize) -> (&[u32; C], Option<&[u32; M]>) {
        let all = self.mids.len() == self.corners.len();
        (&self.corners[i], if all { self.mids.get(i) } else { None })
    }

    /// Sorts the elements by number, and drops mid nodes unless all elements have them.
    fn settle(&mut self, report: &mut ReadReport) {
        if !self.mids.is_empty() && self.mids.len() != self.corners.len() {
            report.warn(format!(
                "only some of the {}s are of second order; all mid nodes were left out",
                self.what
            ));
            self.mids.clear();
        }
        if self.numbers.len() == self.corners.len() && !self.numbers.is_sorted() {
            let mut order: Vec<usize> = (0..self.numbers.len()).collect();
            order.sort_by_key(|&i| self.numbers[i]);
            self.corners = order.iter().map(|&i| self.corners[i]).collect();
            self.tags = order.iter().map(|&i| self.tags[i]).collect();
            if !self.mids.is_empty() {
                self.mids = order.iter().map(|&i| self.mids[i]).collect();
            }
            self.marks.truncate(1);
        }
    }

    /// Keeps a selection of the elements, by index, and drops all mid nodes.
    fn keep(&mut self, is_kept: impl Fn(usize) -> bool) {
        let kept: Vec<usize> = (0..self.corners.len()).filter(|&i| is_kept(i)).collect();
        if self.numbers.len() == self.corners.len() {
            self.numbers = kept.iter().map(|&i| self.numbers[i]).collect();
        } else {
            self.numbers.clear();
        }
        self.corners = kept.iter().map(|&i| self.corners[i]).collect();
        self.tags = kept.iter().map(|&i| self.tags[i]).collect();
        self.mids.clear();
        for (first, _) in &mut self.marks {
            *first = kept.partition_point(|i| i < first);
        }
    }

    /// Replaces numbers of the file by indices into the list of nodes.
    fn resolve(&mut self, nodes: &NodeIndex, input: &Input<'_>) -> Result<()> {
        let (what, marks) = (self.what, &self.marks);
        let row = |i: usize, id: &mut u32| match nodes.row(*id) {
            Some(row) => {
                *id = row;
                Ok(())
            }
            None => {
                let block = marks
                    .partition_point(|(first, _)| *first <= i)
                    .checked_sub(1);
                let at = block.map_or(At::File, |b| marks[b].1);
                let why = format!(
                    "{what} {} (from 1; its block starts here) names node {id}, which is not there",
                    i + 1
                );
                Err(input.error(
                    ErrorKind::Index,
                    at,
                    MESH_BUILD_FAILURE,
                    why,
                    "export the mesh again",
                ))
            }
        };
        for (i, cell) in self.corners.iter_mut().enumerate() {
            cell.iter_mut().try_for_each(|id| row(i, id))?;
        }
        for (i, cell) in self.mids.iter_mut().enumerate() {
            cell.iter_mut().try_for_each(|id| row(i, id))?;
        }
        Ok(())
    }
}

/// Map from the number of a node to its index in the list.
enum NodeIndex {
    /// First number of consecutive ones, and their count.
    Row(u32, usize),
    /// Index by number.
    Table(Vec<u32>),
    /// Ascending numbers.
    Sorted(Vec<u32>),
}

impl NodeIndex {
    /// Chooses the smallest representation for ascending numbers; takes the list if it is kept.
    fn from_numbers(ids: &mut Vec<u32>) -> Self {
        let n = ids.len();
        let (Some(&first), Some(&last)) = (ids.first(), ids.last()) else {
            return Self::Row(0, 0);
        };
        if (last - first) as usize == n - 1 {
            Self::Row(first, n)
        } else if (last as usize) < MAX_TABLE_RATIO * n {
            let mut table = vec![u32::MAX; last as usize + 1];
            for (row, &id) in ids.iter().enumerate() {
                table[id as usize] = row as u32;
            }
            Self::Table(table)
        } else {
            Self::Sorted(std::mem::take(ids))
        }
    }
    /// Returns the index of a node; `None` for a number that no node has.
    fn row(&self, id: u32) -> Option<u32> {
        match self {
            Self::Row(first, n) => id.checked_sub(*first).filter(|row| (*row as usize) < *n),
            Self::Table(table) => table
                .get(id as usize)
                .copied()
                .filter(|row| *row != u32::MAX),
            Self::Sorted(ids) => ids.binary_search(&id).ok().map(|row| row as u32),
        }
    }
}

/// Accumulates nodes, elements and groups of a file in any order.
pub(super) struct MeshBuilder {
    /// Numbers of the nodes, in the order of the file.
    ids: Vec<u32>,
    /// Coordinates of the nodes.
    points: Vec<Point3>,
    /// Corners of the model.
    pub(super) corners: ElementList<1, 0>,
    /// Edges on curves.
    pub(super) edges: ElementList<2, 1>,
    /// Triangles.
    pub(super) triangles: ElementList<3, 3>,
    /// Quadrilaterals, which are also among the triangles, as two each.
    quads: ElementList<4, 0>,
    /// Index of the first of the two triangles of each quadrilateral.
    halves: Vec<usize>,
    /// Tetrahedra.
    pub(super) tets: ElementList<4, 6>,
    /// Wedges.
    pub(super) wedges: ElementList<6, 0>,
    /// Names of groups by dimension and tag.
    pub(super) names: [BTreeMap<i64, String>; 4],
    /// Number of elements of kinds that a mesh cannot store.
    pub(super) others: u64,
}

impl MeshBuilder {
    pub(super) fn new() -> Self {
        Self {
            ids: Vec::new(),
            points: Vec::new(),
            corners: ElementList::new("corner"),
            edges: ElementList::new("edge"),
            triangles: ElementList::new("triangle"),
            quads: ElementList::new("quadrilateral"),
            halves: Vec::new(),
            tets: ElementList::new("tetrahedron"),
            wedges: ElementList::new("wedge"),
            names: Default::default(),
            others: 0,
        }
    }
    /// Adds a node.
    pub(super) fn node(&mut self, id: u32, p: Point3, input: &Input<'_>, at: At) -> Result<()> {
        if !p.iter().all(|v| v.is_finite()) {
            let why = format!("node {id} is at {p:?}");
            return Err(input.error(
                ErrorKind::Number,
                at,
                "a node is not at a finite place",
                why,
                "correct the file",
            ));
        }
        self.ids.push(id);
        self.points.push(p);
        Ok(())
    }
    /// Returns the number of nodes so far.
    pub(super) fn node_count(&self) -> usize {
        self.points.len()
    }
    /// Adds a polygon as a fan of triangles.
    pub(super) fn polygon(&mut self, nodes: &[u32], tag: i64, at: At) {
        for k in 2..nodes.len() {
            self.triangles
                .push(&[nodes[0], nodes[k - 1], nodes[k]], tag, None, at);
        }
    }

    /// Adds a quadrilateral.
    pub(super) fn quad(&mut self, nodes: &[u32], tag: i64, number: Option<u32>, at: At) {
        self.halves.push(self.triangles.len());
        self.quads.push(nodes, tag, number, at);
        for half in [[0, 1, 2], [0, 2, 3]] {
            let nodes = half.map(|k| nodes[k]);
            self.triangles.push(&nodes, tag, number, at);
        }
    }

    /// Drops either the quadrilaterals or the triangles they were split into; in a mesh with
    /// wedges, which are of first order, also drops mid nodes.
    fn part_quads(&mut self, report: &mut ReadReport) {
        if self.wedges.corners.is_empty() {
            self.quads = ElementList::new("quadrilateral");
            return;
        }
        let is_curved = !self.tets.mids.is_empty()
            || !self.triangles.mids.is_empty()
            || !self.edges.mids.is_empty();
        if is_curved {
            report.warn("elements of second order beside wedges: all mid nodes were left out");
            self.tets.mids.clear();
            self.edges.mids.clear();
        }
        let mut is_whole = vec![true; self.triangles.len()];
        for &first in &self.halves {
            is_whole[first..first + 2].fill(false);
        }
        self.triangles.keep(|i| is_whole[i]);
    }

    /// Sorts the nodes by number, refusing duplicates, and returns the map from numbers to indices.
    fn nodes(&mut self, input: &Input<'_>) -> Result<NodeIndex> {
        if !self.ids.is_sorted_by(|a, b| a < b) {
            let mut order: Vec<usize> = (0..self.ids.len()).collect();
            order.sort_by_key(|&i| self.ids[i]);
            self.ids = order.iter().map(|&i| self.ids[i]).collect();
            self.points = order.iter().map(|&i| self.points[i]).collect();
            if let Some(twice) = self.ids.windows(2).find(|w| w[0] == w[1]) {
                let why = format!("node {} is there twice", twice[0]);
                return Err(input.error(
                    ErrorKind::Corrupt,
                    At::File,
                    MESH_BUILD_FAILURE,
                    why,
                    "renumber the nodes",
                ));
            }
        }
        Ok(NodeIndex::from_numbers(&mut self.ids))
    }

    /// Assembles the mesh: numbers of the file become indices, elements are sorted by number, and
    /// inverted volumes are reversed.
    pub(super) fn finish(mut self, input: &Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
        let nodes = self.nodes(input)?;
        self.ids = Vec::new();
        self.part_quads(report);
        self.corners.settle(report);
        self.edges.settle(report);
        self.triangles.settle(report);
        self.quads.settle(report);
        self.tets.settle(report);
        self.wedges.settle(report);
        self.corners.resolve(&nodes, input)?;
        self.edges.resolve(&nodes, input)?;
        self.triangles.resolve(&nodes, input)?;
        self.quads.resolve(&nodes, input)?;
        self.tets.resolve(&nodes, input)?;
        self.wedges.resolve(&nodes, input)?;
        if self.others > 0 {
            report.warn(format!(
                "{} elements are neither triangles, tetrahedra nor wedges and were passed over",
                self.others
            ));
        }
        let mut mesh = self.mesh();
        let turned = turn_inverted(&mut mesh);
        if turned > 0 {
            report.warn(format!(
                "{turned} tetrahedra were inside out and were turned"
            ));
        }
        let turned = turn_inverted_wedges(&mut mesh);
        if turned > 0 {
            report.warn(format!("{turned} wedges were inside out and were turned"));
        }
        let mut mesh = divide(mesh, report);
        find_curve_parts(&mut mesh);
        Ok(mesh)
    }

    /// Assembles the sorted elements and their groups, without the parts next to curves. Regions of
    /// wedges follow those of tetrahedra.
    fn mesh(self) -> Mesh {
        let [_, curve_names, part_names, region_names] = self.names;
        let (edge_curves, curves) = labels(self.edges.tags, curve_names, "curve");
        let triangles = self.triangles.len();
        let face_tags = [self.triangles.tags, self.quads.tags].concat();
        let (mut triangle_parts, parts) = labels(face_tags, part_names, "part");
        let quad_parts = triangle_parts.split_off(triangles.min(triangle_parts.len()));
        let volume_tags = [self.tets.tags, self.wedges.tags].concat();
        let (tet_regions, regions) = labels(volume_tags, region_names, "region");
        let curve = |name| Curve {
            name,
            parts: [0; 2],
        };
        Mesh {
            points: self.points,
            triangles: self.triangles.corners,
            triangle_mids: self.triangles.mids,
            triangle_parts,
            parts,
            tets: self.tets.corners,
            tet_mids: self.tets.mids,
            tet_regions,
            regions,
            wedges: self.wedges.corners,
            quads: self.quads.corners,
            quad_parts,
            edges: self.edges.corners,
            edge_mids: self.edges.mids.into_iter().map(|[m]| m).collect(),
            edge_curves,
            curves: curves.into_iter().map(curve).collect(),
            corners: self.corners.corners.into_iter().map(|[c]| c).collect(),
            opposite: Vec::new(),
            columns: Vec::new(),
        }
    }
}

/// Replaces tags by indices into a list of names, ordered by tag; elements without a group come
/// last. The labels are empty if all elements belong together.
fn labels(mut tags: Vec<i64>, names: BTreeMap<i64, String>, what: &str) -> (Vec<u32>, Vec<String>) {
    let some = tags.iter().any(|t| *t > 0);
    if !some {
        let differ = tags.windows(2).any(|w| w[0] != w[1]);
        if !differ {
            return (Vec::new(), Vec::new());
        }
        tags.iter_mut().for_each(|t| *t = t.saturating_neg());
    }
    // From here on tags are positive for groups and 0 for none.
    let mut distinct: Vec<i64> = tags.iter().map(|t| (*t).max(0)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    distinct.extend(names.keys().filter(|t| **t > 0 && some));
    distinct.sort_unstable();
    distinct.dedup();
    let has_none = distinct.first() == Some(&0);
    if has_none {
        distinct.rotate_left(1);
    }
    let groups = distinct.len() - usize::from(has_none);
    let label = |t: i64| distinct[..groups].binary_search(&t).unwrap_or(groups) as u32;
    let labels = tags.iter().map(|t| label((*t).max(0))).collect();
    let name = |t: &i64| match names.get(t) {
        Some(name) if some => name.clone(),
        _ if *t == 0 => format!("no {what}"),
        _ => format!("{what} {t}"),
    };
    (labels, distinct.iter().map(name).collect())
}

/// Splits wedges into tetrahedra if the mesh has several regions, since wedges have no region
/// labels; a single region includes the wedges.
fn divide(mut mesh: Mesh, report: &mut ReadReport) -> Mesh {
    if mesh.wedges.is_empty() {
        return mesh;
    }
    let mut labels = std::mem::take(&mut mesh.tet_regions);
    let Some(&first) = labels.first() else {
        return mesh;
    };
    if labels.iter().all(|&label| label == first) {
        mesh.regions = vec![mesh.regions.swap_remove(first as usize)];
        mesh.tet_regions = vec![0; mesh.tets.len()];
        return mesh;
    }
    report.warn(format!(
        "{} wedges of several regions became three tetrahedra each",
        mesh.wedges.len()
    ));
    let of_wedges = labels.split_off(mesh.tets.len());
    labels.extend(of_wedges.into_iter().flat_map(|region| [region; 3]));
    mesh = mesh.simplices().into_owned();
    mesh.tet_regions = labels;
    mesh
}

/// Reverses tetrahedra with negative volume and returns their number.
fn turn_inverted(mesh: &mut Mesh) -> usize {
    let mut turned = 0;
    for (i, tet) in mesh.tets.iter_mut().enumerate() {
        let [a, b, c, d] = tet.map(|n| mesh.points[n as usize]);
        let edges = [
            sub(b, a),
            sub(c, a),
            sub(d, a),
            sub(c, b),
            sub(d, b),
            sub(d, c),
        ];
        let longest = edges.iter().fold(0.0_f64, |m, &e| m.max(dot(e, e))).sqrt();
        if dot(edges[0], cross(edges[1], edges[2])) < -MIN_INVERTED_VOLUME * longest.powi(3) {
            tet.swap(2, 3);
            if let Some(mids) = mesh.tet_mids.get_mut(i) {
                // Edges 1–2 with 1–3 and 0–2 with 0–3, see TET_EDGES.
                mids.swap(1, 4);
                mids.swap(2, 3);
            }
            turned += 1;
        }
    }
    turned
}

/// Reverses wedges whose first triangle faces away from the second, and returns their number.
fn turn_inverted_wedges(mesh: &mut Mesh) -> usize {
    let mut turned = 0;
    for wedge in &mut mesh.wedges {
        let [a, b, c, d, e, f] = wedge.map(|n| mesh.points[n as usize]);
        let sides = [[a, b], [b, c], [c, a], [d, e], [e, f], [f, d]];
        let sides = sides.map(|[p, q]| sub(q, p));
        let heights = [[a, d], [b, e], [c, f]].map(|[p, q]| sub(q, p));
        let all = sides.iter().chain(&heights);
        let longest = all.fold(0.0_f64, |m, &v| m.max(dot(v, v))).sqrt();
        let looks = [cross(sides[0], sides[1]), cross(sides[3], sides[4])];
        let looks_up = |n: Point3| heights.iter().map(|&h| dot(n, h)).sum::<f64>();
        if looks_up(looks[0]) + looks_up(looks[1]) < -MIN_INVERTED_VOLUME * longest.powi(3) {
            *wedge = [0, 2, 1, 3, 5, 4].map(|k| wedge[k]);
            turned += 1;
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn finish(builder: MeshBuilder) -> Result<(Mesh, ReadReport)> {
        let input = Input::open(Source::Bytes {
            name: "t",
            bytes: b"",
        })
        .expect("bytes");
        let mut report = ReadReport::new("test", "t".into());
        builder
            .finish(&input, &mut report)
            .map(|mesh| (mesh, report))
    }

    fn nodes(ids: &[u32]) -> MeshBuilder {
        let input = Input::open(Source::Bytes {
            name: "t",
            bytes: b"",
        })
        .expect("bytes");
        let mut builder = MeshBuilder::new();
        let places = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (&id, p) in ids.iter().zip(places) {
            builder.node(id, p, &input, At::File).expect("finite");
        }
        builder
    }

    #[test]
    fn numbers_of_any_kind() {
        for ids in [
            [7, 8, 9, 10],
            [9, 3, 4, 5],
            [u32::MAX, 0, 17, 4_000_000_000],
        ] {
            let mut builder = nodes(&ids);
            builder.tets.push(&ids, 0, None, At::Byte(5));
            let (mesh, report) = finish(builder).expect("valid");
            assert_eq!(
                mesh.tets[0].map(|n| mesh.points[n as usize])[1],
                [1.0, 0.0, 0.0]
            );
            assert_eq!(report.warnings.len(), 0);
        }
        assert_eq!(
            finish(nodes(&[3, 1, 3, 2])).expect_err("twice").code(),
            "file-corrupt"
        );
        let mut builder = nodes(&[1, 2, 3, 4]);
        builder.triangles.push(&[1, 2, 5], 0, None, At::Byte(5));
        let e = finish(builder).expect_err("no node 5");
        assert_eq!(
            (e.code(), e.place.to_string().as_str()),
            ("bad-index", "t, byte 5")
        );
    }

    #[test]
    fn inverted_ones_are_turned_with_their_mid_nodes() {
        let mut builder = nodes(&[0, 1, 2, 3]);
        builder
            .tets
            .push(&[0, 1, 3, 2, 0, 1, 2, 3, 0, 1], 0, None, At::File);
        let (mesh, report) = finish(builder).expect("valid");
        assert_eq!(
            (mesh.tets[0], mesh.tet_mids[0]),
            ([0, 1, 2, 3], [0, 0, 3, 2, 1, 1])
        );
        assert_eq!(report.warnings.len(), 1);
    }

    /// Returns an inverted wedge, a quadrilateral and a triangle of other parts on it, and a
    /// tetrahedron.
    fn wedge(regions: [i64; 2]) -> MeshBuilder {
        let mut builder = nodes(&[0, 1, 2, 3]);
        let input = Input::open(Source::Bytes {
            name: "t",
            bytes: b"",
        })
        .expect("bytes");
        for (id, p) in [
            (4, [1.0, 0.0, 1.0]),
            (5, [0.0, 1.0, 1.0]),
            (6, [0.0, 0.0, 2.0]),
        ] {
            builder.node(id, p, &input, At::File).expect("finite");
        }
        builder.quad(&[0, 1, 4, 3], 2, Some(7), At::File);
        builder.triangles.push(&[0, 2, 1], 1, Some(3), At::File);
        let [tet, wedge] = regions;
        builder.tets.push(&[3, 4, 5, 6], tet, None, At::File);
        builder
            .wedges
            .push(&[0, 2, 1, 3, 5, 4], wedge, None, At::File);
        builder
    }

    #[test]
    fn quadrilaterals_are_kept_beside_wedges() {
        let (mesh, report) = finish(wedge([1, 1])).expect("valid");
        assert_eq!(mesh.wedges, [[0, 1, 2, 3, 4, 5]]);
        assert_eq!(report.warnings.len(), 1, "turned: {:?}", report.warnings);
        assert_eq!(
            (&mesh.triangles[..], &mesh.quads[..]),
            (&[[0, 2, 1]][..], &[[0, 1, 4, 3]][..])
        );
        assert_eq!(
            (&mesh.triangle_parts[..], &mesh.quad_parts[..]),
            (&[0][..], &[1][..])
        );
        assert_eq!(mesh.parts, ["part 1", "part 2"]);
        assert_eq!(
            (&mesh.regions[..], &mesh.tet_regions[..]),
            (&["region 1".to_owned()][..], &[0][..])
        );
        let mut bare = wedge([1, 1]);
        bare.wedges = ElementList::new("wedge");
        let (mesh, _) = finish(bare).expect("valid");
        assert_eq!(mesh.triangles, [[0, 2, 1], [0, 1, 4], [0, 4, 3]]);
        assert_eq!(
            (&mesh.triangle_parts[..], mesh.quads.len()),
            (&[0, 1, 1][..], 0)
        );
    }

    #[test]
    fn wedges_of_several_regions_become_tetrahedra() {
        let (mesh, report) = finish(wedge([2, 1])).expect("valid");
        assert_eq!(report.warnings.len(), 2, "{:?}", report.warnings);
        assert_eq!(
            (mesh.tets.len(), mesh.wedges.len(), mesh.quads.len()),
            (4, 0, 0)
        );
        assert_eq!(mesh.tet_regions, [1, 0, 0, 0]);
        assert_eq!(
            (mesh.triangles.len(), &mesh.triangle_parts[..]),
            (3, &[0, 1, 1][..])
        );
    }

    #[test]
    fn wedges_leave_no_mid_nodes() {
        let mut builder = wedge([1, 1]);
        builder.edges.push(&[0, 1, 6], 0, None, At::File);
        let (mesh, report) = finish(builder).expect("valid");
        assert_eq!((mesh.edges.len(), mesh.edge_mids.len()), (1, 0));
        assert_eq!(report.warnings.len(), 2, "{:?}", report.warnings);
    }

    #[test]
    fn tags_become_labels() {
        let names = |list: &[(i64, &str)]| {
            list.iter()
                .map(|(t, n)| (*t, n.to_string()))
                .collect::<BTreeMap<_, _>>()
        };
        let none = (Vec::new(), Vec::<String>::new());
        assert_eq!(labels(vec![0, 0], names(&[]), "part"), none);
        assert_eq!(labels(vec![-1, -1], names(&[(4, "a")]), "part"), none);
        assert_eq!(
            labels(vec![-5, -3, -5], names(&[]), "part"),
            (vec![1, 0, 1], vec!["part 3".into(), "part 5".into()])
        );
        let got = labels(vec![9, -3, 2], names(&[(2, "two"), (4, "four")]), "part");
        assert_eq!(
            got,
            (
                vec![2, 3, 0],
                vec![
                    "two".into(),
                    "four".into(),
                    "part 9".into(),
                    "no part".into()
                ]
            )
        );
    }
}
