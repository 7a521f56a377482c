//! glTF 2.0 as one binary file (Khronos, "glTF 2.0 Specification"), for viewers, in single
//! precision.
//!
//! Coordinates are relative to the centre of the bounding box, and a scene node translates them
//! back; thus 32 bits suffice for shapes far from the origin. Each part is a primitive with a
//! material of its own colour and the part's name. A scene node rotates our upward z axis to glTF's
//! y axis and, if the unit is known, scales lengths to metres. A mesh with parameters gets a
//! chequered texture along them; other columns become attributes such as `_DISTANCE`.

use super::chequer;
use super::color::part_color;
use super::group::Groups;
use super::options::MeshWriteOptions;
use super::out::Out;
use super::surface::SurfaceNodes;
use isoform_geom::{Aabb, Column, Mesh, Point3};
use serde_json::{Value, json};
use std::io::{self, Write};

/// Component type: floats of 32 bits. These numbers stem from OpenGL.
const GL_FLOAT: u32 = 5126;
/// Component type: unsigned integers of 32 bits.
const GL_UNSIGNED_INT: u32 = 5125;
/// Target of a buffer view with values per vertex.
const GL_ARRAY_BUFFER: u32 = 34962;
/// Target of a buffer view with corners of triangles.
const GL_ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Texture filter that keeps pixels sharp.
const GL_NEAREST: u32 = 9728;
/// Texture wrapping that repeats the texture beyond parameters 0 and 1.
const GL_REPEAT: u32 = 10497;

/// Writes a mesh; without triangles it is a document without a scene.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let mut out = Out::new(out);
    if mesh.triangles.is_empty() {
        write_document(&json!({ "asset": asset() }), None, &mut out)?;
    } else {
        let model = GlbModel::from_mesh(mesh);
        let scale = options.metres().unwrap_or(1.0);
        write_document(&model.document(scale), Some(model.size()), &mut out)?;
        model.write_binary(&mut out)?;
    }
    out.flush()
}

/// Writes the file header with the JSON chunk, and the header of the binary chunk if it has a size.
fn write_document(document: &Value, binary: Option<usize>, out: &mut Out<'_>) -> io::Result<()> {
    let mut text = document.to_string();
    text.extend(std::iter::repeat_n(' ', padding(text.len())));
    let total = 12 + 8 + text.len() + binary.map_or(0, |size| 8 + size);
    let total = u32::try_from(total).map_err(|_| io::Error::other("glTF holds at most 4 GiB"))?;
    out.bytes(b"glTF").bytes(&2_u32.to_le_bytes());
    out.bytes(&total.to_le_bytes());
    out.bytes(&(text.len() as u32).to_le_bytes());
    out.bytes(b"JSON").str(&text).end()?;
    if let Some(size) = binary {
        out.bytes(&(size as u32).to_le_bytes()).bytes(b"BIN\0");
    }
    Ok(())
}

/// Returns the number of bytes up to the next multiple of four.
fn padding(length: usize) -> usize {
    length.wrapping_neg() % 4
}

/// Mesh with triangles, prepared for a viewer.
struct GlbModel<'m> {
    mesh: &'m Mesh,
    /// Nodes of the surface.
    nodes: SurfaceNodes,
    /// Triangles by part.
    parts: Groups,
    /// Centre of the bounding box, to which coordinates are relative.
    center: Point3,
    /// Texture as PNG; empty for a mesh without parameters.
    texture: Vec<u8>,
}

impl<'m> GlbModel<'m> {
    /// Prepares a mesh, with a texture if it has parameters.
    fn from_mesh(mesh: &'m Mesh) -> Self {
        let nodes = SurfaceNodes::from_mesh(mesh);
        Self {
            center: Aabb::from_points(nodes.points(mesh)).center(),
            nodes,
            parts: Groups::parts(mesh),
            texture: match mesh.parameters() {
                Some(_) => chequer::png(),
                None => Vec::new(),
            },
            mesh,
        }
    }

