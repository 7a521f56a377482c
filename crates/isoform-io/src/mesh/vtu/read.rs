//! Reader of VTK files: text, base64 and raw bytes, in place or appended, plain or compressed by
//! zlib.
//!
//! A first pass over the XML elements records the position and encoding of each array
//! ([`ArrayPlace`]). Then the arrays of every piece are decoded: points, cells as connectivity with
//! offsets and types, and the tags of groups.

use super::array::{ArrayCoding, Base64, VtkArray, from_bytes, from_text};
use super::{GROUP_NAMES, WEDGE_PERMUTATION};
use crate::binary::NumberType;
use crate::input::{Input, Result, shorten};
use crate::mesh::build::MeshBuilder;
use crate::xml::{XmlItem, XmlItems, attribute, unescape};
use crate::{At, ErrorKind, ReadReport};
use isoform_geom::Mesh;

const VTK_FAILURE: &str = "cannot read the VTK file";
/// Maximum decompressed size of all arrays together: a constant in bytes, plus a multiple of the
/// file size. A single array of constants can reach zlib's ratio of 1032, but the connectivity and
/// the points next to it compress much less.
const MAX_UNPACKED_BYTES: (u64, u64) = (16 << 20, 256);

/// Position and encoding of an array in the file.
struct ArrayPlace<'b> {
    /// Enclosing element: Points, Cells, CellData, …
    section: &'b str,
    /// Unescaped name.
    name: String,
    /// Type of the numbers, in VTK's terms.
    kind: &'b str,
    /// Format: ascii, binary (base64) or appended.
    format: &'b str,
    /// Offset in the appended data, in bytes.
    offset: usize,
    /// Text of the element.
    content: &'b [u8],
    /// Byte at which the element ends.
    at: usize,
}

impl<'b> ArrayPlace<'b> {
    /// Describes the array whose element was read last.
    fn from_element(section: &'b str, attributes: &'b str, items: &XmlItems<'b>) -> Self {
        let word = |name: &str| attribute(attributes, name);
        let offset = word("offset").and_then(|o| o.trim().parse().ok());
        Self {
            section,
            name: unescape(word("Name").unwrap_or("")),
            kind: word("type").unwrap_or(""),
            format: word("format").unwrap_or("ascii"),
            offset: offset.unwrap_or(0),
            content: items.content(),
            at: items.at,
        }
    }
}

/// Piece of the grid: a block of points and cells.
#[derive(Default)]
struct GridPiece<'b> {
    arrays: Vec<ArrayPlace<'b>>,
}

impl<'b> GridPiece<'b> {
    /// Returns the first array of a section with this name, or its first array if the name is
    /// empty.
    fn find(&self, section: &str, name: &str) -> Option<&ArrayPlace<'b>> {
        self.arrays
            .iter()
            .find(|p| p.section == section && (name.is_empty() || p.name == name))
    }
}

/// Decoded cells of a piece.
struct PieceCells {
    /// Byte position of the connectivity, for errors.
    at: usize,
    /// Nodes of all cells, concatenated.
    connectivity: VtkArray,
    /// End of each cell in the connectivity.
    offsets: VtkArray,
    /// VTK cell type of each cell.
    types: VtkArray,
    /// Tags of parts, regions and curves.
    tags: [Option<VtkArray>; 3],
    /// Number of points of the piece, and of all pieces before it.
    points: usize,
    before: usize,
}

