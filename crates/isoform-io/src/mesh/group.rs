//! Elements by group, and names that a format can store.
//!
//! Writers treat a mesh as two lists: *faces*, the triangles followed by the quadrilaterals of the
//! surface, and *volumes*, the tetrahedra followed by the wedges.
//!
//! A mesh has one label per element; formats store elements group by group ([`Groups`]), under
//! distinct names with an alphabet and a length of their own ([`UniqueNames`]).

use isoform_geom::Mesh;
use std::borrow::Cow;
use std::collections::HashSet;

/// Elements of every group, each in the order of the mesh.
pub(super) struct Groups {
    /// Start of each group in `items`, and the end of the last.
    start: Vec<usize>,
    /// Elements, group by group.
    items: Vec<u32>,
}

impl Groups {
    /// Sorts `n` elements into `count` groups; elements without labels form one group.
    pub(super) fn new(labels: &[u32], count: usize, n: usize) -> Self {
        if labels.is_empty() && n > 0 {
            return Self {
                start: vec![0, n],
                items: (0..n as u32).collect(),
            };
        }
        let mut start = vec![0; count + 1];
        for &l in labels {
            start[l as usize + 1] += 1;
        }
        for i in 0..count {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut items = vec![0; n];
        for (i, &l) in labels.iter().enumerate() {
            items[next[l as usize]] = i as u32;
            next[l as usize] += 1;
        }
        Self { start, items }
    }
    /// Groups the faces by part.
    pub(super) fn parts(mesh: &Mesh) -> Self {
        let labels = match mesh.quad_parts.is_empty() {
            true => Cow::Borrowed(&mesh.triangle_parts),
            false => Cow::Owned([&mesh.triangle_parts[..], &mesh.quad_parts].concat()),
        };
        Self::new(&labels, mesh.parts.len(), face_count(mesh))
    }
    /// Groups the volumes by region; with wedges all volumes form one group (see
    /// [`volume_region`]).
    pub(super) fn regions(mesh: &Mesh) -> Self {
        let labels = match mesh.wedges.is_empty() {
            true => &mesh.tet_regions[..],
            false => &[],
        };
        Self::new(labels, mesh.regions.len(), volume_count(mesh))
    }
    /// Groups the edges by curve.
    pub(super) fn curves(mesh: &Mesh) -> Self {
        Self::new(&mesh.edge_curves, mesh.curves.len(), mesh.edges.len())
    }
    /// Returns the number of groups.
    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }
    /// Returns the elements of a group.
    pub(super) fn elements(&self, group: usize) -> &[u32] {
        &self.items[self.start[group]..self.start[group + 1]]
    }
    /// Returns indices and elements of the non-empty groups.
    pub(super) fn filled(&self) -> impl Iterator<Item = (usize, &[u32])> {
        (0..self.len())
            .map(|g| (g, self.elements(g)))
            .filter(|(_, e)| !e.is_empty())
    }
}

/// Returns the number of faces.
pub(super) fn face_count(mesh: &Mesh) -> usize {
    mesh.triangles.len() + mesh.quads.len()
}

/// Returns the number of volumes.
pub(super) fn volume_count(mesh: &Mesh) -> usize {
    mesh.tets.len() + mesh.wedges.len()
}

/// Returns the part of a face; `None` without parts.
pub(super) fn face_part(mesh: &Mesh, i: usize) -> Option<u32> {
    match i.checked_sub(mesh.triangles.len()) {
        None => mesh.triangle_parts.get(i).copied(),
        Some(quad) => mesh.quad_parts.get(quad).copied(),
    }
}

/// Returns the region of a volume; `None` without regions. Wedges have no labels: a mesh with
/// wedges has at most one region, to which all its volumes belong.
pub(super) fn volume_region(mesh: &Mesh, i: usize) -> Option<u32> {
    match mesh.wedges.is_empty() {
        true => mesh.tet_regions.get(i).copied(),
        false => mesh.regions.first().map(|_| 0),
    }
}

