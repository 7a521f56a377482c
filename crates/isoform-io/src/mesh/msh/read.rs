//! Reader of versions 4.1 (text and binary) and 2.x (text).
//!
//! A file is a sequence of sections, `$Nodes … $EndNodes` and others. In version 4.1 elements are
//! stored in blocks by entity, and entities list the physical groups they belong to; in version 2
//! every element states its group. Physical groups become parts, curves and regions; without any,
//! the entities do.

use super::TET10_PERMUTATION;
use crate::input::{Input, Result, Words, shorten};
use crate::mesh::build::MeshBuilder;
use crate::{At, ErrorKind, ReadReport};
use isoform_geom::Mesh;
use std::collections::HashMap;

const GMSH_FAILURE: &str = "cannot read the Gmsh file";
/// Maximum number of lines with physical names. Real files have far fewer.
const MAX_PHYSICAL_NAMES: usize = 1 << 20;

/// Stream of numbers, as words of text or binary fields.
struct MshScanner<'i, 'a> {
    input: &'i mut Input<'a>,
    words: Words,
    /// True if a binary file is big endian; `None` for text.
    binary: Option<bool>,
    /// Width of counts in bytes.
    size: usize,
}

impl MshScanner<'_, '_> {
    /// Reads the next N bytes in little-endian order.
    fn bytes<const N: usize>(&mut self, big: bool) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.input
            .exact(&mut bytes, || "a section is incomplete".into())?;
        if big {
            bytes.reverse();
        }
        Ok(bytes)
    }
    /// Parses the next word.
    fn word<T>(&mut self, parse: impl Fn(&str) -> Option<T>, kind: &str) -> Result<T> {
        let Some(word) = self.words.next(self.input)? else {
            return Err(self.input.truncated("a section is incomplete"));
        };
        match parse(word) {
            Some(v) => Ok(v),
            None => {
                let why = format!("\"{}\" is not {kind}", shorten(word));
                let at = self.input.at_line(self.words.column);
                Err(self.input.error(
                    ErrorKind::Number,
                    at,
                    GMSH_FAILURE,
                    why,
                    "save the mesh again",
                ))
            }
        }
    }
    /// Reads the next integer, which has 32 bits in binary files.
    fn int(&mut self) -> Result<i64> {
        match self.binary {
            Some(big) => Ok(i64::from(i32::from_le_bytes(self.bytes(big)?))),
            None => self.word(|w| w.parse().ok(), "a whole number"),
        }
    }
    /// Reads the next count or tag, which has [`MshScanner::size`] bytes in binary files.
    fn size(&mut self) -> Result<u64> {
        match self.binary {
            Some(big) if self.size == 4 => Ok(u64::from(u32::from_le_bytes(self.bytes(big)?))),
            Some(big) => Ok(u64::from_le_bytes(self.bytes(big)?)),
            None => self.word(|w| w.parse().ok(), "a number of things"),
        }
    }
    /// Reads the next double.
    fn double(&mut self) -> Result<f64> {
        match self.binary {
            Some(big) => Ok(f64::from_le_bytes(self.bytes(big)?)),
            None => self.word(crate::input::parse_number, "a number"),
        }
    }
    /// Reads the number of a node or an element.
    fn id(&mut self) -> Result<u32> {
        let at = self.at();
        let id = self.size()?;
        u32::try_from(id).map_err(|_| {
            let why = format!("the number {id} is larger than 4294967295");
            self.input.error(
                ErrorKind::TooLarge,
                at,
                GMSH_FAILURE,
                why,
                "renumber the mesh",
            )
        })
    }
    /// Returns the position of the next number.
    fn at(&self) -> At {
        if self.binary.is_some() {
            self.input.at_byte()
        } else {
            self.input.at_line(0)
        }
    }
    /// Skips the rest of a section.
    fn pass(&mut self, name: &str) -> Result<()> {
        let end = format!("$End{name}");
        let (mut text, mut bytes) = (String::new(), Vec::new());
        // The rest of the present line is empty or damaged.
        self.words = Words::new();
        loop {
            if !self.input.read_line(&mut text, &mut bytes)? {
                return Err(self
                    .input
                    .truncated(format!("the line \"{end}\" is missing")));
            }
            if text.trim_end().ends_with(&end) {
                return Ok(());
            }
        }
    }
    /// Returns the error for an unsupported variant of the format, at the present position.
    fn unsupported(&self, why: String) -> crate::ReadError {
        unsupported(self.input, self.at(), why)
    }
}

