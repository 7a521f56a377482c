//! The reader of versions 4.1 (text and binary) and 2.x (text).
//!
//! A file is a row of sections, `$Nodes … $EndNodes` and others. In version 4.1 elements stand in
//! blocks by entity, and entities name the physical groups that they belong to; in version 2 every
//! element names its group itself. Groups become parts, curves and regions; without physical groups
//! the entities do.

use super::TET10;
use crate::input::{Input, Result, Words, shorten};
use crate::mesh::build::Builder;
use crate::{At, ErrorKind, ReadReport};
use isoform_geom::Mesh;
use std::collections::HashMap;

/// What failed, as the errors of this reader say.
const WHAT: &str = "cannot read the Gmsh file";
/// More words of physical names than any true file has.
const MAX_NAMES: usize = 1 << 20;

/// Numbers one after the other, as words of text or fields of bytes.
struct Scan<'i, 'a> {
    input: &'i mut Input<'a>,
    words: Words,
    /// The order of bytes if the file is binary: whether it is big endian.
    binary: Option<bool>,
    /// Bytes of a size.
    size: usize,
}

impl Scan<'_, '_> {
    /// The next N bytes, turned round where they are big endian.
    fn bytes<const N: usize>(&mut self, big: bool) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.input
            .exact(&mut bytes, || "a section is incomplete".into())?;
        if big {
            bytes.reverse();
        }
        Ok(bytes)
    }
    /// The next word, parsed as something of this kind.
    fn word<T>(&mut self, parse: impl Fn(&str) -> Option<T>, kind: &str) -> Result<T> {
        let Some(word) = self.words.next(self.input)? else {
            return Err(self.input.truncated("a section is incomplete"));
        };
        match parse(word) {
            Some(v) => Ok(v),
            None => {
                let why = format!("\"{}\" is not {kind}", shorten(word));
                let at = self.input.at_line(self.words.column);
                Err(self
                    .input
                    .error(ErrorKind::Number, at, WHAT, why, "save the mesh again"))
            }
        }
    }
    /// The next whole number, which has 32 bits in binary.
    fn int(&mut self) -> Result<i64> {
        match self.binary {
            Some(big) => Ok(i64::from(i32::from_le_bytes(self.bytes(big)?))),
            None => self.word(|w| w.parse().ok(), "a whole number"),
        }
    }
    /// The next count or number of a thing, which has [`Scan::size`] bytes in binary.
    fn size(&mut self) -> Result<u64> {
        match self.binary {
            Some(big) if self.size == 4 => Ok(u64::from(u32::from_le_bytes(self.bytes(big)?))),
            Some(big) => Ok(u64::from_le_bytes(self.bytes(big)?)),
            None => self.word(|w| w.parse().ok(), "a number of things"),
        }
    }
    /// The next double.
    fn double(&mut self) -> Result<f64> {
        match self.binary {
            Some(big) => Ok(f64::from_le_bytes(self.bytes(big)?)),
            None => self.word(crate::input::parse_number, "a number"),
        }
    }
    /// Number of a node or an element.
    fn id(&mut self) -> Result<u32> {
        let at = self.at();
        let id = self.size()?;
        u32::try_from(id).map_err(|_| {
            let why = format!("the number {id} is larger than 4294967295");
            self.input
                .error(ErrorKind::TooLarge, at, WHAT, why, "renumber the mesh")
        })
    }
    /// The place of the next number.
    fn at(&self) -> At {
        if self.binary.is_some() {
            self.input.at_byte()
        } else {
            self.input.at_line(0)
        }
    }
    /// Reads over the rest of a section.
    fn pass(&mut self, name: &str) -> Result<()> {
        let end = format!("$End{name}");
        let (mut text, mut bytes) = (String::new(), Vec::new());
        // What is left of the line at hand is nothing or damage.
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
    /// The error for a variant of the format that is not read.
    fn unsupported(&self, why: String) -> crate::ReadError {
        unsupported(self.input, self.at(), why)
    }
}

/// The error for what is not read of a file.
fn unsupported(input: &Input<'_>, at: At, why: String) -> crate::ReadError {
    let hint = "save it as version 4.1, or as 2.2 in text";
    input.error(ErrorKind::UnsupportedFormat, at, WHAT, why, hint)
}

