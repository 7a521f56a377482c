//! VTK's .vtu, an unstructured grid in XML (VTK file formats, "XML file formats"); reading and
//! writing.
//!
//! Cells are triangles, quadrilaterals, tetrahedra, wedges, lines on curves and vertices at
//! corners, in this order, with VTK's quadratic types for second order. Three integer cell arrays
//! contain the tags of the groups, from 1, or 0 for cells of other kinds: `part` of triangles and
//! quadrilaterals, `region` of tetrahedra and wedges, `curve` of lines. The names form a comment
//! before the grid, one per line, since other programs do not read VTK's arrays of strings.

mod array;
mod read;

pub(super) use read::read;

use super::group::{edge, face, face_count, face_part, volume, volume_count, volume_region};
use super::options::MeshWriteOptions;
use super::out::{Out, on_one_line};
use crate::format::Sniff;
use crate::xml;
use isoform_geom::Mesh;
use std::io::{self, Write};

/// Names of the tag arrays, and first words of the comment lines with names.
pub(super) const GROUP_NAMES: [&str; 3] = ["part", "region", "curve"];
/// Permutation, its own inverse, between our order of the nodes of a wedge and that of VTK_WEDGE.
/// In VTK the normal of the first triangle points out of the wedge, away from the second
/// (vtkWedge.h); ours points into it, as do those of Gmsh and Abaqus. meshio, which uses Gmsh's
/// order, applies this permutation on reading, and the faces that VTK extracts from such wedges
/// point outward. Only VTK's quality measures (9.7) expect the other order. VTK's higher-order
/// wedges would not need the permutation.
const WEDGE_PERMUTATION: [usize; 6] = [0, 2, 1, 3, 5, 4];

pub(super) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    if text.contains("<VTKFile") && text.contains("UnstructuredGrid") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Array of the file.
#[derive(Clone, Copy, PartialEq)]
enum ArrayKind {
    /// Coordinates of the nodes.
    Points,
    /// Nodes of all cells, concatenated.
    Connectivity,
    /// End of each cell in the connectivity.
    Offsets,
    /// VTK's number of the type of each cell.
    Types,
    /// Tags of a kind of groups, an index into [`GROUP_NAMES`].
    Tags(usize),
}

/// Arrays in the order of the file.
const ARRAY_ORDER: [ArrayKind; 7] = [
    ArrayKind::Points,
    ArrayKind::Connectivity,
    ArrayKind::Offsets,
    ArrayKind::Types,
    ArrayKind::Tags(0),
    ArrayKind::Tags(1),
    ArrayKind::Tags(2),
];

/// Writer of the values of an array.
struct ValueWriter<'o> {
    out: Out<'o>,
    ascii: bool,
    /// True if indices have 64 bits.
    wide: bool,
}

impl ValueWriter<'_> {
    /// Appends a double.
    fn float(&mut self, v: f64) {
        match self.ascii {
            true => self.out.float(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    /// Appends a node index or an offset, of 32 or 64 bits.
    fn index(&mut self, v: u64) {
        match (self.ascii, self.wide) {
            (true, _) => self.out.int(v).str(" "),
            (_, true) => self.out.bytes(&v.to_le_bytes()),
            _ => self.out.bytes(&(v as u32).to_le_bytes()),
        };
    }
    /// Appends the tag of a group, of 32 bits.
    fn tag(&mut self, v: u32) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&v.to_le_bytes()),
        };
    }
    /// Appends a cell type.
    fn byte(&mut self, v: u8) {
        match self.ascii {
            true => self.out.int(v).str(" "),
            false => self.out.bytes(&[v]),
        };
    }
    /// Ends a line of text.
    fn end(&mut self) -> io::Result<()> {
        if self.ascii {
            self.out.line()
        } else {
            self.out.end()
        }
    }
}

/// Cells of one type.
#[derive(Clone, Copy)]
struct CellBlock {
    /// Number of cells.
    count: usize,
    /// Number of nodes per cell.
    nodes: usize,
    /// VTK's number of the type.
    kind: u8,
    /// Kind of the cells' groups, an index into [`GROUP_NAMES`]. Vertices count as lines beyond the
    /// last, which have no group.
    group: usize,
}

/// Mesh as VTK's unstructured grid.
struct UnstructuredGrid<'m> {
    mesh: &'m Mesh,
    /// Triangles, quadrilaterals, tetrahedra, wedges, edges, corners.
    cells: [CellBlock; 6],
    /// True if indices have 64 bits.
    wide: bool,
}

