//! VTK's .vtu, an unstructured grid in XML (VTK file formats, "XML file formats"), both ways.
//!
//! Cells are triangles, tetrahedra, lines of curves and vertices at corners, in this order; of
//! second order they are VTK's quadratic ones. Three integer cell arrays hold the tags of the
//! groups, from 1, and 0 where a cell is none of that kind: `part` of triangles, `region` of
//! tetrahedra, `curve` of lines. The names stand in a comment before the grid, one per line, since
//! VTK's arrays of strings are not read by others.

mod array;
mod read;

pub(super) use read::read;

use super::group::{edge, tet, triangle};
use super::options::MeshWriteOptions;
use super::out::Out;
use super::xml;
use crate::format::Sniff;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// First words of the lines with names in the comment, and of the arrays with tags.
const GROUPS: [&str; 3] = ["part", "region", "curve"];

pub(super) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    if text.contains("<VTKFile") && text.contains("UnstructuredGrid") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Points,
    Connectivity,
    Offsets,
    Types,
    /// Tags by kind of group.
    Tags(usize),
}

const ARRAYS: [Kind; 7] = [
    Kind::Points,
    Kind::Connectivity,
    Kind::Offsets,
    Kind::Types,
    Kind::Tags(0),
    Kind::Tags(1),
    Kind::Tags(2),
];

/// Values of an array on their way out.
struct Values<'o> {
    out: Out<'o>,
    ascii: bool,
    /// Indices of 64 bits.
    wide: bool,
}

impl Values<'_> {
    fn float(&mut self, v: f64) {
        match self.ascii {
            true => self.out.float(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    fn index(&mut self, v: u64) {
        match (self.ascii, self.wide) {
            (true, _) => self.out.int(v).str(" "),
            (_, true) => self.out.bytes(&v.to_le_bytes()),
            _ => self.out.bytes(&(v as u32).to_le_bytes()),
        };
    }
    fn tag(&mut self, v: u32) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    fn byte(&mut self, v: u8) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&[v]),
        };
    }
    fn end(&mut self) -> io::Result<()> {
        if self.ascii {
            self.out.line()
        } else {
            self.out.end()
        }
    }
}

/// Numbers of cells and of the nodes of each, by kind: triangles, tetrahedra, edges, corners.
fn shape(mesh: &Mesh) -> [(usize, usize, u8); 4] {
    let second = [
        !mesh.triangle_mids.is_empty(),
        !mesh.tet_mids.is_empty(),
        !mesh.edge_mids.is_empty(),
    ];
    let pick = |k: usize, linear: (usize, u8), curved: (usize, u8)| {
        if second[k] { curved } else { linear }
    };
    let cells = [
        (mesh.triangles.len(), pick(0, (3, 5), (6, 22))),
        (mesh.tets.len(), pick(1, (4, 10), (10, 24))),
        (mesh.edges.len(), pick(2, (2, 3), (3, 21))),
        (mesh.corners.len(), (1, 1)),
    ];
    cells.map(|(n, (nodes, kind))| (n, nodes, kind))
}

pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let shape = shape(mesh);
    let cells: usize = shape.iter().map(|s| s.0).sum();
    let indices: usize = shape.iter().map(|s| s.0 * s.1).sum();
    let wide = indices.max(mesh.points.len()) > i32::MAX as usize;
    let ascii = options.ascii == Some(true);
    let mut values = Values {
        out: Out::new(out),
        ascii,
        wide,
    };
    values.out.str(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n",
    );
    write_names(mesh, &mut values.out)?;
    values
        .out
        .str("<UnstructuredGrid>\n<Piece NumberOfPoints=\"")
        .int(mesh.points.len());
    values
        .out
        .str("\" NumberOfCells=\"")
        .int(cells)
        .str("\">")
        .line()?;
    let mut offset = 0;
    for kind in ARRAYS {
        let (open, close) = match kind {
            Kind::Points => ("<Points>\n", "</Points>\n"),
            Kind::Connectivity => ("<Cells>\n", ""),
            Kind::Types => ("", "</Cells>\n"),
            Kind::Tags(0) => ("<CellData Scalars=\"part\">\n", ""),
            Kind::Tags(2) => ("", "</CellData>\n"),
            _ => ("", ""),
        };
        let index = if wide { ("Int64", 8) } else { ("Int32", 4) };
        let ((name, components), (kind_name, size), n) = match kind {
            Kind::Points => (("Points", 3), ("Float64", 8), 3 * mesh.points.len()),
            Kind::Connectivity => (("connectivity", 1), index, indices),
            Kind::Offsets => (("offsets", 1), index, cells),
            Kind::Types => (("types", 1), ("UInt8", 1), cells),
            Kind::Tags(k) => ((GROUPS[k], 1), ("Int32", 4), cells),
        };
        values
            .out
            .str(open)
            .str("<DataArray type=\"")
            .str(kind_name)
            .str("\" Name=\"")
            .str(name);
        values.out.str("\" NumberOfComponents=\"").int(components);
        if ascii {
            values.out.str("\" format=\"ascii\">\n");
            write_array(mesh, &shape, kind, &mut values)?;
            values.out.str("</DataArray>\n");
        } else {
            values
                .out
                .str("\" format=\"appended\" offset=\"")
                .int(offset)
                .str("\"/>\n");
            offset += 8 + (size * n) as u64;
        }
        values.out.str(close);
    }
    values.out.str("</Piece>\n</UnstructuredGrid>\n");
    if !ascii {
        values.out.str("<AppendedData encoding=\"raw\">\n_");
        for kind in ARRAYS {
            let bytes = match kind {
                Kind::Points => 24 * mesh.points.len(),
                Kind::Connectivity => indices * if wide { 8 } else { 4 },
                Kind::Offsets => cells * if wide { 8 } else { 4 },
                Kind::Types => cells,
                Kind::Tags(_) => 4 * cells,
            };
            values.out.bytes(&(bytes as u64).to_le_bytes());
            write_array(mesh, &shape, kind, &mut values)?;
        }
        values.out.str("\n</AppendedData>\n");
    }
    values.out.str("</VTKFile>").line()?;
    values.out.flush()
}

