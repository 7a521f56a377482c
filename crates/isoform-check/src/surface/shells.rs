//! Connected parts of the surface, and their nesting.

use super::{ITEMS_PER_TASK, Shell, Triangles, is_degenerate};
use crate::boxes::BoxTree;
use crate::exact::volume_sign;
use crate::stars::blocks;
use crate::{Defects, Place};
use isoform_geom::{Aabb, Point3, UnionFind, cross, dot, norm, sub};
use rayon::prelude::*;

/// Maximum number of rays tried until one meets no edge. Each fails only by coincidence; if all
/// fail, the shell gets no winding number.
const MAX_RAYS: u32 = 32;
/// Tilt of the first ray, in diagonals of the surface; later rays are tilted farther. A larger tilt
/// makes the box around the ray thicker, and more triangles are tested.
const FIRST_RAY_TILT: f64 = 1e-3;
/// Increments of two low-discrepancy sequences: 1/φ and √2 − 1. Both are badly approximable, so
/// that rays do not return to the slopes of a regular mesh.
const RAY_SEQUENCE_STEPS: [f64; 2] = [0.618_033_988_749_894_9, 0.414_213_562_373_095_03];

/// Shells of a surface: the connected components of its nodes.
pub(super) struct Shells {
    /// Shell of each node that is a corner of a triangle with three distinct corners; shells are
    /// numbered by their lowest nodes.
    pub(super) of: Vec<u32>,
    /// Lowest node of each shell.
    lowest: Vec<u32>,
}

/// Sums over triangles of one shell.
struct Sum {
    shell: u32,
    triangles: usize,
    volume: f64,
    area: f64,
}

impl Shells {
    /// Joins the corners of every triangle that is not degenerate.
    pub(super) fn new(of: Triangles<'_>) -> Self {
        let nodes = of.points.len();
        let mut sets = UnionFind::new(nodes);
        let mut used = vec![false; nodes];
        for t in of.triangles.iter().filter(|t| !is_degenerate(t)) {
            sets.unite(t[0], t[1]);
            sets.unite(t[0], t[2]);
            for &i in t {
                used[i as usize] = true;
            }
        }
        Self::numbered(&mut sets, &used)
    }

    /// Numbers the sets of a union-find whose roots are the lowest nodes; sets of unused nodes get
    /// no number of their own.
    fn numbered(sets: &mut UnionFind, used: &[bool]) -> Self {
        let (mut of, mut lowest) = (vec![0; sets.len()], Vec::new());
        for i in 0..sets.len() {
            // The root is the lowest node, so it is numbered before the other nodes are reached.
            let r = sets.root(i as u32) as usize;
            if r == i && used[i] {
                of[i] = lowest.len() as u32;
                lowest.push(i as u32);
            } else {
                of[i] = of[r];
            }
        }
        Self { of, lowest }
    }

    /// Computes the number of triangles, volume and area of each shell. Volumes are taken about the
    /// centre of all shells, which keeps cancellation small.
    pub(super) fn measure(&self, of: Triangles<'_>) -> Vec<Shell> {
        let o = bounds(of).center();
        let parts: Vec<Vec<Sum>> = blocks(of.triangles.len(), ITEMS_PER_TASK)
            .into_par_iter()
            .map(|range| self.sums(of, &of.triangles[range], o))
            .collect();
        let mut shells: Vec<Shell> = self
            .lowest
            .iter()
            .map(|&node| Shell {
                node,
                ..Shell::default()
            })
            .collect();
        for sum in parts.into_iter().flatten() {
            let s = &mut shells[sum.shell as usize];
            s.triangles += sum.triangles;
            s.volume += sum.volume;
            s.area += sum.area;
        }
        shells
    }

    /// Sums over triangles, once per run of triangles of one shell: neighbours in the list are
    /// mostly neighbours in space.
    fn sums(&self, of: Triangles<'_>, triangles: &[[u32; 3]], o: Point3) -> Vec<Sum> {
        let mut sums: Vec<Sum> = Vec::new();
        for t in triangles.iter().filter(|t| !is_degenerate(t)) {
            let [a, b, c] = of.corners(*t).map(|p| sub(p, o));
            let n = cross(sub(b, a), sub(c, a));
            let shell = self.of[t[0] as usize];
            if sums.last().is_none_or(|s| s.shell != shell) {
                sums.push(Sum {
                    shell,
                    triangles: 0,
                    volume: 0.0,
                    area: 0.0,
                });
            }
            if let Some(s) = sums.last_mut() {
                s.triangles += 1;
                s.volume += dot(a, n) / 6.0;
                s.area += 0.5 * norm(n);
            }
        }
        sums
    }
}

