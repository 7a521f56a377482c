//! Functions of a model part as they are written ("3MF Volumetric and Implicit Extensions" 1.0.0,
//! part I, chapter 2, and part II, chapters 2 to 5). Their meaning is in `implicit`.
//!
//! Nothing is judged here: files of meshes often hold functions for colours, which are not read.

use crate::ErrorKind;
use crate::xml::{attribute, unescape};
use std::collections::BTreeMap;

/// Ends of the namespaces of the two extensions.
pub(super) const VOLUMETRIC_EXTENSION: &str = "/volumetric/2022/01";
pub(super) const IMPLICIT_EXTENSION: &str = "/implicit/2023/12";

/// Type of an input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PortType {
    Scalar,
    Vector,
    Matrix,
    Resource,
}

impl PortType {
    /// Returns the type of an element such as `scalar` or `scalarref`.
    fn of_element(name: &str) -> Option<Self> {
        Some(match name.strip_suffix("ref").unwrap_or(name) {
            "scalar" => Self::Scalar,
            "vector" => Self::Vector,
            "matrix" => Self::Matrix,
            "resourceid" | "resource" => Self::Resource,
            _ => return None,
        })
    }

    /// Returns the name of the type, with its article.
    pub(super) fn noun(self) -> &'static str {
        match self {
            Self::Scalar => "a scalar",
            Self::Vector => "a vector",
            Self::Matrix => "a matrix",
            Self::Resource => "a resource",
        }
    }
}

/// Input or output of a function or of a node.
#[derive(Debug)]
pub(super) struct Port {
    pub(super) name: Box<str>,
    pub(super) of_type: PortType,
    /// The output that it takes its value from, as `node.output`; empty if none is stated.
    pub(super) reference: Box<str>,
}

/// Node of a function.
#[derive(Debug)]
pub(super) struct FunctionNode {
    /// Name of the element, which is the operation, in lower case.
    pub(super) kind: Box<str>,
    pub(super) name: Box<str>,
    /// Name for people.
    pub(super) title: Box<str>,
    /// Attributes, which hold the values of constants.
    pub(super) attributes: Box<str>,
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
}

/// Function of a model part.
#[derive(Debug, Default)]
pub(super) struct ModelFunction {
    /// Name for people.
    pub(super) title: Box<str>,
    /// Name of an element other than an implicit function; empty for one.
    pub(super) foreign: Box<str>,
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
    pub(super) nodes: Vec<FunctionNode>,
}

/// Place in a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PortSide {
    Inputs,
    Outputs,
}

/// State of reading functions.
#[derive(Debug, Default)]
pub(super) struct FunctionReader {
    /// Prefixes of the implicit and the volumetric namespace, with their colons; `None` if the root
    /// does not declare them.
    implicit: Option<String>,
    volumetric: Option<String>,
    function: Option<(u32, ModelFunction)>,
    node: Option<FunctionNode>,
    side: Option<PortSide>,
}

/// Returns the prefix, with its colon, that the attributes of the root give to a namespace.
fn prefix_of(attributes: &str, space: &str) -> Option<String> {
    let mut words = attributes.split_ascii_whitespace();
    words.find_map(|word| {
        let name = word.strip_prefix("xmlns")?.split('=').next()?;
        let is_same = attribute(attributes, &format!("xmlns{name}"))?.ends_with(space);
        let prefix = name.strip_prefix(':').unwrap_or(name);
        is_same.then(|| match prefix {
            "" => String::new(),
            prefix => format!("{prefix}:"),
        })
    })
}

impl FunctionReader {
    /// Takes the namespaces of the root's attributes.
    pub(super) fn new(attributes: &str) -> Self {
        Self {
            implicit: prefix_of(attributes, IMPLICIT_EXTENSION),
            volumetric: prefix_of(attributes, VOLUMETRIC_EXTENSION),
            ..Self::default()
        }
    }

