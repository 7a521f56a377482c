//! Exact surfaces of the parts of a mesh.
//!
//! A surface is recognised from points of the part's own function, found by Newton's method
//! throughout the box of the model: a small patch of a cone or a torus determines it poorly.
//! If that fails, the nodes of the mesh are used.

use crate::BrepError;
use crate::newton::POINT_TOLERANCE;
use isoform_geom::brep::{Axes, Surface};
use isoform_geom::{Aabb, Point3, Quadric, dot, norm, sub};

/// Function that returns the quadric or torus through points with unit normals, to rounding.
pub type Recognize<'a> = dyn Fn(&[Point3], &[Point3]) -> Option<Quadric> + 'a;

/// Number of starting points in each direction of the lattice from which points are sought.
const LATTICE_SIZE: usize = 7;

/// Returns the surface with its axis turned towards the points if it is a cone: a cone has two
/// nappes, its surface is only the one along its axis.
fn towards(surface: Surface, points: &[Point3]) -> Surface {
    let Surface::Cone(axes, radius, half_angle) = surface else {
        return surface;
    };
    let base = surface.base_of_v();
    let heights = points.iter().map(|p| axes.local(*p)[2] - base);
    if heights.sum::<f64>() >= 0.0 {
        return surface;
    }
    Surface::Cone(
        Axes::along(axes.origin, axes.z.map(|v| -v)),
        radius,
        half_angle,
    )
}

/// A smooth part of a surface, and the input for recognising its surface.
pub(crate) struct SurfacePart<'a> {
    /// Value and gradient of its function.
    pub(crate) function: &'a dyn Fn(Point3) -> (f64, Point3),
    /// Box of the model.
    pub(crate) bounds: Aabb,
    /// Name of the part.
    pub(crate) name: &'a str,
}

impl SurfacePart<'_> {
    /// Returns the exact surface that the part lies on, from nodes of the mesh.
    ///
    /// # Errors
    /// [`BrepError::NoSurface`], [`BrepError::OffSurface`], [`BrepError::Spindle`].
    pub(crate) fn surface(
        &self,
        nodes: &[Point3],
        recognize: &Recognize<'_>,
    ) -> Result<Surface, BrepError> {
        let [x, y, z] = self.bounds.size();
        let limit = POINT_TOLERANCE * x.max(y).max(z);
        let part = self.name.to_owned();
        let mut why = BrepError::NoSurface { part, kind: None };
        let nodes = &self.nodes_on(nodes, limit);
        let every = nodes.len().div_ceil(400).max(1);
        let some: Vec<Point3> = nodes.iter().copied().step_by(every).collect();
        for starts in [self.lattice(), some] {
            let found: Vec<(Point3, Point3)> = starts
                .into_iter()
                .filter_map(|p| self.point_near(p))
                .collect();
            let (points, normals): (Vec<Point3>, Vec<Point3>) = found.into_iter().unzip();
            let Some(quadric) = recognize(&points, &normals) else {
                continue;
            };
            match Self::fits(&quadric, nodes, limit, self.name) {
                Ok(surface) => return Ok(surface),
                Err(error) => why = error,
            }
        }
        Err(why)
    }

    /// Returns the nodes on the part's own function, or all if there are none. Where pieces touch,
    /// the mesh may have a node beyond the contact, which does not lie on the surface.
    fn nodes_on(&self, nodes: &[Point3], limit: f64) -> Vec<Point3> {
        let is_on = |p: &&Point3| {
            let (value, gradient) = (self.function)(**p);
            value.abs() <= limit * norm(gradient)
        };
        let on: Vec<Point3> = nodes.iter().filter(is_on).copied().collect();
        if on.is_empty() { nodes.to_vec() } else { on }
    }

    /// Returns the surface of a quadric, if it is of a known kind and the nodes lie on it.
    fn fits(
        quadric: &Quadric,
        nodes: &[Point3],
        limit: f64,
        name: &str,
    ) -> Result<Surface, BrepError> {
        let (part, kind) = (name.to_owned(), quadric.name());
        // A tube of almost the radius of its circle counts as reaching the axis.
        if matches!(quadric, Quadric::Torus { major, minor, .. } if *minor > 0.98 * major) {
            return Err(BrepError::Spindle { part });
        }
        let Some(surface) = Surface::from_quadric(quadric) else {
            let kind = Some(kind);
            return Err(BrepError::NoSurface { part, kind });
        };
        let surface = towards(surface, nodes);
        let off = nodes.iter().map(|p| surface.distance(*p).0.abs());
        let by = off.fold(0.0, f64::max);
        if by <= limit {
            Ok(surface)
        } else {
            Err(BrepError::OffSurface { part, kind, by })
        }
    }

    /// Returns a lattice of points of the box of the model.
    fn lattice(&self) -> Vec<Point3> {
        let size = self.bounds.size();
        let at = |k: usize, i: usize| {
            let share = (i as f64 + 0.37) / LATTICE_SIZE as f64;
            self.bounds.lo[k] + share * size[k]
        };
        let all = 0..LATTICE_SIZE.pow(3);
        all.map(|n| {
            [
                at(0, n % LATTICE_SIZE),
                at(1, n / LATTICE_SIZE % LATTICE_SIZE),
                at(2, n / LATTICE_SIZE / LATTICE_SIZE),
            ]
        })
        .collect()
    }

    /// Returns the point of the part's function near a point, with the unit normal; `None` if none
    /// is found within the size of the model.
    fn point_near(&self, start: Point3) -> Option<(Point3, Point3)> {
        let reach = self.bounds.diagonal();
        let mut p = start;
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let (value, g) = (self.function)(p);
            let g2 = dot(g, g);
            if !(g2 > 0.0 && g2.is_finite() && value.is_finite()) {
                return None;
            }
            let step = value.abs() / g2.sqrt();
            let (settled, normal) = (step <= 1e-13 * reach, g.map(|v| v / g2.sqrt()));
            p = std::array::from_fn(|k| p[k] - value / g2 * g[k]);
            // One step more than needed adds the last digits.
            if settled && step >= 0.5 * last || step == 0.0 {
                let is_near = norm(sub(p, start)) <= reach;
                return is_near.then_some((p, normal));
            }
            last = step;
        }
        (last <= 1e-13 * reach && norm(sub(p, start)) <= reach).then(|| {
            let g = (self.function)(p).1;
            (p, g.map(|v| v / norm(g)))
        })
    }
}