impl PieceCells {
    /// Writes the nodes of cell `i`, which begin at `start`, into `nodes`, and returns their end.
    fn nodes(
        &self,
        i: usize,
        start: u64,
        nodes: &mut Vec<u32>,
    ) -> std::result::Result<u64, (ErrorKind, String)> {
        let length = self.connectivity.len();
        let end = self.offsets.index(i);
        let Some(end) = end.filter(|&e| e >= start && e <= length as u64) else {
            let why = format!("cell {i} ends at {} of {length}", self.offsets.get(i));
            return Err((ErrorKind::Corrupt, why));
        };
        nodes.clear();
        for k in start as usize..end as usize {
            let node = self.connectivity.index(k);
            let Some(node) = node.filter(|&n| n < self.points as u64) else {
                let (n, count) = (self.connectivity.get(k), self.points);
                let why = format!("cell {i} uses point {n} of {count}");
                return Err((ErrorKind::Index, why));
            };
            nodes.push((self.before as u64 + node) as u32);
        }
        Ok(end)
    }
}

/// Data appended after the grid.
#[derive(Default)]
struct AppendedData<'b> {
    /// Bytes after the marker `_`.
    bytes: &'b [u8],
    /// True if the data are base64.
    base64: bool,
}

/// Input with the encoding of its arrays.
struct VtuFile<'i, 'b> {
    input: &'i Input<'b>,
    coding: ArrayCoding,
}

/// Reads all pieces in turn into one mesh, with consecutive numbers of points.
pub(in crate::mesh) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let bytes = input.head(usize::MAX)?;
    let mut builder = MeshBuilder::new();
    let limit = MAX_UNPACKED_BYTES.0 + MAX_UNPACKED_BYTES.1 * bytes.len() as u64;
    let mut file = VtuFile {
        input,
        coding: ArrayCoding {
            big_endian: false,
            wide_header: false,
            zlib: false,
            limit,
        },
    };
    let (pieces, appended) = file.walk(&bytes, &mut builder)?;
    for piece in &pieces {
        file.read_piece(piece, &appended, &mut builder)?;
    }
    builder.finish(input, report)
}

impl VtuFile<'_, '_> {
    /// Returns an error at a byte of the file.
    fn bad(&self, kind: ErrorKind, at: usize, why: impl Into<String>) -> crate::ReadError {
        self.input.error(
            kind,
            At::Byte(at as u64),
            VTK_FAILURE,
            why,
            "save it again, as an unstructured grid (.vtu)",
        )
    }

