//! Meshes of several regions: the walls between regions, their names, and the mesh of one region.
//!
//! A *wall* is a triangle between two tetrahedra of different regions. Its normal points out of the
//! region with the lower index.

use super::{Curve, Mesh, TET_FACES, TRIANGLE_EDGES};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap, HashSet};

/// Returns the corners of a face in ascending order, as a key of the face.
fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// Keeps the entries of a list whose indices satisfy `is_kept`.
fn keep<T>(list: &mut Vec<T>, is_kept: impl Fn(usize) -> bool) {
    let mut place = 0;
    list.retain(|_| {
        place += 1;
        is_kept(place - 1)
    });
}

impl Mesh {
    /// Returns true for each triangle that is a wall: a face shared by tetrahedra of two regions.
    pub fn walls(&self) -> Vec<bool> {
        if self.regions.len() < 2 {
            return vec![false; self.triangles.len()];
        }
        self.sides_of_walls().iter().map(Option::is_some).collect()
    }

    /// Returns the mesh without the walls between its regions: only the triangles of the outer
    /// surface, and the edges and corners on them. Curves in which a wall meets the outer surface
    /// are omitted.
    pub fn without_walls(&self) -> Cow<'_, Self> {
        let is_wall = self.walls();
        if !is_wall.contains(&true) {
            return Cow::Borrowed(self);
        }
        let mut outer = self.clone();
        outer.keep_triangles(|k| !is_wall[k]);
        let parts: HashSet<u32> = outer.triangle_parts.iter().copied().collect();
        let is_outer = |curve: &Curve| curve.parts.iter().all(|part| parts.contains(part));
        let is_outer: Vec<bool> = outer.curves.iter().map(is_outer).collect();
        let curves = outer.edge_curves.clone();
        outer.keep_edges(|k| curves.get(k).is_none_or(|&curve| is_outer[curve as usize]));
        Cow::Owned(outer)
    }

    /// Keeps the edges whose indices satisfy `is_kept`, and the curves that still have edges.
    fn keep_edges(&mut self, is_kept: impl Fn(usize) -> bool) {
        keep(&mut self.edges, &is_kept);
        keep(&mut self.edge_mids, &is_kept);
        keep(&mut self.edge_curves, &is_kept);
        let mut number = vec![0; self.curves.len()];
        for &curve in &self.edge_curves {
            number[curve as usize] = 1;
        }
        keep(&mut self.curves, |k| number[k] > 0);
        let mut before = 0;
        for n in &mut number {
            (*n, before) = (before, before + *n);
        }
        for curve in &mut self.edge_curves {
            *curve = number[*curve as usize];
        }
    }

    /// Names walls after the regions on both sides, `inner|outer` for one between the regions inner
    /// and outer, followed by `.part` if the wall between two regions has several parts. A part
    /// that is both outer surface and wall, or a wall between several pairs of regions, is split
    /// into several parts. A part of the outer surface with the name of a region gets the suffix
    /// `.surface`: in files, both are groups of elements.
    pub fn name_walls(&mut self) {
        let sides = self.sides_of_walls();
        let pairs: BTreeSet<([u32; 2], u32)> = sides
            .iter()
            .zip(&self.triangle_parts)
            .filter_map(|(pair, &part)| Some(((*pair)?, part)))
            .collect();
        let used = sides
            .iter()
            .zip(&self.triangle_parts)
            .filter(|(pair, _)| pair.is_none());
        let outer: HashSet<u32> = used.map(|(_, &part)| part).collect();
        // Parts of the outer surface keep their order and names; walls follow.
        let mut parts = Vec::new();
        let mut number: HashMap<(Option<[u32; 2]>, u32), u32> = HashMap::new();
        for part in (0..self.parts.len() as u32).filter(|part| outer.contains(part)) {
            number.insert((None, part), parts.len() as u32);
            let name = &self.parts[part as usize];
            let is_region = self.regions.contains(name);
            parts.push(if is_region {
                format!("{name}.surface")
            } else {
                name.clone()
            });
        }
        for &(pair, part) in &pairs {
            let [a, b] = pair.map(|region| &self.regions[region as usize]);
            let several = pairs.iter().filter(|other| other.0 == pair).count() > 1;
            let mut name = format!("{a}|{b}");
            if several {
                name += &format!(".{}", self.parts[part as usize]);
            }
            number.insert((Some(pair), part), parts.len() as u32);
            parts.push(name);
        }
        let renamed = |(pair, part): (&Option<[u32; 2]>, &u32)| number[&(*pair, *part)];
        self.triangle_parts = sides
            .iter()
            .zip(&self.triangle_parts)
            .map(renamed)
            .collect();
        // A curve on a part that was split belongs to the piece on the outer surface, or else to
        // the first piece.
        let place = |part: u32| {
            let is_of = |key: &&(Option<[u32; 2]>, u32)| key.1 == part;
            number.keys().filter(is_of).min().map(|key| number[key])
        };
        for curve in &mut self.curves {
            curve.parts = curve.parts.map(|part| place(part).unwrap_or(0));
            let [a, b] = curve.parts.map(|part| &parts[part as usize]);
            curve.name = format!("{a}/{b}");
        }
        self.parts = parts;
    }

    /// Returns the regions on both sides of each triangle, the lower first; `None` if it is not a
    /// wall.
    fn sides_of_walls(&self) -> Vec<Option<[u32; 2]>> {
        let mut sides: HashMap<[u32; 3], Vec<u32>> = self
            .triangles
            .iter()
            .map(|t| (sorted(*t), Vec::new()))
            .collect();
        for (tet, &region) in self.tets.iter().zip(&self.tet_regions) {
            for face in TET_FACES.map(|f| sorted(f.map(|k| tet[k]))) {
                if let Some(regions) = sides.get_mut(&face) {
                    regions.push(region);
                }
            }
        }
        let pair = |t: &[u32; 3]| match *sides[&sorted(*t)] {
            [a, b] if a != b => Some([a.min(b), a.max(b)]),
            _ => None,
        };
        self.triangles.iter().map(pair).collect()
    }

    /// Returns one region as a mesh: its tetrahedra, the triangles on their boundary, oriented
    /// outward, and the edges and corners on these. Boundary faces that are not triangles of this
    /// mesh are omitted.
    pub fn region(&self, region: u32) -> Self {
        let all = self.triangles.iter().enumerate();
        let triangle_of: HashMap<[u32; 3], usize> = all.map(|(k, t)| (sorted(*t), k)).collect();
        let of_region = |t: &usize| self.tet_regions[*t] == region;
        let tets: Vec<usize> = (0..self.tets.len()).filter(of_region).collect();
        let mut sides: Vec<(usize, [u32; 3])> = Vec::new();
        for &t in &tets {
            for face in TET_FACES.map(|f| f.map(|k| self.tets[t][k])) {
                sides.extend(triangle_of.get(&sorted(face)).map(|&k| (k, face)));
            }
        }
        // A triangle with tetrahedra of the region on both sides is not on the boundary.
        sides.sort_unstable();
        let is_outer = |same: &&[(usize, [u32; 3])]| same.len() == 1;
        let sides = sides.chunk_by(|a, b| a.0 == b.0).filter(is_outer);
        let sides: Vec<(usize, [u32; 3])> = sides.map(|same| same[0]).collect();
        let mids_of = |&(k, face): &(usize, [u32; 3])| {
            let t = self.triangles[k];
            TRIANGLE_EDGES.map(|[i, j]| {
                let is_edge = |[a, b]: &[usize; 2]| {
                    [t[*a], t[*b]] == [face[i], face[j]] || [t[*b], t[*a]] == [face[i], face[j]]
                };
                let at = TRIANGLE_EDGES
                    .iter()
                    .position(is_edge)
                    .expect("an edge of both");
                self.triangle_mids[k][at]
            })
        };
        let second = self.order() == 2;
        let mut part = Self {
            points: self.points.clone(),
            triangles: self.triangles.clone(),
            tets: tets.iter().map(|&t| self.tets[t]).collect(),
            tet_mids: tets
                .iter()
                .filter_map(|&t| self.tet_mids.get(t).copied())
                .collect(),
            tet_regions: vec![0; tets.len()],
            regions: vec![self.regions[region as usize].clone()],
            opposite: Vec::new(),
            columns: Vec::new(),
            ..self.clone()
        };
        part.triangles = sides.iter().map(|side| side.1).collect();
        part.triangle_parts = sides
            .iter()
            .map(|side| self.triangle_parts[side.0])
            .collect();
        part.triangle_mids = if second {
            sides.iter().map(mids_of).collect()
        } else {
            Vec::new()
        };
        part.keep_triangles(|_| true);
        part.drop_unused();
        part
    }

    /// Drops the nodes that belong to no element.
    fn drop_unused(&mut self) {
        let mut number = vec![u32::MAX; self.points.len()];
        let lists: [&mut [u32]; 7] = [
            self.triangles.as_flattened_mut(),
            self.triangle_mids.as_flattened_mut(),
            self.tets.as_flattened_mut(),
            self.tet_mids.as_flattened_mut(),
            self.edges.as_flattened_mut(),
            &mut self.edge_mids,
            &mut self.corners,
        ];
        for list in &lists {
            for &node in list.iter() {
                number[node as usize] = 0;
            }
        }
        let mut points = Vec::new();
        for (node, number) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
            *number = points.len() as u32;
            points.push(self.points[node]);
        }
        for node in lists.into_iter().flatten() {
            *node = number[*node as usize];
        }
        self.points = points;
    }

    /// Keeps the triangles whose indices satisfy `is_kept`, and the edges and corners on them.
    fn keep_triangles(&mut self, is_kept: impl Fn(usize) -> bool) {
        keep(&mut self.triangles, &is_kept);
        keep(&mut self.triangle_mids, &is_kept);
        keep(&mut self.triangle_parts, &is_kept);
        let key = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
        let sides = |t: &[u32; 3]| TRIANGLE_EDGES.map(|[i, j]| key([t[i], t[j]]));
        let there: HashSet<[u32; 2]> = self.triangles.iter().flat_map(sides).collect();
        let is_there: Vec<bool> = self
            .edges
            .iter()
            .map(|e| there.contains(&key(*e)))
            .collect();
        self.keep_edges(|k| is_there[k]);
        let nodes: HashSet<u32> = self.triangles.as_flattened().iter().copied().collect();
        self.corners.retain(|corner| nodes.contains(corner));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns two tetrahedra of different regions with a common face, with a part for each half of
    /// the surface and one for the wall, which is oriented out of the first region.
    fn pair() -> Mesh {
        let points = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ];
        let lower = [[0, 1, 4], [1, 2, 4], [2, 0, 4]];
        let upper = [[1, 0, 3], [2, 1, 3], [0, 2, 3]];
        let wall = [[0, 2, 1]];
        Mesh {
            points,
            triangles: [&lower[..], &upper, &wall].concat(),
            triangle_parts: vec![0, 0, 0, 1, 1, 1, 2],
            parts: ["below", "above", "sheet"].map(str::to_owned).to_vec(),
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            tet_regions: vec![0, 1],
            regions: vec!["above".to_owned(), "rest".to_owned()],
            edges: vec![[0, 1], [1, 2], [0, 3]],
            edge_curves: vec![0, 0, 1],
            curves: vec![
                Curve {
                    name: "below/sheet".to_owned(),
                    parts: [0, 2],
                },
                Curve {
                    name: "above/above".to_owned(),
                    parts: [1, 1],
                },
            ],
            corners: vec![0, 3],
            ..Mesh::default()
        }
    }

    #[test]
    fn walls_are_left_out_with_the_curves_that_they_make() {
        let mesh = pair();
        assert_eq!(
            mesh.walls(),
            [false, false, false, false, false, false, true]
        );
        let outer = mesh.without_walls();
        assert_eq!((outer.triangles.len(), outer.tets.len()), (6, 2));
        assert_eq!(outer.edges, [[0, 3]]);
        assert_eq!(
            outer.curves[outer.edge_curves[0] as usize].name,
            "above/above"
        );
        // An additional curve within the wall, before the others, does not change their indices.
        let mut more = mesh.clone();
        more.triangles.insert(0, [1, 0, 2]);
        more.triangle_parts.insert(0, 2);
        more.triangles.pop();
        more.triangle_parts.pop();
        more.points.push([0.5, 0.5, 0.0]);
        more.curves.insert(
            0,
            Curve {
                name: "sheet/sheet".to_owned(),
                parts: [2, 2],
            },
        );
        more.edges.insert(0, [1, 5]);
        more.edge_curves = vec![0, 1, 1, 2];
        let outer = more.without_walls();
        assert_eq!(
            (outer.edges.as_slice(), outer.curves.len()),
            (&[[0, 3]][..], 1)
        );
        // A mesh of one region has no walls: nothing is copied.
        let one = Mesh {
            tet_regions: vec![0, 0],
            ..mesh
        };
        assert!(!one.walls().contains(&true));
        assert!(matches!(one.without_walls(), Cow::Borrowed(_)));
    }

    #[test]
    fn a_region_is_closed_and_looks_outward() {
        let mesh = pair();
        for (region, apex) in [(0, [0.0, 0.0, 1.0]), (1, [0.0, 0.0, -1.0])] {
            let part = mesh.region(region);
            assert_eq!(
                (part.points.len(), part.triangles.len(), part.tets.len()),
                (4, 4, 1)
            );
            assert!(part.points.contains(&apex));
            // The volume by the divergence theorem: 1/6, positive for outward triangles.
            let six: f64 = part
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| part.points[v as usize]);
                    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                        + a[2] * (b[0] * c[1] - b[1] * c[0])
                })
                .sum();
            assert!((six - 1.0).abs() < 1e-15, "region {region}: {six}");
        }
        assert_eq!(mesh.region(0).corners.len(), 2);
        assert_eq!(mesh.region(1).corners.len(), 1);
    }

    #[test]
    fn walls_are_named_by_their_regions() {
        let mut mesh = pair();
        mesh.name_walls();
        assert_eq!(mesh.parts, ["below", "above.surface", "above|rest"]);
        assert_eq!(mesh.triangle_parts, [0, 0, 0, 1, 1, 1, 2]);
        assert_eq!(mesh.curves[0].name, "below/above|rest");
        // Two parts in one wall, one of which is also on the outer surface.
        let mut mesh = pair();
        mesh.triangles.push([0, 2, 1]);
        mesh.triangle_parts.push(0);
        mesh.name_walls();
        let walls = ["above|rest.below", "above|rest.sheet"];
        assert_eq!(mesh.parts[2..], walls.map(str::to_owned));
        assert_eq!(mesh.triangle_parts, [0, 0, 0, 1, 1, 1, 3, 2]);
    }
}