    /// Returns the name of an element without the prefix of the volumetric namespace.
    pub(super) fn volumetric<'n>(&self, name: &'n str) -> Option<&'n str> {
        name.strip_prefix(self.volumetric.as_deref()?)
    }

    /// Processes the start of an element; returns false if it belongs to no function.
    pub(super) fn open(
        &mut self,
        name: &str,
        attributes: &str,
        functions: &mut BTreeMap<u32, ModelFunction>,
    ) -> Result<bool, (ErrorKind, String)> {
        if let Some("functionfromimage3d" | "privateextensionfunction") = self
            .volumetric(name)
            .map(str::to_ascii_lowercase)
            .as_deref()
        {
            let function = ModelFunction {
                foreign: name.into(),
                ..named(attributes)
            };
            insert(functions, number(attributes)?, function)?;
            return Ok(true);
        }
        let Some(name) = self.implicit.as_deref().and_then(|p| name.strip_prefix(p)) else {
            return Ok(false);
        };
        match (&mut self.function, &mut self.node, self.side) {
            (None, ..) => {
                // Drafts of the extension wrote `function`.
                if matches!(name, "implicitfunction" | "function") {
                    self.function = Some((number(attributes)?, named(attributes)));
                } else {
                    return Ok(false);
                }
            }
            (Some((_, function)), node, Some(side)) => {
                if let Some(of_type) = PortType::of_element(name) {
                    let port = Port {
                        name: text(attributes, "identifier"),
                        of_type,
                        reference: text(attributes, "ref"),
                    };
                    let (inputs, outputs) = match node {
                        Some(node) => (&mut node.inputs, &mut node.outputs),
                        None => (&mut function.inputs, &mut function.outputs),
                    };
                    match side {
                        PortSide::Inputs => inputs.push(port),
                        PortSide::Outputs => outputs.push(port),
                    }
                }
            }
            (Some(_), _, None) if name == "in" => self.side = Some(PortSide::Inputs),
            (Some(_), _, None) if name == "out" => self.side = Some(PortSide::Outputs),
            (Some(_), node @ None, None) => {
                *node = Some(FunctionNode {
                    kind: name.to_ascii_lowercase().into(),
                    name: text(attributes, "identifier"),
                    title: text(attributes, "displayname"),
                    attributes: attributes.into(),
                    inputs: Vec::new(),
                    outputs: Vec::new(),
                });
            }
            (Some(_), Some(_), None) => {}
        }
        Ok(true)
    }

    /// Processes the end of an element; returns false if it belongs to no function.
    pub(super) fn close(
        &mut self,
        name: &str,
        functions: &mut BTreeMap<u32, ModelFunction>,
    ) -> Result<bool, (ErrorKind, String)> {
        let Some(name) = self.implicit.as_deref().and_then(|p| name.strip_prefix(p)) else {
            return Ok(false);
        };
        let Some((_, function)) = &mut self.function else {
            return Ok(false);
        };
        let ends_node = |node: &FunctionNode| node.kind.eq_ignore_ascii_case(name);
        match name {
            "in" | "out" => self.side = None,
            _ if self.side.is_some() => {}
            _ if self.node.as_ref().is_some_and(ends_node) => {
                function.nodes.extend(self.node.take());
            }
            "implicitfunction" | "function" if self.node.is_none() => {
                if let Some((id, function)) = self.function.take() {
                    insert(functions, id, function)?;
                }
            }
            _ => {}
        }
        Ok(true)
    }
}

/// Adds a function under its number.
fn insert(
    functions: &mut BTreeMap<u32, ModelFunction>,
    id: u32,
    function: ModelFunction,
) -> Result<(), (ErrorKind, String)> {
    match functions.insert(id, function) {
        Some(_) => Err((ErrorKind::Corrupt, format!("function {id} is there twice"))),
        None => Ok(()),
    }
}

/// Returns a function with nothing but its name.
fn named(attributes: &str) -> ModelFunction {
    ModelFunction {
        title: text(attributes, "displayname"),
        ..ModelFunction::default()
    }
}

/// Returns the number of a resource.
fn number(attributes: &str) -> Result<u32, (ErrorKind, String)> {
    super::model::whole(attributes, "id")
}

/// Returns the value of an attribute; empty if there is none.
fn text(attributes: &str, key: &str) -> Box<str> {
    unescape(attribute(attributes, key).unwrap_or("")).into()
}