    /// Locates the arrays, and passes the names of groups to the builder.
    fn walk<'b>(
        &mut self,
        bytes: &'b [u8],
        builder: &mut MeshBuilder,
    ) -> Result<(Vec<GridPiece<'b>>, AppendedData<'b>)> {
        let mut items = XmlItems::new(bytes);
        let mut pieces: Vec<GridPiece<'b>> = Vec::new();
        let mut appended = AppendedData::default();
        let (mut section, mut is_vtk) = ("", false);
        while let Some(item) = items.next() {
            let (name, attributes) = match item {
                XmlItem::Open { name, attributes } => (name, attributes),
                XmlItem::Comment(text) => {
                    read_names(text, builder);
                    continue;
                }
                XmlItem::Close("VTKFile") => break,
                XmlItem::Close(_) => continue,
            };
            match name {
                "VTKFile" => {
                    self.header(attributes, items.at)?;
                    is_vtk = true;
                }
                "Piece" => pieces.push(GridPiece::default()),
                "Points" | "Cells" | "CellData" | "PointData" | "FieldData" => section = name,
                "DataArray" => {
                    if let Some(piece) = pieces.last_mut() {
                        piece
                            .arrays
                            .push(ArrayPlace::from_element(section, attributes, &items));
                    }
                }
                "AppendedData" => {
                    appended = self.appended(bytes, items.at, attributes)?;
                    // Raw bytes may contain anything that looks like a tag; nothing follows them.
                    break;
                }
                _ => {}
            }
        }
        if !is_vtk {
            return Err(self.bad(ErrorKind::Header, 0, "there is no element \"VTKFile\""));
        }
        if pieces.is_empty() {
            return Err(self.input.truncated("there is no element \"Piece\""));
        }
        Ok((pieces, appended))
    }

    /// Returns the data appended after the element that ends at `at`: all bytes after a `_`.
    fn appended<'b>(
        &self,
        bytes: &'b [u8],
        at: usize,
        attributes: &str,
    ) -> Result<AppendedData<'b>> {
        let rest = &bytes[at..];
        let Some(start) = rest.iter().position(|&b| b == b'_') else {
            let why = "the appended data do not start with \"_\"";
            return Err(self.bad(ErrorKind::Corrupt, at, why));
        };
        Ok(AppendedData {
            bytes: &rest[start + 1..],
            base64: attribute(attributes, "encoding") != Some("raw"),
        })
    }

    /// Evaluates the attributes of the root: kind of grid, byte order, width of sizes, compressor.
    fn header(&mut self, attributes: &str, at: usize) -> Result<()> {
        let kind = attribute(attributes, "type").unwrap_or("");
        if kind != "UnstructuredGrid" {
            let why = format!("a VTK file of the type \"{}\"", shorten(kind));
            return Err(self.bad(ErrorKind::UnsupportedFormat, at, why));
        }
        self.coding.big_endian = attribute(attributes, "byte_order") == Some("BigEndian");
        self.coding.wide_header = attribute(attributes, "header_type") == Some("UInt64");
        self.coding.zlib = match attribute(attributes, "compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let why = format!(
                    "compressed by \"{}\", which is not read; zlib is",
                    shorten(other)
                );
                return Err(self.bad(ErrorKind::UnsupportedFormat, at, why));
            }
        };
        Ok(())
    }

    /// Decodes an array and subtracts its size from the memory limit.
    fn array(&mut self, place: &ArrayPlace<'_>, appended: &AppendedData<'_>) -> Result<VtkArray> {
        let kind = NumberType::named(&place.kind.to_ascii_lowercase());
        let Some(kind) = kind else {
            let why = format!(
                "array \"{}\" is of the unknown type \"{}\"",
                shorten(&place.name),
                shorten(place.kind)
            );
            return Err(self.bad(ErrorKind::Header, place.at, why));
        };
        let tail = appended.bytes.get(place.offset..).unwrap_or(&[]);
        let read = match place.format {
            "ascii" => from_text(place.content),
            "binary" => from_bytes(Base64::new(place.content), kind, self.coding),
            "appended" if appended.base64 => from_bytes(Base64::new(tail), kind, self.coding),
            "appended" => from_bytes(tail, kind, self.coding),
            other => Err(format!("the format \"{}\" is not known", shorten(other))),
        };
        let bad = |why: String| {
            self.bad(
                ErrorKind::Corrupt,
                place.at,
                format!("array \"{}\": {why}", shorten(&place.name)),
            )
        };
        let array = read.map_err(bad)?;
        let left = self.coding.limit.checked_sub(array.size());
        self.coding.limit =
            left.ok_or_else(|| bad("there is far more in the arrays than in the file".into()))?;
        Ok(array)
    }

    /// Reads the points and cells of a piece.
    fn read_piece(
        &mut self,
        piece: &GridPiece<'_>,
        appended: &AppendedData<'_>,
        builder: &mut MeshBuilder,
    ) -> Result<()> {
        let need = |section: &str, name: &str| {
            piece.find(section, name).ok_or_else(|| {
                let why = format!("there is no array \"{name}\" in \"{section}\"");
                self.bad(ErrorKind::Header, 0, why)
            })
        };
        let points = need("Points", "")?;
        let connectivity = need("Cells", "connectivity")?;
        let (offsets, types) = (need("Cells", "offsets")?, need("Cells", "types")?);
        let before = builder.node_count();
        let count = self.read_points(points, appended, builder)?;
        let cells = PieceCells {
            at: connectivity.at,
            connectivity: self.array(connectivity, appended)?,
            offsets: self.array(offsets, appended)?,
            types: self.array(types, appended)?,
            tags: self.tags(piece, appended)?,
            points: count,
            before,
        };
        self.take_cells(&cells, builder)
    }

    /// Passes the points to the builder, and returns their number.
    fn read_points(
        &mut self,
        place: &ArrayPlace<'_>,
        appended: &AppendedData<'_>,
        builder: &mut MeshBuilder,
    ) -> Result<usize> {
        let (before, at) = (builder.node_count(), At::Byte(place.at as u64));
        let points = self.array(place, appended)?;
        let count = points.len() / 3;
        for i in 0..count {
            let Ok(id) = u32::try_from(before + i) else {
                return Err(self.bad(ErrorKind::TooLarge, 0, "more than 4294967295 points"));
            };
            let p = [0, 1, 2].map(|k| points.get(3 * i + k));
            builder.node(id, p, self.input, at)?;
        }
        Ok(count)
    }

    /// Reads tags by kind of group. Names of arrays are tried in this order: those of this crate,
    /// of meshio, of Gmsh, and others.
    fn tags(
        &mut self,
        piece: &GridPiece<'_>,
        appended: &AppendedData<'_>,
    ) -> Result<[Option<VtkArray>; 3]> {
        let mut tags = [None, None, None];
        for (tags, ours) in tags.iter_mut().zip(GROUP_NAMES) {
            let known = [ours, "gmsh:physical", "CellEntityIds", "gmsh:geometrical"];
            if let Some(place) = known.iter().find_map(|name| piece.find("CellData", name)) {
                *tags = Some(self.array(place, appended)?);
            }
        }
        Ok(tags)
    }

    /// Passes the cells to the builder.
    fn take_cells(&self, cells: &PieceCells, builder: &mut MeshBuilder) -> Result<()> {
        let at = At::Byte(cells.at as u64);
        let (mut start, mut nodes) = (0, Vec::new());
        for i in 0..cells.types.len() {
            start = cells
                .nodes(i, start, &mut nodes)
                .map_err(|(kind, why)| self.bad(kind, cells.at, why))?;
            let tag = |k: usize| cells.tags[k].as_ref().map_or(0, |t| t.tag(i));
            take(builder, cells.types.get(i) as u8, &nodes, tag, at);
        }
        Ok(())
    }
}

