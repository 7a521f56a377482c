//! VTK's .vtu, an unstructured grid in XML (VTK file formats, "XML file formats"), both ways.
//!
//! Cells are triangles, quadrilaterals, tetrahedra, wedges, lines of curves and vertices at
//! corners, in this order; of second order they are VTK's quadratic ones. Three integer cell arrays
//! hold the tags of the groups, from 1, and 0 where a cell is none of that kind: `part` of
//! triangles and quadrilaterals, `region` of tetrahedra and wedges, `curve` of lines. The names
//! stand in a comment before the grid, one per line, since VTK's arrays of strings are not read by
//! others.

mod array;
mod read;

pub(super) use read::read;

use super::group::{edge, face, face_count, face_part, volume, volume_count, volume_region};
use super::options::MeshWriteOptions;
use super::out::{Out, on_one_line};
use super::xml;
use crate::format::Sniff;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// First words of the lines with names in the comment, and of the arrays with tags.
pub(super) const GROUPS: [&str; 3] = ["part", "region", "curve"];
/// The nodes of our wedge in the order of VTK_WEDGE, and the other way round. VTK wants the normal
/// of the first triangle to look out of the wedge, away from the second (vtkWedge.h); ours looks
/// into it, as those of Gmsh and Abaqus do. meshio, whose order is Gmsh's too, makes the same
/// change when it reads, and faces that VTK takes from such wedges look outward. Its measures of
/// quality alone (9.7) expect the other order. The higher-order wedges of VTK would not need it.
const WEDGE: [usize; 6] = [0, 2, 1, 3, 5, 4];

pub(super) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    if text.contains("<VTKFile") && text.contains("UnstructuredGrid") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// An array of the file.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Coordinates of the nodes.
    Points,
    /// The nodes of all cells, one cell behind the other.
    Connectivity,
    /// Where each cell ends in the connectivity.
    Offsets,
    /// VTK's number of the kind of each cell.
    Types,
    /// Tags by kind of group.
    Tags(usize),
}

/// The arrays in the order of the file.
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
    /// A double.
    fn float(&mut self, v: f64) {
        match self.ascii {
            true => self.out.float(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    /// A number of a node, or an offset, of 32 or 64 bits.
    fn index(&mut self, v: u64) {
        match (self.ascii, self.wide) {
            (true, _) => self.out.int(v).str(" "),
            (_, true) => self.out.bytes(&v.to_le_bytes()),
            _ => self.out.bytes(&(v as u32).to_le_bytes()),
        };
    }
    /// The tag of a group, of 32 bits.
    fn tag(&mut self, v: u32) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    /// A type of cell.
    fn byte(&mut self, v: u8) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&[v]),
        };
    }
    /// The end of a line of text.
    fn end(&mut self) -> io::Result<()> {
        if self.ascii {
            self.out.line()
        } else {
            self.out.end()
        }
    }
}

/// The cells of one kind.
#[derive(Clone, Copy)]
struct Cells {
    /// Number of cells.
    count: usize,
    /// Nodes of each.
    nodes: usize,
    /// VTK's number of the kind.
    kind: u8,
    /// The kind of their groups, index into [`GROUPS`]; vertices count as lines beyond the last,
    /// which have no groups.
    group: usize,
}

/// A mesh as VTK's unstructured grid.
struct Grid<'m> {
    mesh: &'m Mesh,
    /// Triangles, quadrilaterals, tetrahedra, wedges, edges, corners.
    cells: [Cells; 6],
    /// Indices of 64 bits.
    wide: bool,
}

