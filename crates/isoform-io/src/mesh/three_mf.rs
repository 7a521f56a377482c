//! Writer of 3MF (3MF Consortium, "3D Manufacturing Format core specification" 1.3): one object,
//! with a material of its own colour and name per part.
//!
//! The file is a ZIP package of three members: content types, the relationship that points to the
//! model, and the model as XML.

use super::color::part_color;
use super::options::MeshWriteOptions;
use super::out::{Out, on_one_line};
use super::surface::SurfaceNodes;
use super::zip::Zip;
use crate::three_mf::UNIT_NAMES;
use crate::xml::escape;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Package member that maps endings to content types.
const CONTENT_TYPES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
    <Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\
    <Default Extension=\"rels\" ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\
    <Default Extension=\"model\" ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>\n";
/// Package member that states the location of the model.
const RELATIONSHIPS: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
    <Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">\
    <Relationship Target=\"/3D/3dmodel.model\" Id=\"model\" Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>\
    </Relationships>\n";

/// Returns the name of a unit in 3MF; millimetre, its default, if the unit is unknown.
pub(crate) fn unit(unit: Option<&str>) -> &'static str {
    let known = UNIT_NAMES.iter().find(|(ours, _)| Some(*ours) == unit);
    known.map_or("millimeter", |(_, theirs)| theirs)
}

/// Writes the package.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    write_package(out, |out| write_model(mesh, out, options))
}

/// Writes a package with a model that is written by a function.
pub(crate) fn write_package(
    out: &mut dyn Write,
    model: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut zip = Zip::new(out);
    zip.member("[Content_Types].xml", |out| {
        out.write_all(CONTENT_TYPES.as_bytes())
    })?;
    zip.member("_rels/.rels", |out| out.write_all(RELATIONSHIPS.as_bytes()))?;
    zip.member("3D/3dmodel.model", model)?;
    zip.finish()
}

/// Writes the model: unit, materials of the parts, the object, and the build item.
fn write_model(mesh: &Mesh, out: &mut dyn Write, options: &MeshWriteOptions) -> io::Result<()> {
    let mut out = Out::new(out);
    out.str("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"")
        .str(unit(options.units.as_deref()));
    out.str("\" xml:lang=\"en-US\" xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\">\n<resources>\n");
    if mesh.triangle_parts.is_empty() {
        out.str("<object id=\"1\" type=\"model\">\n");
    } else {
        write_materials(mesh, &mut out)?;
        out.str("<object id=\"1\" type=\"model\" pid=\"2\" pindex=\"0\">\n");
    }
    write_object(mesh, &mut out)?;
    out.str("</object>\n</resources>\n<build>\n<item objectid=\"1\"/>\n</build>\n</model>\n");
    out.flush()
}

/// Writes a material per part.
fn write_materials(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    out.str("<basematerials id=\"2\">\n");
    for (i, name) in mesh.parts.iter().enumerate() {
        let [r, g, b] = part_color(i).map(|v| (255.0 * v).round() as u8);
        out.str("<base name=\"")
            .str(&escape(&on_one_line(name)))
            .str(&format!("\" displaycolor=\"#{r:02X}{g:02X}{b:02X}\"/>"))
            .line()?;
    }
    out.str("</basematerials>\n");
    Ok(())
}

/// Writes vertices and triangles, each with the material of its part.
fn write_object(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    out.str("<mesh>\n<vertices>\n");
    let nodes = SurfaceNodes::from_mesh(mesh);
    for p in nodes.points(mesh) {
        out.str("<vertex x=\"").float(p[0]);
        out.str("\" y=\"").float(p[1]);
        out.str("\" z=\"").float(p[2]).str("\"/>").line()?;
    }
    out.str("</vertices>\n<triangles>\n");
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = nodes.triangle(mesh, i);
        out.str("<triangle v1=\"").int(a);
        out.str("\" v2=\"").int(b).str("\" v3=\"").int(c);
        if let Some(part) = mesh.triangle_parts.get(i) {
            out.str("\" pid=\"2\" p1=\"").int(*part);
        }
        out.str("\"/>").line()?;
    }
    out.str("</triangles>\n</mesh>\n");
    Ok(())
}
