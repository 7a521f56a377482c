//! Loci of equations: surfaces, exact or not, and zero sets of functions.

use isoform_geom::brep::Surface;
use isoform_geom::{Field, Point3, dot};
use std::fmt;
use std::sync::Arc;

/// A locus with a distance function, as Newton's method needs it.
pub(crate) trait Distance {
    /// Returns the signed distance of a point, at least to first order, and its unit gradient.
    fn distance(&self, p: Point3) -> (f64, Point3);
}

impl Distance for Surface {
    fn distance(&self, p: Point3) -> (f64, Point3) {
        Self::distance(self, p)
    }
}

/// Returns the distance, to first order, and the unit normal from a function's value and gradient:
/// both outward, where the function is negative.
pub(crate) fn outward(value: f64, gradient: Point3) -> (f64, Point3) {
    let length = dot(gradient, gradient).sqrt();
    (-value / length, gradient.map(|v| -v / length))
}

/// Points that satisfy an equation.
#[derive(Clone)]
pub enum Locus {
    /// A surface.
    Exact(Surface),
    /// Zero set of a function; its distance is positive where the function is negative, outside.
    Zero(Arc<dyn Field>),
}

impl Locus {
    /// Returns the surface; `None` for the zero set of a function.
    pub fn surface(&self) -> Option<&Surface> {
        match self {
            Self::Exact(surface) => Some(surface),
            Self::Zero(_) => None,
        }
    }
    /// Returns the second derivative of the distance along a tangent, at a point of the locus.
    pub(crate) fn bending(&self, p: Point3, along: Point3) -> f64 {
        match self {
            Self::Exact(surface) => surface.bending(p, along),
            Self::Zero(field) => {
                let jet = field.jet(p);
                let h = jet.hessian();
                let second: f64 = (0..9).map(|n| h[n] * along[n / 3] * along[n % 3]).sum();
                -second / dot(jet.g, jet.g).sqrt()
            }
        }
    }
}

impl Distance for Locus {
    fn distance(&self, p: Point3) -> (f64, Point3) {
        match self {
            Self::Exact(surface) => surface.distance(p),
            Self::Zero(field) => {
                let jet = field.jet(p);
                outward(jet.v, jet.g)
            }
        }
    }
}

impl PartialEq for Locus {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Exact(a), Self::Exact(b)) => a == b,
            (Self::Zero(a), Self::Zero(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

impl fmt::Debug for Locus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exact(surface) => surface.fmt(f),
            Self::Zero(_) => f.write_str("Zero"),
        }
    }
}
