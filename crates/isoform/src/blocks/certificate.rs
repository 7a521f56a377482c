//! Certificate of a block.
//!
//! A block is checked together with its surroundings, so that elements near its sides are checked
//! as in the whole mesh; findings count if they lie in the block's room.

use crate::MeshModelOptions;
use isoform_check::quality::six_volume;
use isoform_check::{self as check, Certificate, Defects, Limits, certify};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid, cross, norm, sub};
use isoform_mesh::blocks::{BlockMesh, Plan, holds};
use serde::{Deserialize, Serialize};

/// Maximum number of places kept of each kind of finding. The block's own elements come first, so
/// that those around it take the remaining places.
const MAX_PLACES_PER_DEFECT: usize = 1000;

/// Measures of a block that was written. Lengths are in model units.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct BlockFigures {
    /// Name of the block's file.
    pub file: String,
    /// Number of nodes.
    pub points: usize,
    /// Number of triangles of the surface.
    pub triangles: usize,
    /// Number of tetrahedra.
    pub tets: usize,
    /// Volume of the tetrahedra, in cubic units.
    pub volume: f64,
    /// Area of the triangles, in square units.
    pub area: f64,
    /// Smallest and largest dihedral angle in the block and around it, in degrees; `None` for an
    /// empty block.
    pub dihedral_angles: Option<[f64; 2]>,
    /// Largest distance of a node of the surface from its part.
    pub node_distance: f64,
    /// Largest distance of a sample of a face from its part.
    pub face_distance: f64,
    /// Length of the feature curves in the block, and length of their parts with edges.
    pub curves: [f64; 2],
    /// Number of faces shared with other blocks.
    pub shared_faces: usize,
    /// Defects of the block, and measures beyond their limits.
    pub failures: Vec<BlockFailure>,
}

/// Kind of defect in a block, or measure beyond its limit.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct BlockFailure {
    /// Kind of failure, as hyphenated words.
    pub code: String,
    /// Description of the failure, one sentence.
    pub message: String,
    /// Number of defects of this kind.
    pub count: usize,
    /// Place of one of them; `None` if the failure is not local.
    pub at: Option<Point3>,
}

/// Measures and certifies a block; the name of its file is left empty.
pub(super) fn figures(
    closed: &BlockMesh,
    solid: &dyn Solid,
    plan: &Plan,
    k: usize,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> BlockFigures {
    let mesh = &closed.mesh;
    let corner = |v: u32| mesh.points[v as usize];
    let six_volumes = mesh.tets.iter().map(|t| six_volume(t.map(corner)));
    let areas = mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(corner);
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    });
    let figures = BlockFigures {
        points: mesh.points.len(),
        triangles: mesh.triangles.len(),
        tets: mesh.tets.len(),
        volume: six_volumes.sum::<f64>() / 6.0,
        area: areas.sum(),
        shared_faces: closed.faces.len(),
        ..BlockFigures::default()
    };
    if mesh.tets.is_empty() {
        return figures;
    }
    let found = certified(closed, solid, plan, plan.room(0, k), options, control);
    let failures = found.failures();
    let deviation = found.deviation.as_ref();
    let coverage = found.coverage.as_ref();
    BlockFigures {
        dihedral_angles: found
            .tets
            .as_ref()
            .map(|t| [t.dihedral_min, t.dihedral_max]),
        node_distance: deviation.map_or(0.0, |d| d.nodes.max),
        face_distance: deviation.map_or(0.0, |d| d.faces.max),
        curves: coverage.map_or([0.0; 2], |c| [c.length, c.covered * c.length]),
        failures: failures
            .into_iter()
            .map(|f| BlockFailure {
                code: f.code.to_owned(),
                message: f.message,
                count: f.count,
                at: f.place.map(|p| p.at),
            })
            .collect(),
        ..figures
    }
}