impl<'m> UnstructuredGrid<'m> {
    /// Determines the cells of a mesh, with indices of 64 bits if 32 do not suffice.
    fn from_mesh(mesh: &'m Mesh) -> Self {
        let cells = |group, count, (nodes, kind): (usize, u8)| CellBlock {
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
    /// Returns the number of cells.
    fn count(&self) -> usize {
        self.cells.iter().map(|c| c.count).sum()
    }
    /// Returns the length of the connectivity.
    fn indices(&self) -> usize {
        self.cells.iter().map(|c| c.count * c.nodes).sum()
    }
}

/// Declaration of an array in its XML element.
struct ArrayDeclaration {
    /// Name of the array.
    name: &'static str,
    /// Number of components per tuple.
    components: usize,
    /// VTK's name of the number type.
    kind: &'static str,
    /// Size of all values in bytes.
    bytes: u64,
}

impl ArrayKind {
    /// Returns the array's name, type and size.
    fn declared(self, grid: &UnstructuredGrid<'_>) -> ArrayDeclaration {
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
            Self::Tags(group) => (GROUP_NAMES[group], 1, "Int32", 4 * cells),
        };
        ArrayDeclaration {
            name,
            components,
            kind,
            bytes: bytes as u64,
        }
    }
    /// Returns the tags written before and after the array.
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

/// Writes the grid, with appended raw bytes unless text is requested.
pub(super) fn write(
    mesh: &Mesh,
    out: &mut dyn Write,
    options: &MeshWriteOptions,
) -> io::Result<()> {
    let grid = UnstructuredGrid::from_mesh(mesh);
    let mut values = ValueWriter {
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

/// Writes an element for each array, with its values if they are text.
fn write_elements(grid: &UnstructuredGrid<'_>, values: &mut ValueWriter<'_>) -> io::Result<()> {
    let mut offset = 0;
    for kind in ARRAY_ORDER {
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

/// Writes all values as bytes, each array preceded by its size.
fn write_appended(grid: &UnstructuredGrid<'_>, values: &mut ValueWriter<'_>) -> io::Result<()> {
    values.out.str("<AppendedData encoding=\"raw\">\n_");
    for kind in ARRAY_ORDER {
        values.out.bytes(&kind.declared(grid).bytes.to_le_bytes());
        write_array(grid, kind, values)?;
    }
    values.out.str("\n</AppendedData>\n");
    Ok(())
}

/// Writes the names of the groups as a comment: `part 1 name`. Double hyphens, which would end it,
/// are escaped.
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
    for (kind, names) in GROUP_NAMES.iter().zip(&lists) {
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

/// Writes the values of an array.
fn write_array(
    grid: &UnstructuredGrid<'_>,
    kind: ArrayKind,
    values: &mut ValueWriter<'_>,
) -> io::Result<()> {
    match kind {
        ArrayKind::Points => grid.mesh.points.iter().try_for_each(|p| {
            p.iter().for_each(|&v| values.float(v));
            values.end()
        }),
        ArrayKind::Connectivity => write_connectivity(grid.mesh, values),
        ArrayKind::Offsets => write_offsets(grid, values),
        ArrayKind::Types => write_types(grid, values),
        ArrayKind::Tags(group) => write_tags(grid, group, values),
    }
}

/// Writes the end of each cell in the connectivity.
fn write_offsets(grid: &UnstructuredGrid<'_>, values: &mut ValueWriter<'_>) -> io::Result<()> {
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

/// Writes the type of each cell.
fn write_types(grid: &UnstructuredGrid<'_>, values: &mut ValueWriter<'_>) -> io::Result<()> {
    for cells in grid.cells {
        for _ in 0..cells.count {
            values.byte(cells.kind);
            values.end()?;
        }
    }
    Ok(())
}

/// Writes the tags of one kind of groups; 0 for the cells of other kinds.
fn write_tags(
    grid: &UnstructuredGrid<'_>,
    group: usize,
    values: &mut ValueWriter<'_>,
) -> io::Result<()> {
    let mesh = grid.mesh;
    for kind in 0..GROUP_NAMES.len() {
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

/// Writes the nodes of each cell: faces, volumes, lines, vertices.
fn write_connectivity(mesh: &Mesh, values: &mut ValueWriter<'_>) -> io::Result<()> {
    let put = |values: &mut ValueWriter<'_>, nodes: &[u32]| {
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
            6 => put(values, &WEDGE_PERMUTATION.map(|k| nodes[k]))?,
            _ => put(values, &nodes[..n])?,
        }
    }
    for i in 0..mesh.edges.len() {
        let (nodes, n) = edge(mesh, i);
        put(values, &nodes[..n])?;
    }
    mesh.corners.iter().try_for_each(|&c| put(values, &[c]))
}