/// Adds a cell, by its VTK type, to the builder.
fn take(builder: &mut MeshBuilder, kind: u8, nodes: &[u32], tag: impl Fn(usize) -> i64, at: At) {
    match (kind, nodes.len()) {
        (1, 1) => builder.corners.push(nodes, 0, None, at),
        (3, 2) | (21, 3) => builder.edges.push(nodes, tag(2), None, at),
        (5, 3) | (22, 6) => builder.triangles.push(nodes, tag(0), None, at),
        (7 | 9, 4) => builder.quad(nodes, tag(0), None, at),
        (7 | 9, 3..) => builder.polygon(nodes, tag(0), at),
        // A pixel is a quadrilateral with the last two corners swapped.
        (8, 4) => builder.quad(&[0, 1, 3, 2].map(|k| nodes[k]), tag(0), None, at),
        (10, 4) | (24, 10) => builder.tets.push(nodes, tag(1), None, at),
        (13, 6) => builder
            .wedges
            .push(&WEDGE_PERMUTATION.map(|k| nodes[k]), tag(1), None, at),
        _ => builder.others += 1,
    }
}

/// Reads lines `part 1 name` in the comment written by this crate.
fn read_names(text: &str, builder: &mut MeshBuilder) {
    let Some(lines) = text.strip_prefix(" groups\n") else {
        return;
    };
    for line in lines.lines() {
        let mut words = line.splitn(3, ' ');
        let kind = words
            .next()
            .and_then(|w| GROUP_NAMES.iter().position(|g| *g == w));
        let tag = words.next().and_then(|w| w.parse().ok());
        if let (Some(kind), Some(tag), Some(name)) = (kind, tag, words.next()) {
            builder.names[[2, 3, 1][kind]].insert(tag, unescape(name));
        }
    }
}