/// Reads section after section.
pub(in crate::mesh) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let mut scan = Scan {
        input,
        words: Words::new(),
        binary: None,
        size: 8,
    };
    let mut file = File {
        builder: Builder::new(),
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
            // An unknown section may end in its own way: the file need not be cut off.
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

/// What the sections have given so far.
struct File {
    /// Nodes and elements so far.
    builder: Builder,
    /// The groups of the entities.
    physical: Physical,
    /// 2 or 4, once the section of the format is read.
    version: Option<u32>,
    /// Whether the section of nodes has come.
    had_nodes: bool,
    /// Names of the first sections that are not known.
    passed: Vec<String>,
}

/// Most sections that are named in an error.
const NAMED: usize = 5;

impl File {
    /// The error for a file in which something is missing, and sections are not known.
    fn unknown(&self, input: &Input<'_>, missing: &str) -> crate::ReadError {
        let sections = self.passed.join(", ");
        let why = format!("{missing}, and there are sections that are not known: {sections}");
        unsupported(input, At::File, why)
    }

    /// Reads what a section holds; its last line is left. Returns true if the section is known.
    fn section(
        &mut self,
        name: &str,
        scan: &mut Scan<'_, '_>,
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
                    WHAT,
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
                if self.passed.len() < NAMED {
                    self.passed.push(format!("${}", shorten(name)));
                }
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// The version, 2 or 4.
fn read_format(scan: &mut Scan<'_, '_>) -> Result<u32> {
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

/// Lines `dimension tag "name"` up to the end of the section.
fn read_names(scan: &mut Scan<'_, '_>, builder: &mut Builder) -> Result<()> {
    let (mut text, mut bytes) = (String::new(), Vec::new());
    for _ in 0..MAX_NAMES {
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
        WHAT,
        format!("more than {MAX_NAMES} names"),
        "save the mesh again",
    ))
}

/// First physical group of every entity.
type Physical = HashMap<(i64, i64), i64>;

/// Entities, of which only the first physical group is kept.
fn read_entities(scan: &mut Scan<'_, '_>, physical: &mut Physical) -> Result<()> {
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

/// Nodes of version 4.1, in blocks of numbers and then coordinates.
fn read_nodes4(scan: &mut Scan<'_, '_>, builder: &mut Builder) -> Result<()> {
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

/// Nodes of version 2, each with its number. Parametric ones have their entity and the parameters
/// there in the rest of the line.
fn read_nodes2(scan: &mut Scan<'_, '_>, builder: &mut Builder, are_parametric: bool) -> Result<()> {
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

/// Nodes of the types of elements that Gmsh numbers.
#[rustfmt::skip]
const NODES: [u8; 32] = [0, 2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];

/// How many nodes an element of this type has.
fn node_count(scan: &Scan<'_, '_>, kind: i64) -> Result<usize> {
    match usize::try_from(kind).ok().and_then(|k| NODES.get(k)) {
        Some(&n) if n > 0 => Ok(n.into()),
        _ => Err(scan.unsupported(format!("elements of type {kind} are not known"))),
    }
}

/// Takes an element: corners, edges, triangles and tetrahedra of first and second order,
/// quadrilaterals and wedges; all others are counted.
fn take(builder: &mut Builder, kind: i64, tag: i64, number: u32, nodes: &[u32], at: At) {
    let number = Some(number);
    match kind {
        15 => builder.corners.push(nodes, tag, number, at),
        1 | 8 => builder.edges.push(nodes, tag, number, at),
        2 | 9 => builder.triangles.push(nodes, tag, number, at),
        4 => builder.tets.push(nodes, tag, number, at),
        11 => builder.tets.push(&TET10.map(|k| nodes[k]), tag, number, at),
        3 => builder.quad(nodes, tag, number, at),
        6 => builder.wedges.push(nodes, tag, number, at),
        _ => builder.others += 1,
    }
}

/// Elements of version 4.1, in blocks of one entity and one type.
fn read_elements4(
    scan: &mut Scan<'_, '_>,
    builder: &mut Builder,
    physical: &Physical,
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
        // An entity counts where nothing is in a physical group.
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

/// Elements of version 2, each with its own tags: the group, then the entity.
fn read_elements2(scan: &mut Scan<'_, '_>, builder: &mut Builder) -> Result<()> {
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