/// The names of the groups as a comment: `part 1 name`. Two hyphens would end it, so that they are
/// escaped.
fn write_names(mesh: &Mesh, out: &mut Out<'_>) -> io::Result<()> {
    let curves: Vec<&String> = mesh.curves.iter().map(|c| &c.name).collect();
    let lists: [Vec<&String>; 3] = [
        mesh.parts.iter().collect(),
        mesh.regions.iter().collect(),
        curves,
    ];
    if lists.iter().all(Vec::is_empty) {
        return Ok(());
    }
    out.str("<!-- groups\n");
    for (kind, names) in GROUPS.iter().zip(&lists) {
        for (i, name) in names.iter().enumerate() {
            let plain: String = name
                .chars()
                .map(|c| if c.is_control() { ' ' } else { c })
                .collect();
            out.str(kind)
                .str(" ")
                .int(i + 1)
                .str(" ")
                .str(&xml::escape(&plain).replace('-', "&#45;"))
                .line()?;
        }
    }
    out.str("-->").line()
}

fn write_array(
    mesh: &Mesh,
    shape: &[(usize, usize, u8); 4],
    kind: Kind,
    values: &mut Values<'_>,
) -> io::Result<()> {
    match kind {
        Kind::Points => {
            for p in &mesh.points {
                p.iter().for_each(|&v| values.float(v));
                values.end()?;
            }
        }
        Kind::Connectivity => return write_connectivity(mesh, values),
        Kind::Offsets => {
            let mut offset = 0;
            for &(n, nodes, _) in shape {
                for _ in 0..n {
                    offset += nodes as u64;
                    values.index(offset);
                    values.end()?;
                }
            }
        }
        Kind::Types => {
            for &(n, _, kind) in shape {
                for _ in 0..n {
                    values.byte(kind);
                    values.end()?;
                }
            }
        }
        Kind::Tags(group) => {
            let labels = [&mesh.triangle_parts, &mesh.tet_regions, &mesh.edge_curves];
            for (k, &(n, ..)) in shape.iter().enumerate() {
                let labels = if k == group {
                    labels[k].as_slice()
                } else {
                    &[]
                };
                for i in 0..n {
                    values.tag(labels.get(i).map_or(0, |l| l + 1));
                    values.end()?;
                }
            }
        }
    }
    Ok(())
}

fn write_connectivity(mesh: &Mesh, values: &mut Values<'_>) -> io::Result<()> {
    let put = |values: &mut Values<'_>, nodes: &[u32]| {
        nodes.iter().for_each(|&n| values.index(u64::from(n)));
        values.end()
    };
    for i in 0..mesh.triangles.len() {
        let (nodes, n) = triangle(mesh, i);
        put(values, &nodes[..n])?;
    }
    for i in 0..mesh.tets.len() {
        let (nodes, n) = tet(mesh, i);
        put(values, &nodes[..n])?;
    }
    for i in 0..mesh.edges.len() {
        let (nodes, n) = edge(mesh, i);
        put(values, &nodes[..n])?;
    }
    mesh.corners.iter().try_for_each(|&c| put(values, &[c]))
}
