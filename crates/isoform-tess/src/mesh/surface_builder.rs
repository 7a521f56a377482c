//! A surface under construction, whose vertices are identified by names.

use super::glued::Glued;
use super::gluing::Gluing;
use super::names::{ClassId, Name};
use crate::surface::{Point3, Surface, VertexKind};
use std::collections::BTreeMap;

/// Triangle that is to be added to the surface.
pub(super) struct NewTriangle {
    pub(super) vertices: [u32; 3],
    /// Parameters of the vertices.
    pub(super) corners: [[f64; 2]; 3],
    /// Sides of the domain on which the vertices lie, as bits.
    pub(super) borders: [u64; 3],
}

/// Full name of a vertex: a vertex without a name of its own has its quadrant and index there.
pub(super) type FullName = (Name, usize, usize);

/// The surface under construction. Its vertices are places of the parameters, by name: those of
/// different sheets stay distinct until `SurfaceBuilder::wound`.
pub(super) struct SurfaceBuilder<'a> {
    pub(super) surface: Surface,
    pub(super) glued: &'a Glued<'a>,
    places: BTreeMap<FullName, u32>,
    /// First place of each vertex that sheets share.
    vertices: BTreeMap<FullName, u32>,
    /// First place with an equal vertex, by place.
    pub(super) first: Vec<u32>,
    /// True for each place on the seam of a base point.
    pub(super) on_seam: Vec<bool>,
}

impl<'a> SurfaceBuilder<'a> {
    pub(super) fn new(glued: &'a Glued<'a>) -> Self {
        Self {
            surface: Surface {
                findings: glued.openings.findings.clone(),
                tolerance: glued.atlas.options.tolerance,
                ..Surface::default()
            },
            glued,
            places: BTreeMap::new(),
            vertices: BTreeMap::new(),
            first: Vec::new(),
            on_seam: Vec::new(),
        }
    }
    pub(super) fn gluing(&self) -> &'a Gluing {
        &self.glued.gluing
    }
    /// Returns the place with a name, and creates it if needed with its vertex in space.
    pub(super) fn vertex(
        &mut self,
        place: FullName,
        vertex: FullName,
        make: impl FnOnce() -> (Point3, u8, VertexKind),
    ) -> u32 {
        if let Some(&known) = self.places.get(&place) {
            return known;
        }
        let (surface, gluing) = (&mut self.surface, &self.glued.gluing);
        let new = surface.points.len() as u32;
        let first = *self.vertices.entry(vertex).or_insert(new);
        let (point, faces, kind) = match first as usize {
            f if first < new => (surface.points[f], surface.faces[f], surface.kinds[f]),
            _ => make(),
        };
        surface.points.push(point);
        surface.faces.push(faces);
        let is_double = matches!(vertex.0, Name::Double(k) if gluing.is_double(k));
        surface.double.push(is_double);
        surface.kinds.push(kind);
        self.first.push(first);
        self.on_seam.push(matches!(place.0, Name::Seam(..)));
        self.places.insert(place, new);
        new
    }
    /// Returns the place with a name, with the vertex of another name, shared by all unit
    /// triangles.
    pub(super) fn shared(
        &mut self,
        [place, vertex]: [Name; 2],
        point: Point3,
        faces: u8,
        kind: VertexKind,
    ) -> u32 {
        self.vertex((place, 0, 0), (vertex, 0, 0), || (point, faces, kind))
    }
    /// Returns the place with a name, with the vertex of a class of parameters with one image.
    pub(super) fn class_vertex(&mut self, place: Name, class: ClassId) -> u32 {
        let gluing = self.gluing();
        let kind = match gluing.is_double(class) {
            true => VertexKind::Double,
            false => VertexKind::Ordinary,
        };
        let image = gluing.image(class);
        self.shared([place, Name::Double(class)], image, 0, kind)
    }
    /// Returns true if two places have one vertex.
    pub(super) fn are_one(&self, a: u32, b: u32) -> bool {
        self.first[a as usize] == self.first[b as usize]
    }
}