impl<'m> Grid<'m> {
    /// The cells of a mesh, with indices of 64 bits where 32 do not suffice.
    fn of(mesh: &'m Mesh) -> Self {
        let cells = |group, count, (nodes, kind): (usize, u8)| Cells {
            count,
            nodes,
            kind,
            group,
        };
        let triangle = if mesh.triangle_mids.is_empty() {
            (3, 5)
        } else {
            (6, 22)
        };
        let tet = if mesh.tet_mids.is_empty() {
            (4, 10)
        } else {
            (10, 24)
        };
        let edge = if mesh.edge_mids.is_empty() {
            (2, 3)
        } else {
            (3, 21)
        };
        let mut grid = Self {
            mesh,
            cells: [
                cells(0, mesh.triangles.len(), triangle),
                cells(0, mesh.quads.len(), (4, 9)),
                cells(1, mesh.tets.len(), tet),
                cells(1, mesh.wedges.len(), (6, 13)),
                cells(2, mesh.edges.len(), edge),
                cells(2, mesh.corners.len(), (1, 1)),
            ],
            wide: false,
        };
        grid.wide = grid.indices().max(mesh.points.len()) > i32::MAX as usize;
        grid
    }
    /// The number of cells.
    fn count(&self) -> usize {
        self.cells.iter().map(|c| c.count).sum()
    }
    /// Length of the connectivity.
    fn indices(&self) -> usize {
        self.cells.iter().map(|c| c.count * c.nodes).sum()
    }
}

/// An array as its element declares it.
struct Declared {
    /// Name of the array.
    name: &'static str,
    /// Numbers per tuple.
    components: usize,
    /// VTK's name of the type of number.
    kind: &'static str,
    /// Bytes of all values.
    bytes: u64,
}

impl Kind {
    /// The array's name, type and size.
    fn declared(self, grid: &Grid<'_>) -> Declared {
        let cells = grid.count();
        let (index, width) = if grid.wide {
            ("Int64", 8)
        } else {
            ("Int32", 4)
        };
        let (name, components, kind, bytes) = match self {
            Self::Points => ("Points", 3, "Float64", 24 * grid.mesh.points.len()),
            Self::Connectivity => ("connectivity", 1, index, width * grid.indices()),
            Self::Offsets => ("offsets", 1, index, width * cells),
            Self::Types => ("types", 1, "UInt8", cells),
            Self::Tags(group) => (GROUPS[group], 1, "Int32", 4 * cells),
        };
        Declared {
            name,
            components,
            kind,
            bytes: bytes as u64,
        }
    }
    /// The element that begins before the array and the one that ends behind it.
    fn around(self) -> (&'static str, &'static str) {
        match self {
            Self::Points => ("<Points>\n", "</Points>\n"),
            Self::Connectivity => ("<Cells>\n", ""),
            Self::Types => ("", "</Cells>\n"),
            Self::Tags(0) => ("<CellData Scalars=\"part\">\n", ""),
            Self::Tags(2) => ("", "</CellData>\n"),
            _ => ("", ""),
        }
    }
}

/// Writes the grid, with raw bytes appended unless text is asked for.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let grid = Grid::of(mesh);
    let mut values = Values {
        out: Out::new(out),
        ascii: options.ascii == Some(true),
        wide: grid.wide,
    };
    values.out.str(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n",
    );
    write_names(mesh, &mut values.out)?;
    let out = &mut values.out;
    out.str("<UnstructuredGrid>\n<Piece NumberOfPoints=\"")
        .int(mesh.points.len());
    out.str("\" NumberOfCells=\"").int(grid.count());
    out.str("\">").line()?;
    write_elements(&grid, &mut values)?;
    values.out.str("</Piece>\n</UnstructuredGrid>\n");
    if !values.ascii {
        write_appended(&grid, &mut values)?;
    }
    values.out.str("</VTKFile>").line()?;
    values.out.flush()
}

/// An element for each array, with its values if they are text.
fn write_elements(grid: &Grid<'_>, values: &mut Values<'_>) -> io::Result<()> {
    let mut offset = 0;
    for kind in ARRAYS {
        let (before, behind) = kind.around();
        let declared = kind.declared(grid);
        let out = &mut values.out;
        out.str(before).str("<DataArray type=\"").str(declared.kind);
        out.str("\" Name=\"").str(declared.name);
        out.str("\" NumberOfComponents=\"").int(declared.components);
        if values.ascii {
            out.str("\" format=\"ascii\">\n");
            write_array(grid, kind, values)?;
            values.out.str("</DataArray>\n");
        } else {
            out.str("\" format=\"appended\" offset=\"").int(offset);
            out.str("\"/>\n");
            offset += 8 + declared.bytes;
        }
        values.out.str(behind);
    }
    Ok(())
}

