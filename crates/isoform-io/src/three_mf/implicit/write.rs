//! Writer of level sets: a scalar expression as an implicit function with the box that bounds it.

use super::graph::{ScalarFunction as F, ScalarGraph, ScalarId, ScalarNode, ScalarOperation as O};
use crate::mesh::write_package;
use crate::xml::escape;
use isoform_geom::Aabb;
use std::io::{self, Write};

/// Triangles of a box whose corner i has the upper coordinate k where bit k of i is set.
const BOX_TRIANGLES: [[usize; 3]; 12] = [
    [0, 2, 1],
    [1, 2, 3],
    [4, 5, 6],
    [5, 7, 6],
    [0, 1, 4],
    [1, 5, 4],
    [2, 6, 3],
    [3, 6, 7],
    [0, 4, 2],
    [2, 4, 6],
    [1, 3, 5],
    [3, 7, 5],
];

/// A function with its bounds, to be written.
#[derive(Clone, Debug)]
pub struct ImplicitModel<'g> {
    /// The expression; inside it is positive.
    pub graph: &'g ScalarGraph,
    /// Node of the value.
    pub root: ScalarId,
    /// Box beyond which the model does not reach.
    pub bounds: Aabb,
    /// Name for people.
    pub name: &'g str,
    /// Unit of length, as named in this crate; `None` if it is unknown, which is written as mm.
    pub units: Option<&'g str>,
}

/// Writes a model as a 3MF package with one level set. Points at which the function is undefined
/// are outside.
///
/// # Errors
/// [`io::Error`] of the output, or of a constant that is not finite (`InvalidData`).
pub fn write_implicit(model: &ImplicitModel<'_>, out: &mut dyn Write) -> io::Result<()> {
    let mut text = String::new();
    let unit = crate::mesh::three_mf_unit(model.units);
    let name = escape(&super::one_line(model.name));
    text += "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"";
    text += unit;
    text += "\" xml:lang=\"en-US\" \
        xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" \
        xmlns:v=\"http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01\" \
        xmlns:i=\"http://schemas.3mf.io/3dmanufacturing/implicit/2023/12\" \
        requiredextensions=\"v i\">\n<resources>\n";
    text += &format!("<i:implicitfunction id=\"1\" displayname=\"{name}\">\n");
    text += "<i:in><i:vector identifier=\"pos\" displayname=\"pos\"/></i:in>\n";
    let result = write_nodes(model, &mut text)?;
    text += &format!(
        "<i:out><i:scalarref identifier=\"shape\" displayname=\"shape\" ref=\"{result}\"/>\
         </i:out>\n</i:implicitfunction>\n"
    );
    write_box(model.bounds, &mut text);
    text += &format!(
        "<object id=\"3\" type=\"model\" name=\"{name}\">\n<v:levelset functionid=\"1\" \
         channel=\"shape\" meshid=\"2\" meshbboxonly=\"true\" fallbackvalue=\"1\"/>\n</object>\n\
         </resources>\n<build>\n<item objectid=\"3\"/>\n</build>\n</model>\n"
    );
    write_package(out, |out| out.write_all(text.as_bytes()))
}

/// Writes the mesh of a box as object 2.
fn write_box(bounds: Aabb, text: &mut String) {
    *text += "<object id=\"2\" type=\"model\" name=\"bounds\">\n<mesh>\n<vertices>\n";
    for i in 0..8 {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| [bounds.lo, bounds.hi][i >> k & 1][k]);
        *text += &format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n");
    }
    *text += "</vertices>\n<triangles>\n";
    for [a, b, c] in BOX_TRIANGLES {
        *text += &format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n");
    }
    *text += "</triangles>\n</mesh>\n</object>\n";
}

/// Writes the nodes of the negated function, and returns the reference to its value.
fn write_nodes(model: &ImplicitModel<'_>, text: &mut String) -> io::Result<String> {
    let mut writer = NodeWriter {
        graph: model.graph,
        text,
        count: 0,
    };
    writer.start();
    let needed = model.graph.reachable(model.root);
    let mut references = vec![String::new(); model.root.at() + 1];
    for id in model.graph.ids().take(model.root.at() + 1) {
        if needed[id.at()] {
            references[id.at()] = writer.node(id, &references)?;
        }
    }
    let (zero, root) = (writer.constant(0.0)?, &references[model.root.at()]);
    Ok(writer.operation("subtraction", &[("A", &zero), ("B", root)]))
}

