//! Distances by the faces of a solid, or the parts of a model, to which points are nearest.

use super::nearest::TriangleTree;
use super::{CheckedSide, Distances, SideSamples, summary};
use isoform_fit::Template;
use isoform_geom::Point3;
use isoform_geom::brep::Face;
use rayon::prelude::*;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::HashMap;

/// Distances of the points that are nearest to one face or part of the other side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FaceDistances {
    /// Name of the part of a model, or of the face of a CAD file. Pieces of one part
    /// are one face, and those without a name are numbered.
    pub face: String,
    /// Distances of the points; without points all are NaN.
    #[serde(flatten)]
    pub distances: Distances,
}

/// Returns distances by the faces of a side, in the order of these; none for points and meshes.
pub(super) fn by_face<'b>(
    side: &'b CheckedSide<'b>,
    sampled: &SideSamples,
    points: &[Point3],
    distances: &[f64],
) -> Vec<FaceDistances> {
    let mut nearest = vec![u32::MAX; points.len()];
    let mut names: Vec<Cow<'_, str>> = match side {
        CheckedSide::Model(_, values, Some(template)) => {
            template.parts(points, values, &mut nearest);
            template.part_names().iter().map(Cow::from).collect()
        }
        CheckedSide::Solid(solid) => {
            on_triangles(points, sampled, &solid.facets().face_of, &mut nearest);
            let brep = solid.brep();
            let part = |face: &'b Face| Cow::from(&brep.parts[face.part as usize]);
            brep.faces.iter().map(part).collect()
        }
        CheckedSide::Shape(shape) => {
            on_triangles(points, sampled, &shape.facets().face_of, &mut nearest);
            let faces = shape.shape().faces.iter();
            faces.map(|face| Cow::from(&face.name)).collect()
        }
        CheckedSide::Points(_) | CheckedSide::Mesh(..) | CheckedSide::Model(..) => {
            return Vec::new();
        }
    };
    for (i, name) in names.iter_mut().enumerate().filter(|(_, n)| n.is_empty()) {
        *name = format!("face {i}").into();
    }
    let mut groups: Vec<(&str, Vec<f64>)> = Vec::new();
    let mut group_of: HashMap<&str, usize> = HashMap::new();
    let group: Vec<usize> = names
        .iter()
        .map(|name| {
            *group_of.entry(name).or_insert_with(|| {
                groups.push((name, Vec::new()));
                groups.len() - 1
            })
        })
        .collect();
    for (face, distance) in nearest.iter().zip(distances) {
        if let Some(group) = group.get(*face as usize) {
            groups[*group].1.push(*distance);
        }
    }
    let of = |(name, distances): (&str, Vec<f64>)| FaceDistances {
        face: name.to_owned(),
        distances: summary(&distances),
    };
    groups.into_iter().map(of).collect()
}

/// Finds the faces of the triangles nearest to points; `u32::MAX` where no distance is finite.
fn on_triangles(points: &[Point3], sampled: &SideSamples, face_of: &[u32], nearest: &mut [u32]) {
    let tree = TriangleTree::new(&sampled.triangles);
    let face = |p: &Point3| {
        let triangle = tree.nearest_triangle(*p).map(|(triangle, _)| triangle);
        triangle.map_or(u32::MAX, |t| face_of[t as usize])
    };
    let all = nearest.par_iter_mut().zip(points);
    all.for_each(|(nearest, p)| *nearest = face(p));
}