/// All values as bytes, each array behind its size.
fn write_appended(grid: &Grid<'_>, values: &mut Values<'_>) -> io::Result<()> {
    values.out.str("<AppendedData encoding=\"raw\">\n_");
    for kind in ARRAYS {
        values.out.bytes(&kind.declared(grid).bytes.to_le_bytes());
        write_array(grid, kind, values)?;
    }
    values.out.str("\n</AppendedData>\n");
    Ok(())
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
            out.str(kind)
                .str(" ")
                .int(i + 1)
                .str(" ")
                .str(&xml::escape(&on_one_line(name)).replace('-', "&#45;"))
                .line()?;
        }
    }
    out.str("-->").line()
}

/// The values of an array.
fn write_array(grid: &Grid<'_>, kind: Kind, values: &mut Values<'_>) -> io::Result<()> {
    match kind {
        Kind::Points => grid.mesh.points.iter().try_for_each(|p| {
            p.iter().for_each(|&v| values.float(v));
            values.end()
        }),
        Kind::Connectivity => write_connectivity(grid.mesh, values),
        Kind::Offsets => write_offsets(grid, values),
        Kind::Types => write_types(grid, values),
        Kind::Tags(group) => write_tags(grid, group, values),
    }
}

/// Where the nodes of each cell end in the connectivity.
fn write_offsets(grid: &Grid<'_>, values: &mut Values<'_>) -> io::Result<()> {
    let mut offset = 0;
    for cells in grid.cells {
        for _ in 0..cells.count {
            offset += cells.nodes as u64;
            values.index(offset);
            values.end()?;
        }
    }
    Ok(())
}

/// The type of each cell.
fn write_types(grid: &Grid<'_>, values: &mut Values<'_>) -> io::Result<()> {
    for cells in grid.cells {
        for _ in 0..cells.count {
            values.byte(cells.kind);
            values.end()?;
        }
    }
    Ok(())
}

/// Tags of one kind of groups; 0 for the cells of other kinds.
fn write_tags(grid: &Grid<'_>, group: usize, values: &mut Values<'_>) -> io::Result<()> {
    let mesh = grid.mesh;
    for kind in 0..GROUPS.len() {
        let cells = grid.cells.iter().filter(|cells| cells.group == kind);
        for i in 0..cells.map(|cells| cells.count).sum() {
            let label = match kind {
                _ if kind != group => None,
                0 => face_part(mesh, i),
                1 => volume_region(mesh, i),
                _ => mesh.edge_curves.get(i).copied(),
            };
            values.tag(label.map_or(0, |l| l + 1));
            values.end()?;
        }
    }
    Ok(())
}

/// The nodes of each cell: faces, volumes, lines, vertices.
fn write_connectivity(mesh: &Mesh, values: &mut Values<'_>) -> io::Result<()> {
    let put = |values: &mut Values<'_>, nodes: &[u32]| {
        nodes.iter().for_each(|&n| values.index(u64::from(n)));
        values.end()
    };
    for i in 0..face_count(mesh) {
        let (nodes, n) = face(mesh, i);
        put(values, &nodes[..n])?;
    }
    for i in 0..volume_count(mesh) {
        let (nodes, n) = volume(mesh, i);
        match n {
            6 => put(values, &WEDGE.map(|k| nodes[k]))?,
            _ => put(values, &nodes[..n])?,
        }
    }
    for i in 0..mesh.edges.len() {
        let (nodes, n) = edge(mesh, i);
        put(values, &nodes[..n])?;
    }
    mesh.corners.iter().try_for_each(|&c| put(values, &[c]))
}
