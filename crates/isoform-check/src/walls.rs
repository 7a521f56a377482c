//! Number of layers of elements through the walls of a solid.
//!
//! From the centre of each triangle of the boundary the inward normal is followed through the
//! tetrahedra to the boundary on the other side. The layers there are the smallest number of edges
//! of the crossed tetrahedra that lead from the nodes of the triangle to those of the face where
//! the normal leaves: a wall of a single layer has edges from side to side, though the normal may
//! cross three or more of its tetrahedra.

use super::Place;
use super::stars::{Stars, blocks};
use crate::quality::face_normals;
use isoform_geom::{Mesh, Point3, TET_FACES, dot, norm, sub};
use rayon::prelude::*;
use std::collections::HashMap;

/// Number of triangles in a task.
const TRIANGLES_PER_TASK: usize = 1024;
/// Least cosine of the angle between the two sides of a wall: half a right angle. Sides that are
/// inclined by more than that are nearer to standing on one another at an edge than to being
/// opposite, and the way between them ends at the edge, however fine the mesh is.
const MIN_SIDES_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Share of the triangles of walls whose layers are at most [`Walls::layers_low`].
const LOW_SHARE: f64 = 0.05;

/// Layers of elements through the walls.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Walls {
    /// Number of triangles whose inward normal ends on an opposite side.
    pub triangles: usize,
    /// Smallest number of layers from a triangle to the opposite side.
    pub layers_min: usize,
    /// Fifth percentile of the numbers of layers over the triangles, by the nearest rank.
    pub layers_low: usize,
    /// Triangle with the fewest layers, among several the one with the shortest way; the value is
    /// the length of the way, in model units.
    pub thinnest: Place,
}

/// Way along a normal to the other side.
#[derive(Clone, Copy)]
struct Way {
    /// Number of layers of elements.
    layers: u32,
    /// Length of the way.
    length: f64,
    /// Tetrahedron at its start.
    tet: u32,
}

/// Measures the walls between the triangles of the boundary; `None` if the normal of each ends at
/// an edge.
pub(super) fn examine(mesh: &Mesh, boundary: &[[u32; 3]]) -> Option<Walls> {
    let walker = Walker {
        mesh,
        stars: Stars::new(mesh.points.len(), &mesh.tets),
    };
    let ways: Vec<Option<Way>> = blocks(boundary.len(), TRIANGLES_PER_TASK)
        .into_par_iter()
        .flat_map_iter(|range| {
            let mut steps = HashMap::new();
            let walker = &walker;
            range.map(move |k| walker.cross(boundary[k], &mut steps))
        })
        .collect();
    let shorter = |a: &Way, b: &Way| {
        let by_layers = a.layers.cmp(&b.layers);
        by_layers.then(a.length.total_cmp(&b.length)).is_lt()
    };
    let mut thinnest: Option<(usize, Way)> = None;
    let mut layers = Vec::new();
    for (k, way) in ways.into_iter().enumerate() {
        let Some(way) = way else {
            continue;
        };
        layers.push(way.layers);
        if thinnest.is_none_or(|(_, best)| shorter(&way, &best)) {
            thinnest = Some((k, way));
        }
    }
    let (k, way) = thinnest?;
    let rank = (LOW_SHARE * layers.len() as f64).ceil() as usize;
    let (_, low, _) = layers.select_nth_unstable(rank.saturating_sub(1));
    Some(Walls {
        layers_low: *low as usize,
        triangles: layers.len(),
        layers_min: way.layers as usize,
        thinnest: Place {
            at: walker.centre(boundary[k]),
            nodes: boundary[k].to_vec(),
            elements: vec![way.tet],
            value: way.length,
        },
    })
}

/// Tetrahedra in which normals are followed.
struct Walker<'m> {
    mesh: &'m Mesh,
    stars: Stars,
}

