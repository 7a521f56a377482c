//! Evidence that the faces of a solid are the surface of the model, independent of the nodes of the
//! mesh that its topology came from.
//!
//! The surface of the model is closed, and its feature curves divide it. If edges run along all of
//! these curves, a face lies on the surface of the model either wholly or not at all, so that one
//! point decides; and a closed surface on the surface of the model is all of it, component by
//! component.

use crate::build::MeshedBrep;
use crate::facets::{FacetOptions, Facets, facets};
use crate::locus::Distance;
use crate::newton::{gap, meet};
use crate::tolerance::READER_TOLERANCE;
use crate::whole::Boundary;
use isoform_control::Control;
use isoform_geom::{Point3, Solid, cross, distance_to_segment, middle, norm, sub};

/// Maximum distance of an edge from its chords, in sizes of the model. Points of feature curves
/// that are on both surfaces of an edge belong to it within twice this distance.
const MAX_CHORD_HEIGHT: f64 = 1e-4;

/// Returns true if all faces lie on exact surfaces, edges run along all feature curves (sampled by
/// `curves`), and a point inside each face is on the surface of the model. False if that is not
/// shown.
#[must_use]
pub fn stands_alone(
    built: &MeshedBrep,
    solid: &dyn Solid,
    curves: impl IntoIterator<Item = Point3>,
    control: &Control<'_>,
) -> bool {
    let options = FacetOptions {
        chord: MAX_CHORD_HEIGHT * built.size,
        longest: f64::INFINITY,
    };
    let made = built
        .is_exact()
        .then(|| facets(&built.brep, &options, control).ok());
    let Some(facets) = made.flatten() else {
        return false;
    };
    let alone = StandaloneCheck {
        built,
        facets,
        limit: 0.1 * READER_TOLERANCE * built.size,
    };
    curves.into_iter().all(|p| alone.is_on_edge(p)) && alone.are_faces_on(&Boundary(solid))
}

struct StandaloneCheck<'a> {
    built: &'a MeshedBrep,
    facets: Facets,
    /// Maximum distance of a point from a surface that it lies on, in model units.
    limit: f64,
}

impl StandaloneCheck<'_> {
    /// Returns true if an edge runs through the point.
    fn is_on_edge(&self, p: Point3) -> bool {
        let reach = 2.0 * MAX_CHORD_HEIGHT * self.built.size;
        let is_near = |along: &[(f64, u32)]| {
            along.windows(2).any(|ends| {
                let ends = [ends[0], ends[1]].map(|n| self.facets.points[n.1 as usize]);
                distance_to_segment(p, ends) <= reach
            })
        };
        let mut edges = self.facets.along.iter().zip(&self.built.beside);
        edges.any(|(along, beside)| is_near(along) && gap(beside, p) <= self.limit)
    }

    /// Returns true if the middle of the largest triangle of each face is on the surface of the
    /// model.
    fn are_faces_on(&self, model: &Boundary<'_>) -> bool {
        let faces = &self.built.brep.faces;
        let mut largest = vec![(0.0, None); faces.len()];
        for (t, face) in self.facets.triangles.iter().zip(&self.facets.face_of) {
            let corners = t.map(|v| self.facets.points[v as usize]);
            let [a, b, c] = corners;
            let twice = norm(cross(sub(b, a), sub(c, a)));
            let best = &mut largest[*face as usize];
            if twice > best.0 {
                *best = (twice, Some(middle(corners)));
            }
        }
        let is_on = |(face, inside): (&isoform_geom::brep::Face, Option<Point3>)| {
            inside.is_some_and(|p| {
                let on = meet([&face.surface], p);
                model.distance(on).0.abs() <= self.limit
            })
        };
        faces
            .iter()
            .zip(largest.into_iter().map(|l| l.1))
            .all(is_on)
    }
}
