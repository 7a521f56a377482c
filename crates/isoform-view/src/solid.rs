//! Solids in the document of a page: triangles, and the surfaces of the faces to which they belong.

use crate::blob::Blobs;
use crate::mesh;
use isoform::ExactSolid;
use isoform::cad::PreparedShape;
use isoform::geom::brep::{Axes, Surface};
use isoform::geom::cad;
use serde_json::{Value, json};

/// Returns the layer of a solid.
pub(crate) fn layer(name: &str, solid: &ExactSolid, blobs: &mut Blobs) -> Value {
    let mut layer = mesh::layer(name, &solid.mesh(), blobs);
    layer["kind"] = json!("solid");
    layer["triangleFaces"] = blobs.u32(&solid.facets().face_of);
    let faces = solid.brep().faces.iter();
    layer["surfaces"] = faces.map(|face| surface(&face.surface)).collect();
    layer
}

/// Returns the layer of the shape of a CAD file.
pub(crate) fn shape_layer(name: &str, shape: &PreparedShape, blobs: &mut Blobs) -> Value {
    let mut layer = mesh::layer(name, &shape.mesh(), blobs);
    layer["kind"] = json!("solid");
    layer["triangleFaces"] = blobs.u32(&shape.facets().face_of);
    let faces = shape.shape().faces.iter();
    layer["surfaces"] = faces.map(|face| cad_surface(&face.surface)).collect();
    layer
}

/// Returns name, frame and measures of a surface of a CAD file; null for those that pages do not
/// compute.
fn cad_surface(surface: &cad::CadSurface) -> Value {
    match surface {
        cad::CadSurface::Plane(axes) => with("plane", axes, &[]),
        cad::CadSurface::Cylinder(axes, radius) => with("cylinder", axes, &[*radius]),
        cad::CadSurface::Cone(axes, radius, angle) => with("cone", axes, &[*radius, *angle]),
        cad::CadSurface::Sphere(axes, radius) => with("sphere", axes, &[*radius]),
        cad::CadSurface::Torus(axes, major, minor) => with("torus", axes, &[*major, *minor]),
        _ => Value::Null,
    }
}

/// Returns name, frame and measures of a surface; null for splines, which pages do not compute.
fn surface(surface: &Surface) -> Value {
    match surface {
        Surface::Plane(axes) => with("plane", axes, &[]),
        Surface::Cylinder(axes, radius) => with("cylinder", axes, &[*radius]),
        Surface::Cone(axes, radius, angle) => with("cone", axes, &[*radius, *angle]),
        Surface::Sphere(axes, radius) => with("sphere", axes, &[*radius]),
        Surface::Torus(axes, major, minor) => with("torus", axes, &[*major, *minor]),
        Surface::Ellipsoid(ball) => with("ellipsoid", &ball.axes, &ball.half),
        Surface::Revolved(_) | Surface::Graph(_) => Value::Null,
    }
}

fn with(kind: &str, axes: &Axes, measures: &[f64]) -> Value {
    json!({"kind": kind, "origin": axes.origin, "z": axes.z, "x": axes.x, "measures": measures})
}
