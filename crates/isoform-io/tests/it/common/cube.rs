//! Bent block of tetrahedra with parts, curves, corners and regions, of first or second order.

use isoform_geom::{Curve, Mesh, Point3, TET_EDGES, TRIANGLE_EDGES};
use std::collections::HashMap;

/// Returns a bent block of n × n × n cells of six tetrahedra each: two regions (left, right), two
/// parts (the top, the rest), the curve between them, and its four corners. In the second order the
/// mid nodes lie on the bent block, off the chords.
pub(crate) fn block(n: usize, order: u32) -> Mesh {
    let steps = n + 1;
    let number = |i: usize, j: usize, k: usize| (i + steps * (j + steps * k)) as u32;
    let mut flat: Vec<Point3> = Vec::new();
    for k in 0..steps {
        for j in 0..steps {
            for i in 0..steps {
                flat.push([i, j, k].map(|v| v as f64 / n as f64));
            }
        }
    }
    let mut mesh = Mesh {
        parts: vec!["top face".into(), "rest \"&<--> of it".into()],
        regions: vec!["left".into(), "right".into()],
        curves: vec![Curve {
            name: "rim / top".into(),
            parts: [0, 1],
        }],
        corners: vec![
            number(0, 0, n),
            number(n, 0, n),
            number(0, n, n),
            number(n, n, n),
        ],
        ..Mesh::default()
    };
    for (k, j, i) in (0..n * n * n).map(|c| (c / n / n, c / n % n, c % n)) {
        // Kuhn subdivision: one tetrahedron per order of the axes, from one corner to the opposite
        // one.
        for axes in [
            [0, 1, 2],
            [1, 2, 0],
            [2, 0, 1],
            [0, 2, 1],
            [2, 1, 0],
            [1, 0, 2],
        ] {
            let mut at = [i, j, k];
            let mut tet = [number(at[0], at[1], at[2]); 4];
            for (step, &axis) in axes.iter().enumerate() {
                at[axis] += 1;
                tet[step + 1] = number(at[0], at[1], at[2]);
            }
            if axes[1] != (axes[0] + 1) % 3 {
                tet.swap(2, 3);
            }
            mesh.tets.push(tet);
            mesh.tet_regions.push(u32::from(2 * i >= n));
        }
    }
    for tet in &mesh.tets {
        for face in isoform_geom::TET_FACES {
            let t = face.map(|c| tet[c]);
            for (axis, side) in (0..6).map(|s| (s / 2, (s % 2) as f64)) {
                if t.iter().all(|&v| flat[v as usize][axis] == side) {
                    mesh.triangles.push(t);
                    mesh.triangle_parts
                        .push(u32::from(axis != 2 || side == 0.0));
                }
            }
        }
    }
    for i in 0..n {
        for (a, b) in [
            (number(i, 0, n), number(i + 1, 0, n)),
            (number(n, i, n), number(n, i + 1, n)),
            (number(n - i, n, n), number(n - i - 1, n, n)),
            (number(0, n - i, n), number(0, n - i - 1, n)),
        ] {
            mesh.edges.push([a, b]);
            mesh.edge_curves.push(0);
        }
    }
    if order == 2 {
        add_mids(&mut mesh, &mut flat);
    }
    mesh.points = flat
        .into_iter()
        .map(|[x, y, z]| {
            [
                x + 0.1 * y * y,
                y * (1.0 + 0.25 * z),
                0.7 * z - 0.125 * x * x + 1.0 / 3.0,
            ]
        })
        .collect();
    mesh
}

fn add_mids(mesh: &mut Mesh, points: &mut Vec<Point3>) {
    let mut known: HashMap<(u32, u32), u32> = HashMap::new();
    let mut mid = |a: u32, b: u32| {
        *known.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let (p, q) = (points[a as usize], points[b as usize]);
            points.push(std::array::from_fn(|k| 0.5 * (p[k] + q[k])));
            points.len() as u32 - 1
        })
    };
    mesh.tet_mids = mesh
        .tets
        .iter()
        .map(|t| TET_EDGES.map(|[a, b]| mid(t[a], t[b])))
        .collect();
    mesh.triangle_mids = mesh
        .triangles
        .iter()
        .map(|t| TRIANGLE_EDGES.map(|[a, b]| mid(t[a], t[b])))
        .collect();
    mesh.edge_mids = mesh.edges.iter().map(|&[a, b]| mid(a, b)).collect();
}