/// Returns the error for an unsupported variant of the format.
fn unsupported(input: &Input<'_>, at: At, why: String) -> crate::ReadError {
    let hint = "save it as version 4.1, or as 2.2 in text";
    input.error(ErrorKind::UnsupportedFormat, at, GMSH_FAILURE, why, hint)
}

/// Reads section after section.
pub(in crate::mesh) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let mut scan = MshScanner {
        input,
        words: Words::new(),
        binary: None,
        size: 8,
    };
    let mut file = MshFile {
        builder: MeshBuilder::new(),
        physical: HashMap::new(),
        version: None,
        had_nodes: false,
        passed: Vec::new(),
    };
    let (mut text, mut bytes) = (String::new(), Vec::new());
    while scan.input.read_line(&mut text, &mut bytes)? {
        let Some(name) = text.trim_end().strip_prefix('$') else {
            continue;
        };
        let is_known = file.section(name, &mut scan, report)?;
        if name != "PhysicalNames" {
            let passed = scan.pass(name);
            // An unknown section may end in an unknown way; this does not mean that the file is
            // truncated.
            passed.map_err(|e| match is_known || e.kind != ErrorKind::Truncated {
                true => e,
                false => file.unknown(scan.input, &e.why),
            })?;
        }
    }
    if !file.had_nodes {
        return Err(match file.passed.is_empty() {
            true => scan.input.truncated("there is no section of nodes"),
            false => file.unknown(scan.input, "there is no section $Nodes"),
        });
    }
    file.builder.finish(scan.input, report)
}

/// Contents of the sections so far.
struct MshFile {
    /// Nodes and elements so far.
    builder: MeshBuilder,
    /// Physical groups of the entities.
    physical: PhysicalTags,
    /// Version 2 or 4; `None` before the format section.
    version: Option<u32>,
    /// True after the section of nodes.
    had_nodes: bool,
    /// Names of the first unknown sections.
    passed: Vec<String>,
}

/// Maximum number of unknown sections listed in an error.
const MAX_LISTED_SECTIONS: usize = 5;

impl MshFile {
    /// Returns the error for a file with unknown sections that lacks something.
    fn unknown(&self, input: &Input<'_>, missing: &str) -> crate::ReadError {
        let sections = self.passed.join(", ");
        let why = format!("{missing}, and there are sections that are not known: {sections}");
        unsupported(input, At::File, why)
    }

