//! Model part of a 3MF package: its objects, materials and build items ("3D Manufacturing Format
//! core specification" 1.3, chapters 3 to 5).

use super::functions::{FunctionReader, IMPLICIT_EXTENSION, ModelFunction, VOLUMETRIC_EXTENSION};
use super::tags::{Tag, Tags};
use super::transform::Transform;
use crate::ErrorKind;
use crate::input::{parse_number, shorten};
use crate::unzip::Problem;
use crate::xml::{attribute, unescape};
use isoform_geom::Point3;
use std::collections::BTreeMap;

/// End of the namespace of the extension that splits a model into several parts of the package
/// ("3MF production extension" 1.1).
const PRODUCTION_EXTENSION: &str = "/production/2015/06";
/// Extensions that do not affect the content read here: materials, and the one above.
const HARMLESS_EXTENSIONS: [&str; 2] = ["/material/2015/02", PRODUCTION_EXTENSION];

/// Material: number of its group, and index in it.
pub(super) type MaterialId = (u32, u32);

/// Model part of a package.
#[derive(Debug, Default)]
pub(super) struct ModelPart {
    /// Unit of length, as named in this crate.
    pub(super) unit: &'static str,
    pub(super) objects: BTreeMap<u32, ModelObject>,
    /// Names of base materials by group.
    pub(super) materials: BTreeMap<u32, Vec<String>>,
    /// Build items.
    pub(super) items: Vec<Component>,
    /// Required extensions that are not supported.
    pub(super) unknown: Vec<String>,
    /// True if the extensions of functions are required, which the readers of meshes pass over.
    pub(super) needs_functions: bool,
    pub(super) functions: BTreeMap<u32, ModelFunction>,
}

/// Object: a mesh, or an assembly of other objects.
#[derive(Debug, Default)]
pub(super) struct ModelObject {
    pub(super) name: String,
    pub(super) vertices: Vec<Point3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Material of each triangle; empty if none has one.
    pub(super) materials: Vec<Option<MaterialId>>,
    pub(super) components: Vec<Component>,
    /// Attributes of its level set; `None` if it has none.
    pub(super) level_set: Option<Box<str>>,
    /// Default material of triangles.
    default: Option<MaterialId>,
}

/// Reference to an object with its transform.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// Name of the model part that contains the object; `None` for this part.
    pub(super) path: Option<Box<str>>,
    pub(super) object: u32,
    /// Transform of the object; `None` for the identity.
    pub(super) transform: Option<Box<Transform>>,
}

/// Returns the unit of length, as named in this crate; the default is millimetres.
fn unit(attributes: &str) -> &'static str {
    let stated = attribute(attributes, "unit").unwrap_or("millimeter");
    let known = super::UNIT_NAMES
        .iter()
        .find(|(_, theirs)| *theirs == stated);
    known.map_or("mm", |(ours, _)| ours)
}

/// Reads a model part.
pub(super) fn read(tags: &mut Tags<'_>) -> Result<ModelPart, Problem> {
    let mut reader = ModelReader::default();
    while let Some(tag) = tags.next()? {
        let taken = match tag {
            Tag::Close(name) => reader.close(name),
            Tag::Open {
                name,
                attributes,
                is_closed,
            } => reader.open(name, attributes).and_then(|()| {
                if is_closed {
                    reader.close(name)
                } else {
                    Ok(())
                }
            }),
        };
        taken.map_err(|(kind, why)| Problem::new(kind, format!("line {}: {why}", tags.line)))?;
    }
    match reader.is_model && reader.is_over {
        true => Ok(reader.model),
        false if reader.is_model => Err(Problem::new(
            ErrorKind::Truncated,
            "the text ends before the model does",
        )),
        false => Err(Problem::new(ErrorKind::Header, "there is no model in it")),
    }
}

/// Kind and description of the problem of a tag.
type TagProblem = (ErrorKind, String);

