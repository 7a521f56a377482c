//! Meshes with groups: labelled triangles, tetrahedra, feature curves and corners.

use crate::{Aabb, Column, Point3};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap, HashSet};

/// Pairs of corners that the mid-edge nodes 4 to 9 of a ten-node tetrahedron belong to (the order
/// of VTK and CalculiX).
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
/// Corners of the face opposite to each corner, outward for a positive tetrahedron.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
/// Pairs of corners that the mid-edge nodes of a six-node triangle belong to.
pub const TRIANGLE_EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A surface mesh, or a volume mesh with its boundary, linear or of second order.
///
/// ```
/// use isoform_geom::Mesh;
///
/// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let mesh = Mesh::from_triangles(points, vec![[0, 1, 2]]);
/// assert_eq!((mesh.order(), mesh.bounds().size()), (1, [1.0, 1.0, 0.0]));
/// ```
///
/// Element arrays hold indices into `points`. Label arrays are as long as their elements or empty
/// (no labels); labels are indices into the list of names beside them. Arrays of mid nodes are as
/// long as their elements in a mesh of second order, else empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Nodes.
    pub points: Vec<Point3>,
    /// Triangles of the surface, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Mid-edge nodes of the triangles, in the order of [`TRIANGLE_EDGES`].
    pub triangle_mids: Vec<[u32; 3]>,
    /// The part that each triangle lies on, index into `parts`.
    pub triangle_parts: Vec<u32>,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Tetrahedra, positive: (b − a) · ((c − a) × (d − a)) > 0. Empty for a surface.
    pub tets: Vec<[u32; 4]>,
    /// Mid-edge nodes of the tetrahedra, in the order of [`TET_EDGES`].
    pub tet_mids: Vec<[u32; 6]>,
    /// The region that each tetrahedron belongs to, index into `regions`.
    pub tet_regions: Vec<u32>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Edges on feature curves.
    pub edges: Vec<[u32; 2]>,
    /// Mid nodes of the edges.
    pub edge_mids: Vec<u32>,
    /// The curve that each edge lies on, index into `curves`.
    pub edge_curves: Vec<u32>,
    /// The feature curves.
    pub curves: Vec<Curve>,
    /// Nodes at corners of the solid.
    pub corners: Vec<u32>,
    /// Further numbers per node, each list as long as `points`. Those called `u` and `v` are
    /// parameters on the surface: formats with textures take them as texture coordinates.
    pub columns: Vec<Column>,
}

/// A feature curve: where two parts meet at an angle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Curve {
    /// Name, made of the names of its parts.
    pub name: String,
    /// The parts, indices into the mesh's `parts`.
    pub parts: [u32; 2],
}

/// The corners of a face in ascending order, by which it is found.
fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// Keeps those entries of a list whose places `is_kept` admits.
fn keep<T>(list: &mut Vec<T>, is_kept: impl Fn(usize) -> bool) {
    let mut place = 0;
    list.retain(|_| {
        place += 1;
        is_kept(place - 1)
    });
}

impl Mesh {
    /// A mesh of bare triangles.
    pub fn from_triangles(points: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Self {
        Self {
            points,
            triangles,
            ..Self::default()
        }
    }
    /// 2 with mid-edge nodes, else 1.
    pub fn order(&self) -> u32 {
        if self.tet_mids.is_empty() && self.triangle_mids.is_empty() {
            1
        } else {
            2
        }
    }
    /// Whether each triangle is a wall: a face that tetrahedra of two regions share.
    pub fn walls(&self) -> Vec<bool> {
        if self.regions.len() < 2 {
            return vec![false; self.triangles.len()];
        }
        self.sides_of_walls().iter().map(Option::is_some).collect()
    }

    /// The mesh without the walls between its regions: its triangles are its own surface alone, its
    /// edges and corners those on it, without curves where a wall ends at it.
    pub fn without_walls(&self) -> Cow<'_, Self> {
        let is_wall = self.walls();
        if !is_wall.contains(&true) {
            return Cow::Borrowed(self);
        }
        let mut outer = self.clone();
        outer.keep_triangles(|k| !is_wall[k]);
        let parts: HashSet<u32> = outer.triangle_parts.iter().copied().collect();
        let is_outer = |curve: &Curve| curve.parts.iter().all(|part| parts.contains(part));
        let is_outer: Vec<bool> = self.curves.iter().map(is_outer).collect();
        let curves = outer.edge_curves.clone();
        outer.keep_edges(|k| curves.get(k).is_none_or(|&curve| is_outer[curve as usize]));
        Cow::Owned(outer)
    }

    /// Keeps some of the edges, by their numbers, and the curves that have some.
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

    /// Names walls by the regions on both sides, `inner|outer` for one between the regions inner and
    /// outer, with `.part` behind where the wall between two regions has several parts. A part that
    /// is surface and wall, or wall between several pairs of regions, becomes several parts. A part
    /// of the surface that is called like a region gets `.surface` behind its name: in files, both
    /// are groups of elements.
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
        // Parts of the surface keep their places and names; walls come behind them.
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
        // Of the parts that one has become, a curve has that of the surface, or else the first.
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

    /// The regions on both sides of each triangle that is a wall, the lower first.
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

    /// One of its regions as a mesh of its own: its tetrahedra, the faces around them, outward, and
    /// the edges and corners of these. Only triangles of this mesh have faces there.
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
        // A triangle within the region, which its tetrahedra have on both sides, is no face of it.
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

    /// Drops the nodes that no element has.
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

    /// Keeps some of the triangles, by their numbers, and of edges and corners what these have.
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

    /// The columns `u` and `v`, if both are there.
    pub fn parameters(&self) -> Option<(&[f64], &[f64])> {
        let named = |name: &str| {
            self.columns
                .iter()
                .find(|c| c.name == name)
                .map(|c| c.values.as_slice())
        };
        named("u").zip(named("v"))
    }
    /// Smallest box around the nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.points)
    }
}