/// Certifies a block together with its surroundings, and keeps the findings in its room.
fn certified(
    closed: &BlockMesh,
    solid: &dyn Solid,
    plan: &Plan,
    room: Aabb,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Certificate {
    let curves: Vec<Vec<Point3>> = plan
        .curves
        .iter()
        .flat_map(|curve| clipped(&curve.points, &room))
        .collect();
    let corners = plan.corners.iter().copied();
    let corners: Vec<Point3> = corners.filter(|p| holds(&room, *p)).collect();
    let wanted = check::Options {
        places: MAX_PLACES_PER_DEFECT,
        size: Some(plan.size),
        region: options.mesh.region,
        curves: &curves,
        corners: &corners,
        // A stretch of a curve without an edge is a larger share of a block than of the whole.
        limits: Limits {
            covered: 0.0,
            ..options.limits
        },
        ..check::Options::default()
    };
    let mut found = certify(&closed.around, Some(solid), &wanted, control);
    keep_within(&mut found, &room);
    found
}

/// Returns the parts of a polyline in a room.
fn clipped(points: &[Point3], room: &Aabb) -> Vec<Vec<Point3>> {
    let mut stretches: Vec<Vec<Point3>> = Vec::new();
    let mut goes_on = false;
    for chord in points.windows(2) {
        let (from, to) = (chord[0], chord[1]);
        let [first, last] = shares_within(from, to, room);
        if first < last {
            let at = |t: f64| std::array::from_fn(|i| from[i] + t * (to[i] - from[i]));
            match stretches.last_mut().filter(|_| goes_on && first == 0.0) {
                Some(stretch) => stretch.push(at(last)),
                None => stretches.push(vec![at(first), at(last)]),
            }
        }
        goes_on = first < last && last == 1.0;
    }
    stretches
}

/// Returns the interval of the parameters, from 0 to 1, at which a segment lies in a room; the
/// second is not larger if it misses the room.
fn shares_within(from: Point3, to: Point3, room: &Aabb) -> [f64; 2] {
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for i in 0..3 {
        let way = to[i] - from[i];
        if way == 0.0 {
            if !(room.lo[i]..room.hi[i]).contains(&from[i]) {
                return [1.0, 0.0];
            }
            continue;
        }
        let shares = [room.lo[i], room.hi[i]].map(|side| (side - from[i]) / way);
        first = first.max(shares[0].min(shares[1]));
        last = last.min(shares[0].max(shares[1]));
    }
    [first, last]
}

/// Drops the findings outside of a room, and those at the border of the surroundings.
fn keep_within(found: &mut Certificate, room: &Aabb) {
    if let Some(s) = &mut found.surface {
        // Shells are not complete in a block.
        s.misplaced_shells = Defects::default();
        for defects in [
            &mut s.open_edges,
            &mut s.crowded_edges,
            &mut s.misoriented_edges,
            &mut s.pinched_nodes,
            &mut s.repeated_triangles,
            &mut s.degenerate_triangles,
            &mut s.flat_triangles,
            &mut s.loose_edges,
        ] {
            keep(defects, room);
        }
    }
    if let Some(i) = &mut found.intersections {
        keep(&mut i.pairs, room);
    }
    if let Some(v) = &mut found.volume {
        for defects in [
            &mut v.inverted,
            &mut v.flat,
            &mut v.crowded_faces,
            &mut v.folded_faces,
            &mut v.uncovered_faces,
            &mut v.inward_triangles,
            &mut v.inner_triangles,
            &mut v.loose_triangles,
        ] {
            keep(defects, room);
        }
    }
    if let Some(d) = &mut found.deviation {
        keep(&mut d.misclassified, room);
    }
}

/// Keeps the findings in a room. If places were left out and all others lie in the room, the
/// omitted ones count, too.
fn keep(defects: &mut Defects, room: &Aabb) {
    let before = defects.places.len();
    defects.places.retain(|place| holds(room, place.at));
    if defects.places.len() < before || defects.count == before {
        defects.count = defects.places.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_cut_at_a_room() {
        let xs = [0.0, 2.5, 9.0, 2.0, 2.5, 2.0];
        let line = xs.map(|x| [x, 0.0, 0.0]);
        let room = Aabb {
            lo: [1.0, -1.0, f64::NEG_INFINITY],
            hi: [3.0, 1.0, f64::INFINITY],
        };
        let found: Vec<Vec<f64>> = clipped(&line, &room)
            .iter()
            .map(|s| s.iter().map(|p| p[0]).collect())
            .collect();
        assert_eq!(found, [vec![1.0, 2.5, 3.0], vec![3.0, 2.0, 2.5, 2.0]]);
        assert!(clipped(&line.map(|[x, _, _]| [x, 1.0, 0.0]), &room).is_empty());
    }
}
