//! Where a mesh is in pieces though the solid hangs together.
//!
//! Of a needle or the end of a narrow cone the lattice may follow parts and miss what is between
//! them. All of these are near some surface of the mesh, so that nothing seems missed, and each
//! piece is a valid mesh. So shells that come near each other are looked at: where a way through
//! the solid is found from one to the other, the mesh is torn; and between outsides where one leads
//! outside, as through a narrow hole.

use crate::points::unique;
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, UnionFind, distance_squared, near_pairs};
use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};

/// Shells are looked at that come nearer to each other than this, in sizes. Pieces torn apart are
/// less than one apart: farther ones would be missed parts of the solid.
const NEAR: f64 = 1.5;
/// Steps of a way per distance between two shells.
const STEPS: f64 = 8.0;
/// Half the box in which a way is sought, in distances between the shells: larger ones take longer
/// by the third power, and ways between pieces torn apart are short.
const AROUND: f64 = 0.75;
/// A way begins and ends no farther from the shells than this, in steps.
const BESIDE: f64 = 2.5;
/// Places at which each step is looked at: a gap has to be wider than a 32nd of the distance
/// between the nodes on its sides to part two bodies.
const LOOKS: usize = 4;

/// The nearest nodes of two shells.
type Pair = (f64, [Point3; 2]);

/// Places between shells of the mesh that are one in the solid, whose value is negative outside.
pub(crate) fn torn(
    value: impl Fn(Point3) -> f64,
    mesh: &Mesh,
    size: f64,
    control: &Control<'_>,
) -> Vec<Point3> {
    let shells = Shells::of(mesh);
    if shells.volumes.len() < 2 {
        return Vec::new();
    }
    let mut found = Vec::new();
    for ([a, b], (_, ends)) in shells.near(mesh, NEAR * size) {
        let are_bodies = shells.volumes[a as usize] > 0.0 && shells.volumes[b as usize] > 0.0;
        let side = if are_bodies { 1.0 } else { -1.0 };
        if !control.is_stopped() && leads(&value, ends, side) {
            found.push(std::array::from_fn(|i| 0.5 * (ends[0][i] + ends[1][i])));
        }
    }
    found
}

/// The parts of a surface that hang together.
struct Shells {
    /// The nodes of the surface, each with its shell.
    nodes: Vec<(u32, u32)>,
    /// What each encloses: negative for cavities.
    volumes: Vec<f64>,
}

impl Shells {
    fn of(mesh: &Mesh) -> Self {
        let mut sets = UnionFind::new(mesh.points.len());
        for &[a, b, c] in &mesh.triangles {
            sets.unite(a, b);
            sets.unite(a, c);
        }
        let mut number: BTreeMap<u32, u32> = BTreeMap::new();
        let (mut nodes, mut volumes) = (Vec::new(), Vec::new());
        let middle = Aabb::of(&mesh.points).center();
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

    /// The pairs of shells that come nearer to each other than `reach`, with their nearest nodes.
    fn near(&self, mesh: &Mesh, reach: f64) -> BTreeMap<[u32; 2], Pair> {
        let at = |n: usize| mesh.points[self.nodes[n].0 as usize];
        let places: Vec<Point3> = (0..self.nodes.len()).map(at).collect();
        let mut near: BTreeMap<[u32; 2], Pair> = BTreeMap::new();
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

/// Whether a way on one side of the solid's surface, inside (1) or outside (−1), leads from one
/// place to the other, in steps along the axes.
fn leads(value: impl Fn(Point3) -> f64, [p, q]: [Point3; 2], side: f64) -> bool {
    let distance = distance_squared(p, q).sqrt();
    let step = distance / STEPS;
    let middle: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
    let most = (AROUND * STEPS).ceil() as i32;
    let place =
        |at: [i32; 3]| -> Point3 { std::array::from_fn(|i| middle[i] + step * f64::from(at[i])) };
    let is_on = |p: Point3| side * value(p) > 0.0;
    let is_at =
        |at: [i32; 3], end: Point3| distance_squared(place(at), end) <= (BESIDE * step).powi(2);
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
                let t = n as f64 / LOOKS as f64;
                std::array::from_fn(|i| from[i] + t * (to[i] - from[i]))
            };
            if (1..LOOKS).all(|n| is_on(along(n))) {
                seen.insert(next);
                open.push_back(next);
            }
        }
    }
    false
}
