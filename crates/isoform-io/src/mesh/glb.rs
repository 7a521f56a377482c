//! glTF 2.0 as one binary file (Khronos, "glTF 2.0 Specification"): for viewers, in 32 bits.
//!
//! Coordinates are relative to the centre of the box, which a node puts back; so that 32 bits
//! suffice for shapes far from the origin. Each part is a primitive with a material of its own
//! colour and the part's name. Our z is up, glTF's y: a node turns it. Lengths are metres there: a
//! node scales, if the unit is known. A mesh with parameters gets a chequered texture along them;
//! its other numbers per node are attributes such as `_DISTANCE`.

use super::chequer;
use super::color::part_color;
use super::group::Groups;
use super::options::MeshWriteOptions;
use super::out::Out;
use super::surface::SurfaceNodes;
use isoform_geom::{Aabb, Column, Mesh};
use serde_json::{Value, json};
use std::io::{self, Write};

const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;
const NEAREST: u32 = 9728;
const REPEAT: u32 = 10497;

pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let nodes = SurfaceNodes::of(mesh);
    let parts = Groups::parts(mesh);
    let center = Aabb::of(nodes.points(mesh)).center();
    let points = || {
        nodes
            .points(mesh)
            .map(|p| std::array::from_fn::<f32, 3, _>(|k| (p[k] - center[k]) as f32))
    };
    let is_empty = mesh.triangles.is_empty();
    let texture = if mesh.parameters().is_some() && !is_empty {
        chequer::png()
    } else {
        Vec::new()
    };
    let padding = texture.len().wrapping_neg() % 4;
    let bytes = if is_empty {
        0
    } else {
        4 * nodes.len() * (3 + mesh.columns.len())
            + 12 * mesh.triangles.len()
            + texture.len()
            + padding
    };
    let mut text = if is_empty {
        json!({ "asset": asset() }).to_string()
    } else {
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in points() {
            lo = std::array::from_fn(|k| lo[k].min(p[k]));
            hi = std::array::from_fn(|k| hi[k].max(p[k]));
        }
        scene(
            mesh,
            &nodes,
            &parts,
            &center,
            [lo, hi],
            texture.len(),
            bytes,
            options,
        )
        .to_string()
    };
    text.extend(std::iter::repeat_n(' ', text.len().wrapping_neg() % 4));
    let total = 12 + 8 + text.len() + if is_empty { 0 } else { 8 + bytes };
    let total = u32::try_from(total).map_err(|_| io::Error::other("glTF holds at most 4 GiB"))?;
    let mut out = Out::new(out);
    out.bytes(b"glTF")
        .bytes(&2_u32.to_le_bytes())
        .bytes(&total.to_le_bytes());
    out.bytes(&(text.len() as u32).to_le_bytes())
        .bytes(b"JSON")
        .str(&text)
        .end()?;
    if !is_empty {
        out.bytes(&(bytes as u32).to_le_bytes()).bytes(b"BIN\0");
        for p in points() {
            p.iter().for_each(|v| {
                out.bytes(&v.to_le_bytes());
            });
            out.end()?;
        }
        for &t in parts.filled().flat_map(|(_, triangles)| triangles) {
            for corner in nodes.triangle(mesh, t as usize) {
                out.bytes(&corner.to_le_bytes());
            }
            out.end()?;
        }
        let mut values = |list: &mut dyn Iterator<Item = f64>| {
            for v in list {
                out.bytes(&(v as f32).to_le_bytes());
                out.end()?;
            }
            io::Result::Ok(())
        };
        if let Some((u, v)) = mesh.parameters() {
            values(
                &mut nodes
                    .values(u)
                    .zip(nodes.values(v))
                    .flat_map(|(u, v)| [u, v]),
            )?;
        }
        for column in attributes(mesh) {
            values(&mut nodes.values(&column.values))?;
        }
        out.bytes(&texture).bytes(&[0; 3][..padding]);
    }
    out.flush()
}

/// The columns that are no texture coordinates.
fn attributes(mesh: &Mesh) -> impl Iterator<Item = &Column> {
    let textured = mesh.parameters().is_some();
    mesh.columns
        .iter()
        .filter(move |c| !(textured && ["u", "v"].contains(&c.name.as_str())))
}

