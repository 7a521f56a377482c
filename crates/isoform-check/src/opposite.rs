//! Comparison of opposite sides of a unit cell: each must be the other, translated by the period.

use crate::{Defects, Options, Place};
use isoform_geom::{Aabb, Mesh};
use std::collections::{HashMap, HashSet};

/// Comparison of two opposite sides of a unit cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OppositeSides {
    /// Axis across which they lie.
    pub axis: usize,
    /// Number of pairs of nodes.
    pub nodes: usize,
    /// Number of pairs of triangles.
    pub triangles: usize,
    /// Triangles of one side without a reversed copy on the other, and nodes whose partners do not
    /// lie exactly one period away, with all other coordinates equal bit for bit.
    pub apart: Defects,
}

/// Compares the opposite sides across the axes along which a box is periodic.
pub(super) fn examine(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    region: Aabb,
    options: &Options<'_>,
) -> Vec<OppositeSides> {
    let axes = (0..3).filter(|&axis| options.periodic[axis]);
    axes.map(|axis| of_axis(mesh, triangles, region, axis, options.places))
        .collect()
}

fn of_axis(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    region: Aabb,
    axis: usize,
    room: usize,
) -> OppositeSides {
    let mut found = OppositeSides {
        axis,
        ..OppositeSides::default()
    };
    let place = |nodes: &[u32]| Place {
        at: mesh.points[nodes[0] as usize],
        nodes: nodes.to_vec(),
        ..Place::default()
    };
    let declared = mesh.opposite.iter().filter(|o| o.axis == axis);
    let pairs: Vec<[u32; 2]> = declared.flat_map(|o| o.nodes.iter().copied()).collect();
    found.nodes = pairs.len();
    let ends = [region.lo[axis], region.hi[axis]];
    let mut partner: HashMap<u32, u32> = HashMap::new();
    let mut taken = HashSet::new();
    for &[a, b] in &pairs {
        let [p, q] = [a, b].map(|v| mesh.points[v as usize]);
        let are_opposite = (0..3).all(|i| match i == axis {
            true => [p[i], q[i]] == ends,
            false => p[i] == q[i],
        });
        if !are_opposite || partner.insert(a, b).is_some() || !taken.insert(b) {
            found.apart.add(room, || place(&[a, b]));
        }
    }
    let on = |end: f64| {
        let is_on = move |t: &&[u32; 3]| t.iter().all(|&v| mesh.points[v as usize][axis] == end);
        triangles.iter().filter(is_on)
    };
    let mut upper: HashSet<[u32; 3]> = on(ends[1]).map(|t| turned([t[0], t[1], t[2]])).collect();
    for t in on(ends[0]) {
        let image: Option<Vec<u32>> = t.iter().map(|v| partner.get(v).copied()).collect();
        let is_there = match image.as_deref() {
            Some(&[a, b, c]) => upper.remove(&turned([c, b, a])),
            _ => false,
        };
        if is_there {
            found.triangles += 1;
        } else {
            found.apart.add(room, || place(t));
        }
    }
    let mut alone: Vec<[u32; 3]> = upper.into_iter().collect();
    alone.sort_unstable();
    for t in alone {
        found.apart.add(room, || place(&t));
    }
    let mids: HashSet<u32> = mesh.triangle_mids.as_flattened().iter().copied().collect();
    let is_lower = |v: &u32| mesh.points[*v as usize][axis] == ends[0];
    let mut lonely: Vec<u32> = mids
        .into_iter()
        .filter(|v| is_lower(v) && !partner.contains_key(v))
        .collect();
    lonely.sort_unstable();
    for v in lonely {
        found.apart.add(room, || place(&[v]));
    }
    found
}

/// Rotates a triangle so that it begins with its lowest corner.
fn turned(t: [u32; 3]) -> [u32; 3] {
    let first = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
    [t[first], t[(first + 1) % 3], t[(first + 2) % 3]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::Opposite;

    const CELL: Aabb = Aabb {
        lo: [0.0; 3],
        hi: [1.0; 3],
    };

    /// A triangle on the lower side across x and its image on the upper one, turned round.
    fn pair() -> Mesh {
        let at = |x: f64| [[x, 0.1, 0.2], [x, 0.7, 0.2], [x, 0.1, 0.9]];
        let points = [at(0.0), at(1.0)].concat();
        let mut mesh = Mesh::from_triangles(points, vec![[2, 1, 0], [3, 4, 5]]);
        mesh.opposite = vec![Opposite {
            axis: 0,
            nodes: vec![[0, 3], [1, 4], [2, 5]],
        }];
        mesh
    }

    fn apart(mesh: &Mesh) -> usize {
        of_axis(mesh, &mesh.triangles, CELL, 0, 20).apart.count
    }

    #[test]
    fn sides_that_are_one() {
        let mesh = pair();
        assert_eq!(mesh.opposite, [mesh.opposite_nodes(CELL, 0)]);
        let found = of_axis(&mesh, &mesh.triangles, CELL, 0, 20);
        assert_eq!((found.nodes, found.triangles, found.apart.count), (3, 1, 0));
    }

    #[test]
    fn sides_that_differ_in_anything() {
        // A coordinate by one unit in the last place: a pair of nodes, and so both triangles.
        let mut mesh = pair();
        mesh.points[4][1] = mesh.points[4][1].next_up();
        assert_eq!(apart(&mesh), 3);
        // A node a little off the side; its triangle is not on the side any more.
        let mut mesh = pair();
        mesh.points[4][0] = 1.0f64.next_down();
        assert_eq!(apart(&mesh), 2);
        // A triangle that is turned as its partner is.
        let mut mesh = pair();
        mesh.triangles[1] = [5, 4, 3];
        assert_eq!(apart(&mesh), 2);
        // A triangle without a partner, on either side.
        for k in 0..2 {
            let mut mesh = pair();
            mesh.triangles.remove(k);
            assert_eq!(apart(&mesh), 1);
        }
        // A pair that is not declared, and one that is twice.
        let mut mesh = pair();
        mesh.opposite[0].nodes.pop();
        assert_eq!(apart(&mesh), 2);
        let mut mesh = pair();
        mesh.opposite[0].nodes.push([2, 5]);
        assert_eq!(apart(&mesh), 1);
        // A mid node without a partner.
        let mut mesh = pair();
        mesh.points.push([0.0, 0.4, 0.2]);
        mesh.triangle_mids = vec![[6, 6, 6], [6, 6, 6]];
        assert_eq!(apart(&mesh), 1);
    }
}