/// Returns the nodes of a face and their number: 4 for a quadrilateral, 3 or 6 for a triangle,
/// whose mid nodes follow the corners.
pub(super) fn face(mesh: &Mesh, i: usize) -> ([u32; 6], usize) {
    let mut nodes = [0; 6];
    if let Some(quad) = i.checked_sub(mesh.triangles.len()) {
        nodes[..4].copy_from_slice(&mesh.quads[quad]);
        return (nodes, 4);
    }
    nodes[..3].copy_from_slice(&mesh.triangles[i]);
    match mesh.triangle_mids.get(i) {
        None => (nodes, 3),
        Some(mids) => {
            nodes[3..].copy_from_slice(mids);
            (nodes, 6)
        }
    }
}

/// Returns the nodes of a volume and their number: 6 for a wedge, 4 or 10 for a tetrahedron, whose
/// mid nodes follow the corners.
pub(super) fn volume(mesh: &Mesh, i: usize) -> ([u32; 10], usize) {
    let mut nodes = [0; 10];
    if let Some(wedge) = i.checked_sub(mesh.tets.len()) {
        nodes[..6].copy_from_slice(&mesh.wedges[wedge]);
        return (nodes, 6);
    }
    nodes[..4].copy_from_slice(&mesh.tets[i]);
    match mesh.tet_mids.get(i) {
        None => (nodes, 4),
        Some(mids) => {
            nodes[4..].copy_from_slice(mids);
            (nodes, 10)
        }
    }
}

/// Returns the nodes of an edge, with a mid node after the ends, and their number.
pub(super) fn edge(mesh: &Mesh, i: usize) -> ([u32; 3], usize) {
    let [a, b] = mesh.edges[i];
    match mesh.edge_mids.get(i) {
        None => ([a, b, 0], 2),
        Some(&mid) => ([a, b, mid], 3),
    }
}

/// Generator of distinct names that fit a format.
pub(super) struct UniqueNames {
    /// Converts a name to the alphabet of the format.
    plain: fn(&str) -> String,
    /// Maximum length of a name, in bytes.
    longest: usize,
    /// Names used so far.
    taken: HashSet<String>,
}

impl UniqueNames {
    pub(super) fn new(longest: usize, plain: fn(&str) -> String) -> Self {
        Self {
            plain,
            longest,
            taken: HashSet::new(),
        }
    }
    /// Returns the name converted to the format, with a number appended if it is taken.
    pub(super) fn give(&mut self, name: &str, empty: &str) -> String {
        let plain = (self.plain)(if name.trim().is_empty() { empty } else { name });
        let mut given = cut(&plain, self.longest).to_owned();
        let mut number = 1;
        while self.taken.contains(&given) {
            number += 1;
            let tail = format!("_{number}");
            given = cut(&plain, self.longest - tail.len()).to_owned() + &tail;
        }
        self.taken.insert(given.clone());
        given
    }
}

/// Returns the longest prefix of at most `n` bytes.
fn cut(text: &str, n: usize) -> &str {
    let mut end = n.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_keep_the_order() {
        let groups = Groups::new(&[2, 0, 2, 2, 0], 4, 5);
        assert_eq!(groups.len(), 4);
        assert_eq!(
            [
                groups.elements(0),
                groups.elements(1),
                groups.elements(2),
                groups.elements(3)
            ],
            [&[1, 4][..], &[], &[0, 2, 3], &[]]
        );
        assert_eq!(groups.filled().map(|(g, _)| g).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(Groups::new(&[], 0, 2).elements(0), [0, 1]);
        assert_eq!(Groups::new(&[], 0, 0).len(), 0);
    }

    #[test]
    fn names_differ() {
        let mut names = UniqueNames::new(6, |n| n.to_uppercase());
        let given = ["top", "Top", "", "", "abcdefgh", "abcdefxx"].map(|n| names.give(n, "part"));
        assert_eq!(
            given,
            ["TOP", "TOP_2", "PART", "PART_2", "ABCDEF", "ABCD_2"]
        );
    }
}
