//! Copies of parts in their places.

use isoform_geom::cad::{CadSurface, Coedge, Edge, Face, Placement, Shape, Shell};

/// Appends a part to a shape, in a place.
pub(super) fn append(shape: &mut Shape, part: &Shape, by: &Placement, name: &str) {
    let vertex = shape.vertices.len() as u32;
    let edge = shape.edges.len() as u32;
    let face = shape.faces.len() as u32;
    let solid = shape.solids.len() as u32;
    shape
        .vertices
        .extend(part.vertices.iter().map(|p| by.point(*p)));
    shape.edges.extend(part.edges.iter().map(|e| Edge {
        curve: e.curve.placed(by),
        range: e.range,
        ends: e.ends.map(|v| v + vertex),
    }));
    let moved = |c: &Coedge| Coedge {
        edge: c.edge + edge,
        forward: c.forward,
    };
    shape.faces.extend(part.faces.iter().map(|f| {
        Face {
            surface: f.surface.placed(by),
            agrees: f.agrees,
            loops: f
                .loops
                .iter()
                .map(|l| l.iter().map(moved).collect())
                .collect(),
            name: f.name.clone(),
        }
    }));
    shape.shells.extend(part.shells.iter().map(|s| Shell {
        faces: s.faces.iter().map(|f| f + face).collect(),
        solid: s.solid.map(|s| s + solid),
        is_void: s.is_void,
    }));
    let names = part.solids.iter().map(|own| match own.as_str() {
        "" | "NONE" => name.to_owned(),
        own => own.to_owned(),
    });
    shape.solids.extend(names);
}

/// Returns the size of a part in memory, in numbers and references.
pub(super) fn size(part: &Shape) -> usize {
    let coedges: usize = part.faces.iter().flat_map(|f| &f.loops).map(Vec::len).sum();
    let control: usize = part
        .faces
        .iter()
        .map(|f| match &f.surface {
            CadSurface::Nurbs(spline) => spline.control().count(),
            _ => 4,
        })
        .sum();
    let curves: usize = part
        .edges
        .iter()
        .map(|e| match &e.curve {
            isoform_geom::cad::CadCurve::Nurbs(spline) => spline.control().count(),
            _ => 4,
        })
        .sum();
    part.vertices.len() + coedges + control + curves
}