/// Returns the box around the corners of all triangles.
fn bounds(of: Triangles<'_>) -> Aabb {
    Aabb::from_points(
        of.triangles
            .iter()
            .flatten()
            .map(|&i| &of.points[i as usize]),
    )
}

/// Finds misplaced shells: the winding number of the other shells should be 0 around a component
/// and 1 around a cavity.
///
/// It is counted along a ray, each crossing with its sign, exactly; a ray that meets an edge is
/// replaced by another one. A shell that touches others has no such number; touching is an
/// intersection, and reported as one.
pub(super) fn misplaced(
    of: Triangles<'_>,
    shells: &[Shell],
    numbers: &Shells,
    tree: &BoxTree,
    room: usize,
) -> Defects {
    let bounds = bounds(of);
    let windings: Vec<Option<i32>> = shells
        .par_iter()
        .map(|shell| {
            let from = of.point(shell.node);
            let mut rays = (0..MAX_RAYS).map(|k| ray_end(from, &bounds, k));
            rays.find_map(|end| winding(of, numbers, tree, shell.node, end))
        })
        .collect();
    let mut defects = Defects::default();
    for (shell, winding) in shells.iter().zip(windings) {
        let wanted = i32::from(shell.volume <= 0.0);
        if winding.is_some_and(|w| w != wanted) {
            defects.add(room, || Place {
                at: of.point(shell.node),
                nodes: vec![shell.node],
                elements: Vec::new(),
                value: winding.map_or(0.0, f64::from),
            });
        }
    }
    defects
}

/// Returns the end of ray number `k`: a point beyond the bounds, nearly in direction +x so that the
/// box around the ray is thin.
fn ray_end(from: Point3, bounds: &Aabb, k: u32) -> Point3 {
    let reach = bounds.diagonal();
    let [s, t] = RAY_SEQUENCE_STEPS.map(|turn| f64::from(k + 1) * turn);
    let tilt = FIRST_RAY_TILT * reach * f64::from(k + 1);
    [
        bounds.hi[0] + reach,
        from[1] + tilt * (s.fract() - 0.5),
        from[2] + tilt * (t.fract() - 0.5),
    ]
}

/// Relation of a segment to a triangle.
enum Passage {
    /// The segment misses the triangle.
    Misses,
    /// The segment crosses the interior: +1 where it leaves the solid, −1 where it enters.
    Through(i32),
    /// The segment meets the border, or has an end in the plane: the winding number is undefined.
    Touches,
}

/// Returns the winding number of the other shells around a node; `None` if the segment to `end`
/// meets one of their edges.
fn winding(
    of: Triangles<'_>,
    shells: &Shells,
    tree: &BoxTree,
    node: u32,
    end: Point3,
) -> Option<i32> {
    let from = of.point(node);
    let (mut count, mut certain) = (0, true);
    tree.query(&Aabb::from_points(&[from, end]), |k| {
        let t = of.triangles[k as usize];
        if shells.of[t[0] as usize] == shells.of[node as usize] {
            return;
        }
        match passage(from, end, of.corners(t)) {
            Passage::Misses => {}
            Passage::Through(sign) => count += sign,
            Passage::Touches => certain = false,
        }
    });
    certain.then_some(count)
}

/// Classifies a segment and a triangle by exact signs of volumes.
fn passage(from: Point3, end: Point3, [a, b, c]: [Point3; 3]) -> Passage {
    let (s, e) = (volume_sign(a, b, c, from), volume_sign(a, b, c, end));
    if s * e > 0 {
        return Passage::Misses;
    }
    let sides = [
        volume_sign(from, end, a, b),
        volume_sign(from, end, b, c),
        volume_sign(from, end, c, a),
    ];
    if sides.contains(&1) && sides.contains(&-1) {
        Passage::Misses
    } else if s == 0 || e == 0 || sides.contains(&0) {
        Passage::Touches
    } else {
        // The ray leaves through a triangle that is counterclockwise seen from its end.
        Passage::Through(i32::from(e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_through_beside_and_along_a_triangle() {
        let t = [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        let up = |x: f64, y: f64| passage([x, y, -1.0], [x, y, 1.0], t);
        assert!(matches!(up(1.0, 1.0), Passage::Through(1)));
        let down = passage([1.0, 1.0, 1.0], [1.0, 1.0, -1.0], t);
        assert!(matches!(down, Passage::Through(-1)));
        assert!(matches!(up(2.0, 2.0), Passage::Misses));
        assert!(matches!(up(0.0, 1.0), Passage::Touches));
        let ends_on_it = passage([1.0, 1.0, -1.0], [1.0, 1.0, 0.0], t);
        assert!(matches!(ends_on_it, Passage::Touches));
    }
}