/// State of reading a model.
#[derive(Default)]
struct ModelReader {
    model: ModelPart,
    /// True after the start and after the end of the root element.
    is_model: bool,
    is_over: bool,
    /// Prefix of the core namespace, with its colon.
    prefix: String,
    /// Name of the path attribute of the production extension, with its prefix.
    path: String,
    /// Present object with its number.
    object: Option<(u32, ModelObject)>,
    /// Present group of base materials.
    group: Option<u32>,
    functions: FunctionReader,
}

impl ModelReader {
    /// Processes the start of an element.
    fn open(&mut self, name: &str, attributes: &str) -> Result<(), TagProblem> {
        if !self.is_model {
            return self.root(name, attributes);
        }
        let functions = &mut self.model.functions;
        if self.functions.open(name, attributes, functions)? {
            return Ok(());
        }
        if self.functions.volumetric(name) == Some("levelset")
            && let Some((_, object)) = &mut self.object
        {
            object.level_set = Some(attributes.into());
            return Ok(());
        }
        let Some(name) = name.strip_prefix(self.prefix.as_str()) else {
            return Ok(());
        };
        match name {
            "vertex" => self.vertex(attributes),
            "triangle" => self.triangle(attributes),
            "object" => self.begin_object(attributes),
            "component" => {
                let component = self.component(attributes)?;
                if let Some((_, object)) = &mut self.object {
                    object.components.push(component);
                }
                Ok(())
            }
            "item" => {
                let item = self.component(attributes)?;
                self.model.items.push(item);
                Ok(())
            }
            "basematerials" => {
                let id = whole(attributes, "id")?;
                self.model.materials.insert(id, Vec::new());
                self.group = Some(id);
                Ok(())
            }
            "base" => {
                self.base(attributes);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Processes the end of an element.
    fn close(&mut self, name: &str) -> Result<(), TagProblem> {
        if self.functions.close(name, &mut self.model.functions)? {
            return Ok(());
        }
        match name.strip_prefix(self.prefix.as_str()) {
            Some("object") => {
                if let Some((id, object)) = self.object.take() {
                    object.check(id)?;
                    self.model.objects.insert(id, object);
                }
            }
            Some("basematerials") => self.group = None,
            Some("model") => {
                if let Some((id, _)) = &self.object {
                    return Err((ErrorKind::Corrupt, format!("object {id} does not end")));
                }
                self.is_over = true;
            }
            _ => {}
        }
        Ok(())
    }

    /// Processes the root, which states the unit and the extensions.
    fn root(&mut self, name: &str, attributes: &str) -> Result<(), TagProblem> {
        let Some(prefix) = name.strip_suffix("model") else {
            let why = format!("the first element is \"{}\", not a model", shorten(name));
            return Err((ErrorKind::Header, why));
        };
        self.is_model = true;
        self.prefix = prefix.to_owned();
        self.model.unit = unit(attributes);
        let space = |prefix: &str| attribute(attributes, &format!("xmlns:{prefix}"));
        let needed = attribute(attributes, "requiredextensions").unwrap_or("");
        for prefix in needed.split_ascii_whitespace() {
            let name = space(prefix).unwrap_or(prefix);
            if [VOLUMETRIC_EXTENSION, IMPLICIT_EXTENSION]
                .iter()
                .any(|known| name.ends_with(known))
            {
                self.model.needs_functions = true;
                continue;
            }
            if !HARMLESS_EXTENSIONS
                .iter()
                .any(|known| name.ends_with(known))
            {
                let short = name.rsplit("3dmanufacturing/").next().unwrap_or(name);
                self.model.unknown.push(shorten(short));
            }
        }
        let spaces = attributes.split_ascii_whitespace();
        let mut prefixes = spaces.filter_map(|a| a.strip_prefix("xmlns:")?.split('=').next());
        let production =
            prefixes.find(|p| space(p).is_some_and(|s| s.ends_with(PRODUCTION_EXTENSION)));
        self.path = format!("{}:path", production.unwrap_or("p"));
        self.functions = FunctionReader::new(attributes);
        Ok(())
    }

    /// Begins an object.
    fn begin_object(&mut self, attributes: &str) -> Result<(), TagProblem> {
        let id = whole(attributes, "id")?;
        if self.model.objects.contains_key(&id) {
            return Err((ErrorKind::Corrupt, format!("object {id} is there twice")));
        }
        let name = unescape(attribute(attributes, "name").unwrap_or(""));
        let object = ModelObject {
            name,
            default: material(attributes, "pindex", None)?,
            ..ModelObject::default()
        };
        self.object = Some((id, object));
        Ok(())
    }

    /// Adds a vertex to the present object.
    fn vertex(&mut self, attributes: &str) -> Result<(), TagProblem> {
        let Some((_, object)) = &mut self.object else {
            return Ok(());
        };
        let mut p = [0.0; 3];
        for (v, key) in p.iter_mut().zip(["x", "y", "z"]) {
            let text = attribute(attributes, key).unwrap_or("");
            *v = parse_number(text.trim()).ok_or_else(|| not_a_number(key, text))?;
        }
        object.vertices.push(p);
        Ok(())
    }

    /// Adds a triangle to the present object.
    fn triangle(&mut self, attributes: &str) -> Result<(), TagProblem> {
        let Some((_, object)) = &mut self.object else {
            return Ok(());
        };
        let mut corners = [0; 3];
        for (corner, key) in corners.iter_mut().zip(["v1", "v2", "v3"]) {
            *corner = whole(attributes, key)?;
        }
        let material = material(attributes, "p1", object.default)?;
        if material.is_some() || !object.materials.is_empty() {
            // Preceding triangles have no material.
            object.materials.resize(object.triangles.len(), None);
            object.materials.push(material);
        }
        object.triangles.push(corners);
        Ok(())
    }

    /// Parses the reference to an object in a component or a build item.
    fn component(&self, attributes: &str) -> Result<Component, TagProblem> {
        let path = attribute(attributes, &self.path);
        let transform = attribute(attributes, "transform");
        let transform = transform.map(|text| {
            let found = Transform::parse(text);
            found.ok_or_else(|| {
                let why = format!("\"{}\" is no transform of 12 numbers", shorten(text));
                (ErrorKind::Number, why)
            })
        });
        Ok(Component {
            path: path.map(|p| unescape(p).trim_start_matches('/').into()),
            object: whole(attributes, "objectid")?,
            transform: transform.transpose()?.map(Box::new),
        })
    }

    /// Adds a base material to the present group.
    fn base(&mut self, attributes: &str) {
        let group = self.group.and_then(|id| self.model.materials.get_mut(&id));
        if let Some(group) = group {
            let name = unescape(attribute(attributes, "name").unwrap_or(""));
            group.push(name);
        }
    }
}

impl ModelObject {
    /// Returns an error if a triangle refers to a missing vertex.
    fn check(&self, id: u32) -> Result<(), TagProblem> {
        let count = self.vertices.len();
        let is_wrong = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= count);
        let Some(i) = self.triangles.iter().position(is_wrong) else {
            return Ok(());
        };
        let why = format!(
            "triangle {} (from 1) of object {id} has corners {:?} (from 0), of {count} vertices",
            i + 1,
            self.triangles[i]
        );
        Err((ErrorKind::Index, why))
    }
}

fn not_a_number(key: &str, text: &str) -> TagProblem {
    let why = format!("{key}=\"{}\" is not a number", shorten(text));
    (ErrorKind::Number, why)
}

/// Parses a 32-bit unsigned integer.
pub(super) fn whole(attributes: &str, key: &str) -> Result<u32, TagProblem> {
    let text = attribute(attributes, key).unwrap_or("");
    text.trim().parse().map_err(|_| not_a_number(key, text))
}

/// Returns the material of an element: its group and, under `key`, its index there.
fn material(
    attributes: &str,
    key: &str,
    usual: Option<MaterialId>,
) -> Result<Option<MaterialId>, TagProblem> {
    if attribute(attributes, key).is_none() {
        return Ok(usual);
    }
    let group = match attribute(attributes, "pid") {
        Some(_) => Some(whole(attributes, "pid")?),
        None => usual.map(|(group, _)| group),
    };
    let place = whole(attributes, key)?;
    Ok(group.map(|group| (group, place)))
}