    /// Reads the contents of a section except its last line. Returns true if the section is known.
    fn section(
        &mut self,
        name: &str,
        scan: &mut MshScanner<'_, '_>,
        report: &mut ReadReport,
    ) -> Result<bool> {
        let four = self.version == Some(4);
        match name {
            "MeshFormat" => self.version = Some(read_format(scan)?),
            _ if self.version.is_none() => {
                let why = format!("section \"{}\" before the version", shorten(name));
                return Err(scan.input.error(
                    ErrorKind::Header,
                    scan.at(),
                    GMSH_FAILURE,
                    why,
                    "save the mesh again",
                ));
            }
            "PhysicalNames" => read_names(scan, &mut self.builder)?,
            "Entities" if four => read_entities(scan, &mut self.physical)?,
            "Nodes" if four => {
                self.had_nodes = true;
                read_nodes4(scan, &mut self.builder)?
            }
            "Nodes" | "ParametricNodes" if !four => {
                self.had_nodes = true;
                read_nodes2(scan, &mut self.builder, name == "ParametricNodes")?
            }
            "Elements" if four => read_elements4(scan, &mut self.builder, &self.physical)?,
            "Elements" => read_elements2(scan, &mut self.builder)?,
            _ => {
                report.warn(format!("section \"{}\" was passed over", shorten(name)));
                if self.passed.len() < MAX_LISTED_SECTIONS {
                    self.passed.push(format!("${}", shorten(name)));
                }
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Reads the format section and returns the version, 2 or 4.
fn read_format(scan: &mut MshScanner<'_, '_>) -> Result<u32> {
    let version = scan.double()?;
    let binary = scan.int()? != 0;
    scan.size = scan.int()? as usize;
    if !(version == 4.1 || (2.0..3.0).contains(&version))
        || binary && (version < 4.0 || ![4, 8].contains(&scan.size))
    {
        let kind = if binary { "binary" } else { "text" };
        return Err(scan.unsupported(format!(
            "version {version} ({kind}, sizes of {} bytes) is not read",
            scan.size
        )));
    }
    if binary {
        scan.words = Words::new();
        scan.binary = match scan.bytes(false)? {
            [1, 0, 0, 0] => Some(false),
            [0, 0, 0, 1] => Some(true),
            other => return Err(scan.unsupported(format!("{other:?} tells no order of bytes"))),
        };
    }
    Ok(version as u32)
}

/// Reads lines `dimension tag "name"` up to the end of the section.
fn read_names(scan: &mut MshScanner<'_, '_>, builder: &mut MeshBuilder) -> Result<()> {
    let (mut text, mut bytes) = (String::new(), Vec::new());
    for _ in 0..MAX_PHYSICAL_NAMES {
        if !scan.input.read_line(&mut text, &mut bytes)? {
            return Err(scan
                .input
                .truncated("the line \"$EndPhysicalNames\" is missing"));
        }
        if text.starts_with('$') {
            return Ok(());
        }
        let mut words = text.splitn(3, ' ');
        let (dim, tag) = (
            words.next().and_then(|w| w.parse::<usize>().ok()),
            words.next().and_then(|w| w.parse::<i64>().ok()),
        );
        if let (Some(dim @ 0..=3), Some(tag), Some(name)) = (dim, tag, words.next()) {
            let name = name.trim().trim_matches('"').to_owned();
            builder.names[dim].insert(tag, name);
        }
    }
    Err(scan.input.error(
        ErrorKind::TooLarge,
        scan.at(),
        GMSH_FAILURE,
        format!("more than {MAX_PHYSICAL_NAMES} names"),
        "save the mesh again",
    ))
}

/// First physical group of every entity, by dimension and tag.
type PhysicalTags = HashMap<(i64, i64), i64>;

/// Reads the entities, of which only the first physical group is kept.
fn read_entities(scan: &mut MshScanner<'_, '_>, physical: &mut PhysicalTags) -> Result<()> {
    let counts = [scan.size()?, scan.size()?, scan.size()?, scan.size()?];
    for (dim, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag = scan.int()?;
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                scan.double()?;
            }
            for i in 0..scan.size()? {
                let group = scan.int()?;
                if i == 0 {
                    physical.insert((dim as i64, tag), group.abs());
                }
            }
            for _ in 0..if dim == 0 { 0 } else { scan.size()? } {
                scan.int()?;
            }
        }
    }
    Ok(())
}

/// Reads the nodes of version 4.1, in blocks of numbers followed by coordinates.
fn read_nodes4(scan: &mut MshScanner<'_, '_>, builder: &mut MeshBuilder) -> Result<()> {
    let blocks = scan.size()?;
    for _ in 0..3 {
        scan.size()?;
    }
    let mut ids = Vec::new();
    for _ in 0..blocks {
        let (dim, _, parametric) = (scan.int()?, scan.int()?, scan.int()?);
        let count = scan.size()?;
        ids.clear();
        for _ in 0..count {
            ids.push(scan.id()?);
        }
        for &id in &ids {
            let at = scan.at();
            let p = [scan.double()?, scan.double()?, scan.double()?];
            if parametric != 0 {
                for _ in 0..dim.clamp(0, 3) {
                    scan.double()?;
                }
            }
            builder.node(id, p, scan.input, at)?;
        }
    }
    Ok(())
}

/// Reads the nodes of version 2, each with its number. Parametric nodes are followed by their
/// entity and parameters on the rest of the line.
fn read_nodes2(
    scan: &mut MshScanner<'_, '_>,
    builder: &mut MeshBuilder,
    are_parametric: bool,
) -> Result<()> {
    for _ in 0..scan.size()? {
        let id = scan.id()?;
        let p = [scan.double()?, scan.double()?, scan.double()?];
        builder.node(id, p, scan.input, scan.at())?;
        if are_parametric {
            scan.words.pass_line();
        }
    }
    Ok(())
}

/// Number of nodes of each element type of Gmsh.
#[rustfmt::skip]
const NODE_COUNTS: [u8; 32] = [0, 2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];

/// Returns the number of nodes of an element type.
fn node_count(scan: &MshScanner<'_, '_>, kind: i64) -> Result<usize> {
    match usize::try_from(kind).ok().and_then(|k| NODE_COUNTS.get(k)) {
        Some(&n) if n > 0 => Ok(n.into()),
        _ => Err(scan.unsupported(format!("elements of type {kind} are not known"))),
    }
}

/// Adds an element: corners, edges, triangles and tetrahedra of first and second order,
/// quadrilaterals and wedges; all others are counted.
fn take(builder: &mut MeshBuilder, kind: i64, tag: i64, number: u32, nodes: &[u32], at: At) {
    let number = Some(number);
    match kind {
        15 => builder.corners.push(nodes, tag, number, at),
        1 | 8 => builder.edges.push(nodes, tag, number, at),
        2 | 9 => builder.triangles.push(nodes, tag, number, at),
        4 => builder.tets.push(nodes, tag, number, at),
        11 => builder
            .tets
            .push(&TET10_PERMUTATION.map(|k| nodes[k]), tag, number, at),
        3 => builder.quad(nodes, tag, number, at),
        6 => builder.wedges.push(nodes, tag, number, at),
        _ => builder.others += 1,
    }
}

/// Reads the elements of version 4.1, in blocks of one entity and one type.
fn read_elements4(
    scan: &mut MshScanner<'_, '_>,
    builder: &mut MeshBuilder,
    physical: &PhysicalTags,
) -> Result<()> {
    let blocks = scan.size()?;
    for _ in 0..3 {
        scan.size()?;
    }
    let mut nodes = Vec::new();
    for _ in 0..blocks {
        let (dim, entity, kind) = (scan.int()?, scan.int()?, scan.int()?);
        let count = scan.size()?;
        let n = node_count(scan, kind)?;
        // The entity counts if no element belongs to a physical group.
        let tag = physical
            .get(&(dim, entity))
            .copied()
            .filter(|t| *t > 0)
            .unwrap_or(entity.saturating_abs().saturating_neg());
        let at = scan.at();
        for _ in 0..count {
            let number = scan.id()?;
            nodes.clear();
            for _ in 0..n {
                nodes.push(scan.id()?);
            }
            take(builder, kind, tag, number, &nodes, at);
        }
    }
    Ok(())
}

/// Reads the elements of version 2, each with its own tags: the group, then the entity.
fn read_elements2(scan: &mut MshScanner<'_, '_>, builder: &mut MeshBuilder) -> Result<()> {
    let mut nodes = Vec::new();
    for _ in 0..scan.size()? {
        let number = scan.id()?;
        let kind = scan.int()?;
        let n = node_count(scan, kind)?;
        let at = scan.at();
        let (mut group, mut entity) = (0, 0);
        for i in 0..scan.size()? {
            let tag = scan.int()?;
            match i {
                0 => group = tag.saturating_abs(),
                1 => entity = tag.saturating_abs(),
                _ => {}
            }
        }
        nodes.clear();
        for _ in 0..n {
            nodes.push(scan.id()?);
        }
        take(
            builder,
            kind,
            if group > 0 { group } else { -entity },
            number,
            &nodes,
            at,
        );
    }
    Ok(())
}