    /// Returns the nodes of the surface relative to the centre, in single precision.
    fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        self.nodes
            .points(self.mesh)
            .map(|p| std::array::from_fn(|k| (p[k] - self.center[k]) as f32))
    }

    /// Returns the smallest and largest coordinates.
    fn bounds(&self) -> [[f32; 3]; 2] {
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in self.points() {
            lo = std::array::from_fn(|k| lo[k].min(p[k]));
            hi = std::array::from_fn(|k| hi[k].max(p[k]));
        }
        [lo, hi]
    }

    /// Returns the size of the binary chunk in bytes.
    fn size(&self) -> usize {
        let numbers = self.nodes.len() * (3 + self.mesh.columns.len());
        let texture = self.texture.len() + padding(self.texture.len());
        4 * numbers + 12 * self.mesh.triangles.len() + texture
    }

    /// Writes coordinates, triangles by part, texture coordinates, other columns, and the texture.
    fn write_binary(&self, out: &mut Out<'_>) -> io::Result<()> {
        for p in self.points() {
            p.iter().for_each(|v| {
                out.bytes(&v.to_le_bytes());
            });
            out.end()?;
        }
        for &t in self.parts.filled().flat_map(|(_, triangles)| triangles) {
            for corner in self.nodes.triangle(self.mesh, t as usize) {
                out.bytes(&corner.to_le_bytes());
            }
            out.end()?;
        }
        if let Some((u, v)) = self.mesh.parameters() {
            let pairs = self.nodes.values(u).zip(self.nodes.values(v));
            write_floats(pairs.flat_map(|(u, v)| [u, v]), out)?;
        }
        for column in attributes(self.mesh) {
            write_floats(self.nodes.values(&column.values), out)?;
        }
        out.bytes(&self.texture);
        out.bytes(&[0; 3][..padding(self.texture.len())]);
        Ok(())
    }

    /// Returns the JSON document that describes the binary chunk.
    fn document(&self, scale: f64) -> Value {
        let mut buffer =
            BufferLayout::new(self.nodes.len(), self.mesh.triangles.len(), self.bounds());
        if !self.texture.is_empty() {
            buffer.numbers("TEXCOORD_0".to_owned(), "VEC2", 2);
        }
        for column in attributes(self.mesh) {
            buffer.numbers(attribute_name(&column.name), "SCALAR", 1);
        }
        let (mut primitives, mut materials) = (Vec::new(), Vec::new());
        for (i, triangles) in self.parts.filled() {
            primitives.push(buffer.primitive(materials.len(), 3 * triangles.len()));
            materials.push(self.material(i));
        }
        let mut document = json!({
            "asset": asset(),
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": self.scene_nodes(scale),
            "meshes": [{ "name": "shape", "primitives": primitives }],
            "materials": materials,
            "accessors": buffer.accessors,
            "buffers": [{ "byteLength": self.size() }],
        });
        if !self.texture.is_empty() {
            let view = buffer.image(self.texture.len());
            add_texture(&mut document, view);
        }
        document["bufferViews"] = json!(buffer.views);
        document
    }

    /// Returns the nodes of the scene: one rotates the z axis to glTF's y axis and scales to
    /// metres; its child translates the shape back from the origin.
    fn scene_nodes(&self, scale: f64) -> Value {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        json!([
            { "name": "isoform", "rotation": [-half, 0.0, 0.0, half], "scale": [scale, scale, scale], "children": [1] },
            { "name": "shape", "translation": self.center, "mesh": 0 },
        ])
    }

    /// Returns the material of a part, with its colour and name.
    fn material(&self, part: usize) -> Value {
        let [r, g, b] = part_color(part);
        let name = self.mesh.parts.get(part).map_or("surface", |n| n);
        let mut surface = json!({ "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6 });
        if !self.texture.is_empty() {
            surface["baseColorTexture"] = json!({ "index": 0 });
        }
        json!({ "name": name, "pbrMetallicRoughness": surface, "doubleSided": true })
    }
}

/// Adds the texture whose image is a view of the binary chunk.
fn add_texture(document: &mut Value, view: usize) {
    document["images"] = json!([{ "bufferView": view, "mimeType": "image/png" }]);
    document["samplers"] =
        json!([{ "magFilter": GL_NEAREST, "wrapS": GL_REPEAT, "wrapT": GL_REPEAT }]);
    document["textures"] = json!([{ "source": 0, "sampler": 0 }]);
}

/// Writes numbers in single precision.
fn write_floats(values: impl Iterator<Item = f64>, out: &mut Out<'_>) -> io::Result<()> {
    for v in values {
        out.bytes(&(v as f32).to_le_bytes());
        out.end()?;
    }
    Ok(())
}

/// Returns the columns other than texture coordinates.
fn attributes(mesh: &Mesh) -> impl Iterator<Item = &Column> {
    let textured = mesh.parameters().is_some();
    mesh.columns
        .iter()
        .filter(move |c| !(textured && ["u", "v"].contains(&c.name.as_str())))
}

/// Returns the version of glTF and the name of the writer.
fn asset() -> Value {
    json!({ "version": "2.0", "generator": "isoform" })
}

/// Returns the name of a column as an application-specific attribute: `_`, then capitals, digits
/// and `_`.
fn attribute_name(column: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    std::iter::once('_')
        .chain(column.chars().map(plain))
        .collect()
}

/// Layout of the binary chunk: views are byte ranges, accessors give their types.
struct BufferLayout {
    /// Byte ranges.
    views: Vec<Value>,
    /// Types and counts of the numbers in the views.
    accessors: Vec<Value>,
    /// Accessors of the values per node, by name.
    attributes: serde_json::Map<String, Value>,
    /// Number of nodes of the surface.
    nodes: usize,
    /// Offset of the next view.
    end: usize,
    /// Number of indices of the primitives so far.
    indices: usize,
}

impl BufferLayout {
    /// Starts with views for coordinates, with their bounds, and for triangles.
    fn new(nodes: usize, triangles: usize, bounds: [[f32; 3]; 2]) -> Self {
        let (vertices, indices) = (12 * nodes, 12 * triangles);
        let mut attributes = serde_json::Map::new();
        attributes.insert("POSITION".to_owned(), json!(0));
        Self {
            accessors: vec![
                json!({ "bufferView": 0, "componentType": GL_FLOAT, "count": nodes, "type": "VEC3", "min": bounds[0], "max": bounds[1] }),
            ],
            views: vec![
                json!({ "buffer": 0, "byteLength": vertices, "target": GL_ARRAY_BUFFER }),
                json!({ "buffer": 0, "byteOffset": vertices, "byteLength": indices, "target": GL_ELEMENT_ARRAY_BUFFER }),
            ],
            attributes,
            nodes,
            end: vertices + indices,
            indices: 0,
        }
    }
    /// Adds `width` numbers per node.
    fn numbers(&mut self, name: String, kind: &str, width: usize) {
        let length = 4 * width * self.nodes;
        self.views.push(json!({ "buffer": 0, "byteOffset": self.end, "byteLength": length, "target": GL_ARRAY_BUFFER }));
        self.attributes.insert(name, json!(self.accessors.len()));
        self.accessors.push(json!({ "bufferView": self.views.len() - 1, "componentType": GL_FLOAT, "count": self.nodes, "type": kind }));
        self.end += length;
    }
    /// Adds the triangles of a part, given their number of corners.
    fn primitive(&mut self, material: usize, count: usize) -> Value {
        let primitive = json!({ "attributes": self.attributes, "indices": self.accessors.len(), "material": material, "mode": 4 });
        self.accessors.push(json!({ "bufferView": 1, "byteOffset": 4 * self.indices, "componentType": GL_UNSIGNED_INT, "count": count, "type": "SCALAR" }));
        self.indices += count;
        primitive
    }
    /// Adds the bytes of an image and returns the index of their view.
    fn image(&mut self, length: usize) -> usize {
        self.views
            .push(json!({ "buffer": 0, "byteOffset": self.end, "byteLength": length }));
        self.views.len() - 1
    }
}