impl Walker<'_> {
    fn at(&self, node: u32) -> Point3 {
        self.mesh.points[node as usize]
    }

    fn centre(&self, triangle: [u32; 3]) -> Point3 {
        let p = triangle.map(|v| self.at(v));
        std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0)
    }

    /// Returns a tetrahedron with a face, other than `not`, and the corner opposite to the face.
    fn behind(&self, face: [u32; 3], not: Option<u32>) -> Option<(u32, usize)> {
        let around = self.stars.elements_at(face[0] as usize).iter();
        around.filter(|&&k| Some(k) != not).find_map(|&k| {
            let tet = self.mesh.tets[k as usize];
            let opposite = |i: &usize| TET_FACES[*i].iter().all(|&c| face.contains(&tet[c]));
            Some((k, (0..4).find(opposite)?))
        })
    }

    /// Follows the inward normal of a triangle to the opposite side; `None` without one.
    /// `steps` holds the number of edges from the triangle to each node on the way.
    fn cross(&self, triangle: [u32; 3], steps: &mut HashMap<u32, u32>) -> Option<Way> {
        let (tet, mut entry) = self.behind(triangle, None)?;
        let mut k = tet;
        let corners = |k: u32| self.mesh.tets[k as usize].map(|v| self.at(v));
        let outward = face_normals(corners(k))[entry];
        let size = norm(outward);
        let way = outward.map(|x| -x / size);
        let origin = self.centre(triangle);
        steps.clear();
        steps.extend(triangle.map(|v| (v, 0)));
        // By rounding a walk may go around an edge for ever. It then comes back to the tetrahedron
        // that was noted last, as the distance between notes doubles.
        let (mut noted, mut count, mut next_note) = (k, 0_usize, 1_usize);
        loop {
            let nodes = self.mesh.tets[k as usize];
            let least = nodes.iter().filter_map(|v| steps.get(v)).min().copied()?;
            for v in nodes {
                let there = steps.entry(v).or_insert(least + 1);
                *there = (*there).min(least + 1);
            }
            let p = corners(k);
            let normals = face_normals(p);
            // Face with the least distance along the way, among those that the way leaves by.
            let mut exit: Option<(f64, usize)> = None;
            for face in (0..4).filter(|&face| face != entry) {
                let rate = dot(way, normals[face]);
                let from = p[TET_FACES[face][0]];
                let length = dot(normals[face], sub(from, origin)) / rate;
                if rate > 0.0 && exit.is_none_or(|(least, _)| length < least) {
                    exit = Some((length, face));
                }
            }
            let (length, face) = exit?;
            let nodes = TET_FACES[face].map(|c| nodes[c]);
            let Some((next, opposite)) = self.behind(nodes, Some(k)) else {
                let layers = nodes.iter().filter_map(|v| steps.get(v)).min().copied()?;
                let cosine = dot(way, normals[face]) / norm(normals[face]);
                let is_side = cosine >= MIN_SIDES_COSINE && length > 0.0;
                return is_side.then_some(Way {
                    layers,
                    length,
                    tet,
                });
            };
            (k, entry, count) = (next, opposite, count + 1);
            if k == noted {
                return None;
            }
            if count == next_note {
                (noted, next_note) = (k, 2 * next_note);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Certificate, Options, certify};
    use isoform_control::Control;

    /// A box of unit cubes, each divided into six tetrahedra around its diagonal, after a map.
    fn bricks(count: [u32; 3], map: impl Fn(Point3) -> Point3) -> Mesh {
        let [nx, ny, nz] = count.map(|n| n + 1);
        let at = |p: [u32; 3]| (p[2] * ny + p[1]) * nx + p[0];
        let mut mesh = Mesh::default();
        for k in 0..nx * ny * nz {
            let p = [k % nx, k / nx % ny, k / (nx * ny)].map(f64::from);
            mesh.points.push(map(p));
        }
        let orders = [
            [0, 1, 2],
            [1, 2, 0],
            [2, 0, 1],
            [1, 0, 2],
            [2, 1, 0],
            [0, 2, 1],
        ];
        for k in 0..count[0] * count[1] * count[2] {
            let o = [
                k % count[0],
                k / count[0] % count[1],
                k / (count[0] * count[1]),
            ];
            for (i, [a, b, _]) in orders.into_iter().enumerate() {
                let (mut p, mut q) = (o, o);
                p[a] += 1;
                q[a] += 1;
                q[b] += 1;
                let (p, q) = if i < 3 { (p, q) } else { (q, p) };
                mesh.tets.push([at(o), at(p), at(q), at(o.map(|v| v + 1))]);
            }
        }
        mesh
    }

    fn walls(mesh: &Mesh) -> Option<Walls> {
        let found: Certificate = certify(mesh, None, &Options::default(), &Control::default());
        assert!(found.is_ok(), "{:?}", found.failures());
        found.walls
    }

    /// A plate has the layers that it is divided into, though a normal crosses three tetrahedra
    /// of each cube; its sides see more, and all normals count.
    #[test]
    fn plates_have_the_layers_that_they_are_made_of() {
        for n in 1..=4 {
            let plate = walls(&bricks([6, 6, n], |[x, y, z]| [x, y, 0.5 * z])).expect("walls");
            assert_eq!(
                (plate.layers_min, plate.layers_low),
                (n as usize, n as usize)
            );
            assert!((plate.thinnest.value - 0.5 * f64::from(n)).abs() < 1e-12);
            assert_eq!(plate.triangles, (2 * 36 + 4 * 6 * n as usize) * 2);
        }
    }

    /// A step of a plate: the thin half has two layers, the other one four, with lengths to match.
    #[test]
    fn the_thinnest_place_is_told() {
        let plate = bricks([8, 4, 2], |[x, y, z]| [x, y, z * (1.0 + 0.1 * x)]);
        let plate = walls(&plate).expect("walls");
        assert_eq!(plate.layers_min, 2);
        assert!(plate.thinnest.at[0] < 1.0 && plate.thinnest.value < 2.3);
    }

    /// A blade of 144 triangles. At 20 degrees its back sees the slope at 70 degrees, and so does
    /// the last row of the slope the back: 12 + 6 triangles are on no wall. At 70 degrees it is the
    /// floor and the first row of the slope: 36 + 6.
    #[test]
    fn sides_that_stand_on_one_another_are_no_wall() {
        for (degrees, count) in [(20.0_f64, 126), (70.0, 102)] {
            let slope = degrees.to_radians().tan();
            let blade = bricks([6, 3, 2], |[x, y, z]| [x, y, 0.5 * z * slope * (x + 0.01)]);
            assert_eq!(walls(&blade).expect("walls").triangles, count, "{degrees}");
        }
    }

    #[test]
    fn a_tetrahedron_alone_has_no_walls() {
        let mesh = Mesh {
            points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            tets: vec![[0, 1, 2, 3]],
            ..Mesh::default()
        };
        // From each side at an edge of 90 degrees to the slope, whose normal is 54.7 degrees off.
        assert_eq!(walls(&mesh), None);
    }
}
