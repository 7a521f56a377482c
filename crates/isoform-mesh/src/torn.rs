//! Detection of meshes that are disconnected although the solid is connected.
//!
//! The lattice may follow parts of a needle or the tip of a narrow cone and miss what connects
//! them. All of these lie near some surface of the mesh, so that nothing seems unmeshed, and each
//! component is a valid mesh. Therefore pairs of close shells are examined: if a path through the
//! solid joins them, the mesh is torn; shells of which one bounds a cavity are examined outside of
//! the solid, as for a narrow hole.

use crate::points::unique;
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, UnionFind, distance_squared, near_pairs};
use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};

/// Number of steps of a path per distance between two shells.
const PATH_STEPS_PER_GAP: f64 = 8.0;
/// Number of points tested per step: gaps wider than a 32nd of the distance between the nodes on
/// their sides separate two bodies.
const SAMPLES_PER_PATH_STEP: usize = 4;

/// Squared distance and nearest nodes of two shells.
type NearestNodes = (f64, [Point3; 2]);

/// Returns points between shells of the mesh that are connected in the solid, whose value is
/// negative outside.
pub(crate) fn torn(
    value: impl Fn(Point3) -> f64,
    mesh: &Mesh,
    size: f64,
    control: &Control<'_>,
) -> Vec<Point3> {
    let shells = Shells::from_mesh(mesh);
    if shells.volumes.len() < 2 {
        return Vec::new();
    }
    let mut found = Vec::new();
    // Distance, in sizes, between shells that are compared. Torn components are less than one
    // apart: farther ones would count as unmeshed parts of the solid.
    for ([a, b], (_, ends)) in shells.near(mesh, 1.5 * size) {
        let are_bodies = shells.volumes[a as usize] > 0.0 && shells.volumes[b as usize] > 0.0;
        let side = if are_bodies { 1.0 } else { -1.0 };
        if !control.is_stopped() && leads(&value, ends, side) {
            found.push(std::array::from_fn(|i| 0.5 * (ends[0][i] + ends[1][i])));
        }
    }
    found
}

/// Connected components of a surface.
struct Shells {
    /// Nodes of the surface, each with its shell.
    nodes: Vec<(u32, u32)>,
    /// Six times the volume enclosed by each shell: negative for cavities.
    volumes: Vec<f64>,
}

impl Shells {
    fn from_mesh(mesh: &Mesh) -> Self {
        let mut sets = UnionFind::new(mesh.points.len());
        for &[a, b, c] in &mesh.triangles {
            sets.unite(a, b);
            sets.unite(a, c);
        }
        let mut number: BTreeMap<u32, u32> = BTreeMap::new();
        let (mut nodes, mut volumes) = (Vec::new(), Vec::new());
        let middle = Aabb::from_points(&mesh.points).center();
        for triangle in &mesh.triangles {
            let next = number.len() as u32;
            let shell = *number.entry(sets.root(triangle[0])).or_insert(next);
            if shell == next {
                volumes.push(0.0);
            }
            let [a, b, c] = triangle.map(|v| isoform_geom::sub(mesh.points[v as usize], middle));
            volumes[shell as usize] += isoform_geom::dot(a, isoform_geom::cross(b, c));
            nodes.extend(triangle.map(|v| (v, shell)));
        }
        Self {
            nodes: unique(nodes),
            volumes,
        }
    }

    /// Returns the pairs of shells closer than `reach`, with their nearest nodes.
    fn near(&self, mesh: &Mesh, reach: f64) -> BTreeMap<[u32; 2], NearestNodes> {
        let at = |n: usize| mesh.points[self.nodes[n].0 as usize];
        let places: Vec<Point3> = (0..self.nodes.len()).map(at).collect();
        let mut near: BTreeMap<[u32; 2], NearestNodes> = BTreeMap::new();
        near_pairs(&places, reach, |i, j, squared| {
            let (i, j) = if self.nodes[i].1 < self.nodes[j].1 {
                (i, j)
            } else {
                (j, i)
            };
            let shells = [self.nodes[i].1, self.nodes[j].1];
            if shells[0] < shells[1] {
                let pair = (squared, [places[i], places[j]]);
                let least = near.entry(shells).or_insert(pair);
                if squared < least.0 {
                    *least = pair;
                }
            }
        });
        near
    }
}

/// Returns true if a path along the axes leads from one point to the other on one side of the
/// solid's surface, inside (1) or outside (−1).
fn leads(value: impl Fn(Point3) -> f64, [p, q]: [Point3; 2], side: f64) -> bool {
    let distance = distance_squared(p, q).sqrt();
    let step = distance / PATH_STEPS_PER_GAP;
    let middle: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
    // Half the box of the search, in distances between the shells: larger ones cost the third
    // power, and paths between torn components are short.
    let most = (0.75 * PATH_STEPS_PER_GAP).ceil() as i32;
    let place =
        |at: [i32; 3]| -> Point3 { std::array::from_fn(|i| middle[i] + step * f64::from(at[i])) };
    let is_on = |p: Point3| side * value(p) > 0.0;
    let is_at =
        // A path begins and ends at most 2.5 steps from the shells.
        |at: [i32; 3], end: Point3| distance_squared(place(at), end) <= (2.5 * step).powi(2);
    let range = -most..=most;
    let all = range
        .clone()
        .flat_map(|x| range.clone().map(move |y| [x, y]));
    let all = all.flat_map(|[x, y]| range.clone().map(move |z| [x, y, z]));
    let mut open: VecDeque<[i32; 3]> = all
        .filter(|at| is_at(*at, p) && is_on(place(*at)))
        .collect();
    let mut seen: HashSet<[i32; 3]> = open.iter().copied().collect();
    let mut known: HashMap<[i32; 3], bool> = HashMap::new();
    while let Some(at) = open.pop_front() {
        if is_at(at, q) {
            return true;
        }
        for k in 0..6 {
            let mut next = at;
            next[k / 2] += if k % 2 == 0 { 1 } else { -1 };
            let may = next[k / 2].abs() <= most
                && !seen.contains(&next)
                && *known.entry(next).or_insert_with(|| is_on(place(next)));
            if !may {
                continue;
            }
            let (from, to) = (place(at), place(next));
            let along = |n: usize| -> Point3 {
                let t = n as f64 / SAMPLES_PER_PATH_STEP as f64;
                std::array::from_fn(|i| from[i] + t * (to[i] - from[i]))
            };
            if (1..SAMPLES_PER_PATH_STEP).all(|n| is_on(along(n))) {
                seen.insert(next);
                open.push_back(next);
            }
        }
    }
    false
}