/// Writer of nodes.
struct NodeWriter<'g, 't> {
    graph: &'g ScalarGraph,
    text: &'t mut String,
    /// Number of nodes.
    count: usize,
}

impl NodeWriter<'_, '_> {
    /// Writes the node that gives the coordinates.
    fn start(&mut self) {
        *self.text += "<i:decomposevector identifier=\"point\" displayname=\"point\"><i:in>\
            <i:vectorref identifier=\"A\" displayname=\"A\" ref=\"inputs.pos\"/></i:in><i:out>";
        for axis in ["x", "y", "z"] {
            *self.text += &format!("<i:scalar identifier=\"{axis}\" displayname=\"{axis}\"/>");
        }
        *self.text += "</i:out></i:decomposevector>\n";
    }

    /// Returns the name of a new node.
    fn name(&mut self) -> String {
        self.count += 1;
        format!("n{}", self.count)
    }

    /// Writes a constant, and returns the reference to it.
    fn constant(&mut self, c: f64) -> io::Result<String> {
        if !c.is_finite() {
            let why = format!("the function has the constant {c}, which 3MF cannot hold");
            return Err(io::Error::new(io::ErrorKind::InvalidData, why));
        }
        let name = self.name();
        *self.text += &format!(
            "<i:constant identifier=\"{name}\" displayname=\"{name}\" value=\"{c:?}\"><i:out>\
             <i:scalar identifier=\"value\" displayname=\"value\"/></i:out></i:constant>\n"
        );
        Ok(format!("{name}.value"))
    }

    /// Writes an operation on scalars, and returns the reference to its result.
    fn operation(&mut self, kind: &str, inputs: &[(&str, &str)]) -> String {
        let name = self.name();
        *self.text += &format!("<i:{kind} identifier=\"{name}\" displayname=\"{name}\"><i:in>");
        for (input, reference) in inputs {
            *self.text += &format!(
                "<i:scalarref identifier=\"{input}\" displayname=\"{input}\" ref=\"{reference}\"/>"
            );
        }
        *self.text += &format!(
            "</i:in><i:out><i:scalar identifier=\"result\" displayname=\"result\"/></i:out>\
             </i:{kind}>\n"
        );
        format!("{name}.result")
    }

    /// Writes a node, and returns the reference to its value.
    fn node(&mut self, id: ScalarId, references: &[String]) -> io::Result<String> {
        let of = |id: ScalarId| references[id.at()].as_str();
        Ok(match *self.graph.node(id) {
            ScalarNode::Constant(bits) => self.constant(f64::from_bits(bits))?,
            ScalarNode::Coordinate(i) => format!("point.{}", ["x", "y", "z"][i]),
            ScalarNode::Unary(F::Trunc, u) => {
                let size = self.operation("abs", &[("A", of(u))]);
                let floor = self.operation("floor", &[("A", &size)]);
                let sign = self.operation("sign", &[("A", of(u))]);
                self.operation("multiplication", &[("A", &sign), ("B", &floor)])
            }
            ScalarNode::Unary(f, u) => self.operation(function_kind(f), &[("A", of(u))]),
            ScalarNode::Binary(f, u, v) => {
                self.operation(operation_kind(f), &[("A", of(u)), ("B", of(v))])
            }
            ScalarNode::Choice([a, b, c, d]) => {
                let all = [("A", of(a)), ("B", of(b)), ("C", of(c)), ("D", of(d))];
                self.operation("select", &all)
            }
        })
    }
}

/// Returns the node of a function. Inverse trigonometric functions have the names that lib3mf and
/// programs built with it read and write, which are shorter than those of the specification.
fn function_kind(f: F) -> &'static str {
    match f {
        F::Abs => "abs",
        F::Sqrt => "sqrt",
        F::Exp => "exp",
        F::Ln => "log",
        F::Sin => "sin",
        F::Cos => "cos",
        F::Tan => "tan",
        F::Asin => "asin",
        F::Acos => "acos",
        F::Atan => "atan",
        F::Sinh => "sinh",
        F::Cosh => "cosh",
        F::Tanh => "tanh",
        F::Floor => "floor",
        F::Ceil => "ceil",
        F::Sign => "sign",
        F::Trunc => unreachable!("composed of others"),
    }
}

/// Returns the node of an operation.
fn operation_kind(f: O) -> &'static str {
    match f {
        O::Add => "addition",
        O::Sub => "subtraction",
        O::Mul => "multiplication",
        O::Div => "division",
        O::Pow => "pow",
        O::Atan2 => "atan2",
        O::Min => "min",
        O::Max => "max",
    }
}