fn asset() -> Value {
    json!({ "version": "2.0", "generator": "isoform" })
}

/// Metres in a unit; 1 if it is not known.
fn metres(unit: Option<&str>) -> f64 {
    match unit {
        Some("um") => 1e-6,
        Some("mm") => 1e-3,
        Some("cm") => 1e-2,
        Some("in") => 0.0254,
        Some("ft") => 0.3048,
        _ => 1.0,
    }
}

#[allow(
    clippy::too_many_arguments,
    reason = "all of it is in the one document"
)]
fn scene(
    mesh: &Mesh,
    nodes: &SurfaceNodes,
    parts: &Groups,
    center: &[f64; 3],
    bounds: [[f32; 3]; 2],
    texture: usize,
    bytes: usize,
    options: &MeshWriteOptions,
) -> Value {
    let (vertices, indices) = (12 * nodes.len(), 12 * mesh.triangles.len());
    let mut accessors = vec![
        json!({ "bufferView": 0, "componentType": FLOAT, "count": nodes.len(), "type": "VEC3", "min": bounds[0], "max": bounds[1] }),
    ];
    let mut views = vec![
        json!({ "buffer": 0, "byteLength": vertices, "target": VERTICES }),
        json!({ "buffer": 0, "byteOffset": vertices, "byteLength": indices, "target": INDICES }),
    ];
    let mut named = serde_json::Map::new();
    named.insert("POSITION".to_owned(), json!(0));
    let mut end = vertices + indices;
    let mut numbers = |name: String, kind: &str, width: usize| {
        views.push(json!({ "buffer": 0, "byteOffset": end, "byteLength": 4 * width * nodes.len(), "target": VERTICES }));
        named.insert(name, json!(accessors.len()));
        accessors.push(json!({ "bufferView": views.len() - 1, "componentType": FLOAT, "count": nodes.len(), "type": kind }));
        end += 4 * width * nodes.len();
    };
    if texture > 0 {
        numbers("TEXCOORD_0".to_owned(), "VEC2", 2);
    }
    for column in attributes(mesh) {
        let plain: String = column
            .name
            .chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() {
                    c.to_ascii_uppercase()
                } else {
                    '_'
                }
            })
            .collect();
        numbers(format!("_{plain}"), "SCALAR", 1);
    }
    let (mut primitives, mut materials) = (Vec::new(), Vec::new());
    let mut before = 0;
    for (i, triangles) in parts.filled() {
        let count = 3 * triangles.len();
        primitives.push(json!({ "attributes": named, "indices": accessors.len(), "material": materials.len(), "mode": 4 }));
        accessors.push(json!({ "bufferView": 1, "byteOffset": 4 * before, "componentType": UNSIGNED, "count": count, "type": "SCALAR" }));
        let [r, g, b] = part_color(i);
        let name = mesh.parts.get(i).map_or("surface", |n| n);
        let mut surface = json!({ "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6 });
        if texture > 0 {
            surface["baseColorTexture"] = json!({ "index": 0 });
        }
        materials
            .push(json!({ "name": name, "pbrMetallicRoughness": surface, "doubleSided": true }));
        before += count;
    }
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let scale = metres(options.units.as_deref());
    let mut scene = json!({
        "asset": asset(),
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [
            { "name": "isoform", "rotation": [-half, 0.0, 0.0, half], "scale": [scale, scale, scale], "children": [1] },
            { "name": "shape", "translation": center, "mesh": 0 },
        ],
        "meshes": [{ "name": "shape", "primitives": primitives }],
        "materials": materials,
        "accessors": accessors,
        "buffers": [{ "byteLength": bytes }],
    });
    if texture > 0 {
        scene["images"] = json!([{ "bufferView": views.len(), "mimeType": "image/png" }]);
        scene["samplers"] = json!([{ "magFilter": NEAREST, "wrapS": REPEAT, "wrapT": REPEAT }]);
        scene["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        views.push(json!({ "buffer": 0, "byteOffset": end, "byteLength": texture }));
    }
    scene["bufferViews"] = json!(views);
    scene
}
