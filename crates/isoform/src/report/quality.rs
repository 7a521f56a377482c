//! Report of the shape of elements, in the measures of finite element programs.

use super::mesh::RatioReport;
use isoform_check::{Certificate, PartTurn, Place, TetQuality, Walls};
use isoform_geom::Point3;
use serde::Serialize;

/// Number of the worst elements by each measure.
const WORST_PER_MEASURE: usize = 10;

/// Shape of the tetrahedra, in the measures of Verdict (SAND2007-1751) and VTK.
#[derive(Clone, Debug, Serialize)]
pub struct QualityReport {
    /// Aspect ratio: the longest edge over 2√6 times the radius of the inscribed sphere; 1 for a
    /// regular tetrahedron, large for a flat one.
    pub aspect_ratio: AspectReport,
    /// Scaled Jacobian of the corners: √2 times the determinant of the edges at a corner, over the
    /// largest product of the lengths of three edges at a corner; 1 for a regular tetrahedron.
    pub scaled_jacobian: RatioReport,
    /// Ten worst elements by each measure.
    pub worst: Vec<WorstElement>,
}

/// Statistics of the aspect ratio over all elements.
#[derive(Clone, Debug, Serialize)]
pub struct AspectReport {
    /// Largest ratio.
    pub max: f64,
    /// Mean ratio.
    pub mean: f64,
}

/// Element that is among the worst by a measure.
#[derive(Clone, Debug, Serialize)]
pub struct WorstElement {
    /// Number of the element in .inp, where tetrahedra count from 1 in the order of the mesh;
    /// `None` in the certificate of a region, which numbers its elements anew.
    pub element: Option<u32>,
    /// Name of the measure: `scaled Jacobian`, `aspect ratio`, or `curved Jacobian`, which is the
    /// least over the largest Jacobian in an element of order 2.
    pub measure: &'static str,
    /// Value of the measure.
    pub value: f64,
    /// Centre of the element.
    pub at: Point3,
}

/// Layers of elements through the walls: from the centre of a triangle of the surface along its
/// inward normal to an opposite side, inclined by less than 45 degrees; the layers are the fewest
/// edges, of the elements on the way, from side to side.
#[derive(Clone, Debug, Serialize)]
pub struct WallsReport {
    /// Fewest layers of elements.
    pub layers_min: usize,
    /// Fifth percentile of the numbers of layers, over the triangles of the surface.
    pub layers_p5: usize,
    /// Thickness of the wall where the layers are fewest, in model units.
    pub thickness: f64,
    /// Centre of the triangle there.
    pub at: Point3,
}

/// Facets of a part of the surface, where they follow it most coarsely.
#[derive(Clone, Debug, Serialize)]
pub struct FacetsReport {
    /// Name of the part.
    pub part: String,
    /// Largest angle between the normals of neighbouring triangles, in degrees.
    pub angle: f64,
    /// Radius of curvature there, in model units; `None` for a plane.
    pub radius: Option<f64>,
    /// Largest distance of a face of the part from the surface, in model units.
    pub distance: Option<f64>,
    /// Place of the angle.
    pub at: Point3,
}

impl QualityReport {
    /// Creates the report of the tetrahedra of a certificate; `None` if it has none.
    pub(super) fn new(c: &Certificate) -> Option<Self> {
        let q = c.tets.as_ref()?;
        Some(Self {
            aspect_ratio: AspectReport {
                max: q.aspect_max,
                mean: q.aspect_mean,
            },
            scaled_jacobian: RatioReport {
                min: q.scaled_jacobian_min,
                mean: q.scaled_jacobian_mean,
            },
            worst: worst(c, q),
        })
    }

    /// Removes the numbers of the elements.
    pub(super) fn without_numbers(mut self) -> Self {
        self.worst.iter_mut().for_each(|worst| worst.element = None);
        self
    }
}

/// Returns the worst elements by each measure.
fn worst(c: &Certificate, q: &TetQuality) -> Vec<WorstElement> {
    let curved = c.curved.as_ref().map_or(&[][..], |q| &q.worst);
    let lists = [
        ("scaled Jacobian", &q.worst_jacobian[..]),
        ("aspect ratio", &q.worst_aspect),
        ("curved Jacobian", curved),
    ];
    let named = |measure| {
        move |place: &Place| WorstElement {
            element: place.elements.first().map(|k| k + 1),
            measure,
            value: place.value,
            at: place.at,
        }
    };
    let worst = lists.into_iter();
    worst
        .flat_map(|(measure, places)| places.iter().take(WORST_PER_MEASURE).map(named(measure)))
        .collect()
}

impl WallsReport {
    pub(super) fn new(walls: &Walls) -> Self {
        Self {
            layers_min: walls.layers_min,
            layers_p5: walls.layers_low,
            thickness: walls.thinnest.value,
            at: walls.thinnest.at,
        }
    }
}

impl FacetsReport {
    /// Creates the reports of all parts of a certificate.
    pub(super) fn all(c: &Certificate) -> Vec<Self> {
        c.turns.iter().map(|turn| Self::new(turn, c)).collect()
    }

    fn new(turn: &PartTurn, c: &Certificate) -> Self {
        let mut parts = c.deviation.iter().flat_map(|d| &d.parts);
        let own = parts.find(|part| part.part == turn.part);
        Self {
            part: turn.part.clone(),
            angle: turn.angle,
            radius: super::finite(turn.radius),
            distance: own.and_then(|part| super::finite(part.faces.max)),
            at: turn.place.at,
        }
    }
}
