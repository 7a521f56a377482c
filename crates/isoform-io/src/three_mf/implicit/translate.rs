//! Translation of implicit functions into scalar expressions: references are followed from the
//! output that is wanted, and calls are replaced by what they compute. A function that is called
//! again with equal arguments is translated once.

use super::graph::{ScalarGraph, ScalarId};
use super::nodes::{
    ComponentOperation, PortValue, cross, image, inverse, length, matrix_of, transposed,
};
use super::{Obstacle, variable_name};
use crate::ErrorKind;
use crate::input::{parse_number, shorten};
use crate::three_mf::functions::{FunctionNode, ModelFunction, Port, PortType};
use crate::three_mf::model::ModelPart;
use crate::xml::attribute;
use std::collections::{BTreeSet, HashMap, HashSet};

/// Maximum nesting depth of calls: each level takes stack, and people nest some ten.
const MAX_CALL_DEPTH: usize = 64;
/// Maximum number of nodes that are translated, copies by calls included: some 150 MB and a second.
/// Sharing does not help calls that are nested with new arguments, which double the work with every
/// level.
const MAX_TRANSLATED_NODES: usize = 500_000;
/// Name of the inputs of a function in references.
const INPUTS: &str = "inputs";
/// Input of a call that holds the number of the function.
const FUNCTION_INPUT: &str = "functionID";

/// Output of a node: places of the node and of the output in their lists.
type OutputPlace = (u32, u32);

/// Meaning of a reference.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Input of the function, by its place in the list.
    Input(usize),
    Output(OutputPlace),
}

/// A function with the values of its inputs.
#[derive(Debug)]
struct Instance<'m> {
    id: u32,
    function: &'m ModelFunction,
    inputs: Vec<PortValue>,
    /// Values of outputs of nodes that are known.
    values: HashMap<OutputPlace, PortValue>,
}

/// Translator of the functions of a model part.
pub(super) struct Translator<'m> {
    model: &'m ModelPart,
    pub(super) graph: ScalarGraph,
    instances: Vec<Instance<'m>>,
    /// Places of the instances by function and inputs.
    known: HashMap<(u32, Vec<PortValue>), usize>,
    /// Inputs and outputs by the names of node and output, by function.
    places: HashMap<u32, HashMap<(&'m str, &'m str), Place>>,
    /// Numbers of the functions whose calls are open, from outside to inside.
    open: Vec<u32>,
    /// Number of nodes that were translated.
    count: usize,
    pub(super) warnings: BTreeSet<&'static str>,
    /// Beginnings of names for variables.
    pub(super) names: HashMap<ScalarId, String>,
}

/// Warning of the operation whose meaning the specification leaves open.
const SIDE_OF_VECTORS: &str = "a product of a matrix and a vector is taken as (x y z 1) M, like \
    all transforms of 3MF; the specification leaves the side of the vector open";

impl<'m> Translator<'m> {
    pub(super) fn new(model: &'m ModelPart) -> Self {
        Self {
            model,
            graph: ScalarGraph::new(),
            instances: Vec::new(),
            known: HashMap::new(),
            places: HashMap::new(),
            open: Vec::new(),
            count: 0,
            warnings: BTreeSet::new(),
            names: HashMap::new(),
        }
    }

    /// Returns the scalar output `channel` of a function of the point alone.
    pub(super) fn level(
        &mut self,
        id: u32,
        channel: &str,
        point: [ScalarId; 3],
    ) -> Result<ScalarId, Obstacle> {
        let point = PortValue::Vector(point);
        let function = self.function(id)?;
        let mut inputs = Vec::new();
        for port in &function.inputs {
            if &*port.name != "pos" {
                let why = format!(
                    "{} has the input {} besides pos, which a level set does not give",
                    title(id, function),
                    port.name
                );
                return Err(Obstacle::corrupt(why));
            }
            inputs.push(typed(point, port).map_err(|why| self.within(id, &why))?);
        }
        let value = self.output(id, inputs, channel)?;
        match value {
            PortValue::Scalar(level) => Ok(level),
            _ => Err(self.within(
                id,
                &format!(
                    "output {channel} is {}, and a level set needs a scalar",
                    value.type_of().noun()
                ),
            )),
        }
    }

    /// Returns a function that can be translated.
    fn function(&self, id: u32) -> Result<&'m ModelFunction, Obstacle> {
        let Some(function) = self.model.functions.get(&id) else {
            let why = format!("there is no function {id}");
            return Err(Obstacle::new(ErrorKind::Index, why));
        };
        if !function.foreign.is_empty() {
            let why = format!(
                "{} is a {}: its values are not formulas",
                title(id, function),
                function.foreign
            );
            return Err(Obstacle::unsupported(why));
        }
        Ok(function)
    }

    /// Returns the output of a function for some inputs.
    fn output(
        &mut self,
        id: u32,
        inputs: Vec<PortValue>,
        name: &str,
    ) -> Result<PortValue, Obstacle> {
        let function = self.function(id)?;
        if self.open.contains(&id) {
            let path: Vec<String> = self.open.iter().map(u32::to_string).collect();
            let why = format!(
                "functions call one another in a circle: {}",
                path.join(", ")
            );
            return Err(Obstacle::corrupt(why));
        }
        if self.open.len() >= MAX_CALL_DEPTH {
            let why = format!("calls of functions are more than {MAX_CALL_DEPTH} levels deep");
            return Err(Obstacle::new(ErrorKind::TooLarge, why));
        }
        let Some(output) = function.outputs.iter().find(|o| &*o.name == name) else {
            return Err(self.within(id, &format!("there is no output {name}")));
        };
        let key = (id, inputs);
        let instance = match self.known.get(&key) {
            Some(&instance) => instance,
            None => {
                self.instances.push(Instance {
                    id,
                    function,
                    inputs: key.1.clone(),
                    values: HashMap::new(),
                });
                self.known.insert(key, self.instances.len() - 1);
                self.instances.len() - 1
            }
        };
        self.open.push(id);
        let value = self.resolved(instance, output);
        self.open.pop();
        value
    }

    /// Returns the failure of a function, or of a node of it.
    fn within(&self, id: u32, why: &str) -> Obstacle {
        match self.model.functions.get(&id) {
            Some(function) => Obstacle::corrupt(format!("{}: {why}", title(id, function))),
            None => Obstacle::corrupt(why.to_owned()),
        }
    }

    /// Returns what the references in a function may mean.
    fn places(&self, id: u32) -> Result<HashMap<(&'m str, &'m str), Place>, Obstacle> {
        let function = self.function(id)?;
        let mut places = HashMap::new();
        for (at, input) in function.inputs.iter().enumerate() {
            places.insert((INPUTS, &*input.name), Place::Input(at));
        }
        for (at, node) in function.nodes.iter().enumerate() {
            for (output_at, output) in node.outputs.iter().enumerate() {
                let place = Place::Output((at as u32, output_at as u32));
                if places.insert((&*node.name, &*output.name), place).is_some() {
                    let (node, output) = (shorten(&node.name), shorten(&output.name));
                    let why = format!("there are two outputs {output} of nodes called {node}");
                    return Err(self.within(id, &why));
                }
            }
        }
        Ok(places)
    }

    /// Returns what a port refers to.
    fn place(&mut self, instance: usize, port: &Port) -> Result<Place, Obstacle> {
        let id = self.instances[instance].id;
        if !self.places.contains_key(&id) {
            let places = self.places(id)?;
            self.places.insert(id, places);
        }
        let reference = &*port.reference;
        let found = reference.split_once('.');
        found
            .and_then(|names| self.places[&id].get(&names).copied())
            .ok_or_else(|| {
                let why = match reference {
                    "" => format!("{} is not connected", shorten(&port.name)),
                    _ => format!(
                        "{} refers to {}, which is not there",
                        shorten(&port.name),
                        shorten(reference)
                    ),
                };
                self.within(id, &why)
            })
    }

    /// Returns the value of a port if all is known that it needs, else the output that is missing.
    fn known_value(
        &mut self,
        instance: usize,
        port: &Port,
    ) -> Result<Result<PortValue, OutputPlace>, Obstacle> {
        let place = self.place(instance, port)?;
        let here = &self.instances[instance];
        let value = match place {
            Place::Input(input) => here.inputs[input],
            Place::Output(place) => match here.values.get(&place) {
                Some(value) => *value,
                None => return Ok(Err(place)),
            },
        };
        let id = here.id;
        let typed = typed(value, port).map_err(|why| self.within(id, &why))?;
        Ok(Ok(typed))
    }

    /// Returns the value of a port of an instance. Chains of nodes may be as long as the file, so
    /// that the nodes to be done are in a list.
    fn resolved(&mut self, instance: usize, port: &Port) -> Result<PortValue, Obstacle> {
        let first = match self.known_value(instance, port)? {
            Ok(value) => return Ok(value),
            Err(place) => place,
        };
        let function = self.instances[instance].function;
        let (mut stack, mut open) = (vec![first], HashSet::new());
        while let Some(&place) = stack.last() {
            if self.instances[instance].values.contains_key(&place) {
                stack.pop();
                continue;
            }
            let node = &function.nodes[place.0 as usize];
            let mut missing = Vec::new();
            let mut values = Vec::new();
            // Constants of some writers have inputs that are connected to nothing.
            let inputs = node.inputs.iter().filter(|_| !is_constant(&node.kind));
            for input in inputs {
                match self.known_value(instance, input)? {
                    Ok(value) => values.push((&*input.name, value)),
                    Err(place) => missing.push(place),
                }
            }
            if missing.is_empty() {
                let value = self.evaluated(instance, node, &values, place.1)?;
                self.instances[instance].values.insert(place, value);
                stack.pop();
                continue;
            }
            if !open.insert(place) {
                let why = format!("node {} depends on itself", shorten(&node.name));
                let id = self.instances[instance].id;
                return Err(self.within(id, &why));
            }
            stack.extend(missing);
        }
        self.known_value(instance, port)?
            .map_err(|_| Obstacle::corrupt("an output has no value".to_owned()))
    }

    /// Returns the value of an output of a node from the values of its inputs.
    fn evaluated(
        &mut self,
        instance: usize,
        node: &'m FunctionNode,
        inputs: &[(&str, PortValue)],
        output: u32,
    ) -> Result<PortValue, Obstacle> {
        self.count += 1;
        if self.count > MAX_TRANSLATED_NODES || self.graph.is_full() {
            let why = format!(
                "its functions come to more than {MAX_TRANSLATED_NODES} nodes when calls are \
                 replaced by what they compute"
            );
            return Err(Obstacle::new(ErrorKind::TooLarge, why));
        }
        let port = &node.outputs[output as usize];
        let id = self.instances[instance].id;
        let value = match &*node.kind {
            "functioncall" => self.called(id, node, inputs, port)?,
            _ => self
                .native(node, inputs, &port.name)
                .map_err(|why| match why.kind {
                    ErrorKind::Corrupt => self.of_node(id, node, &why),
                    _ => why,
                })?,
        };
        if value.type_of() != port.of_type {
            let why = format!(
                "output {} is called {}, and is {}",
                port.name,
                port.of_type.noun(),
                value.type_of().noun()
            );
            return Err(self.of_node(id, node, &Obstacle::corrupt(why)));
        }
        Ok(value)
    }

    /// Returns the failure of a node with its place.
    fn of_node(&self, id: u32, node: &FunctionNode, obstacle: &Obstacle) -> Obstacle {
        let name = shorten(&node.name);
        let why = format!("node {name} ({}): {}", shorten(&node.kind), obstacle.why);
        Obstacle {
            why: self.within(id, &why).why,
            ..*obstacle
        }
    }

    /// Returns the output of a function that a node calls.
    fn called(
        &mut self,
        id: u32,
        node: &FunctionNode,
        given: &[(&str, PortValue)],
        port: &Port,
    ) -> Result<PortValue, Obstacle> {
        let wrong = |this: &Self, why: String| this.of_node(id, node, &Obstacle::corrupt(why));
        let callee = match find(given, FUNCTION_INPUT) {
            Some(PortValue::Resource(callee)) => callee,
            _ => return Err(wrong(self, "no function is stated".to_owned())),
        };
        let function = self.function(callee)?;
        let mut inputs = Vec::with_capacity(function.inputs.len());
        let given: HashMap<&str, PortValue> = given.iter().copied().collect();
        for input in &function.inputs {
            let Some(&value) = given.get(&*input.name) else {
                let why = format!(
                    "input {} of {} is not given",
                    input.name,
                    title(callee, function)
                );
                return Err(wrong(self, why));
            };
            inputs.push(typed(value, input).map_err(|why| wrong(self, why))?);
        }
        let value = self.output(callee, inputs, &port.name)?;
        if let PortValue::Scalar(id) = value {
            let name = [&function.title, &node.title, &node.name];
            let name = name.into_iter().find(|n| !n.is_empty());
            let name = variable_name(name.map_or("t", |n| n));
            self.names.entry(id).or_insert(name);
        }
        Ok(value)
    }

    /// Returns the value of an output of a native node.
    fn native(
        &mut self,
        node: &FunctionNode,
        given: &[(&str, PortValue)],
        output: &str,
    ) -> Result<PortValue, Obstacle> {
        let kind = &*node.kind;
        if is_constant(kind) {
            return self.constant(kind, &node.attributes);
        }
        if let Some((operation, names)) = ComponentOperation::of_kind(kind) {
            let values = all(given, names)?;
            let first = values[0].type_of();
            let differs = |v: &PortValue| v.type_of() != first || first == PortType::Resource;
            if values.iter().any(differs) {
                let types: Vec<&str> = values.iter().map(|v| v.type_of().noun()).collect();
                let why = format!("its inputs are {}", types.join(" and "));
                return Err(Obstacle::corrupt(why));
            }
            return Ok(operation.of_values(&mut self.graph, &values));
        }
        if let Some(value) = composed(&mut self.graph, kind, given, output)? {
            return Ok(value);
        }
        let graph = &mut self.graph;
        Ok(match kind {
            "dot" => {
                let [u, v] = vectors(given, ["A", "B"])?;
                PortValue::Scalar(graph.dot(&u, &v))
            }
            "cross" => {
                let [u, v] = vectors(given, ["A", "B"])?;
                cross(graph, u, v)
            }
            "length" => {
                let [u] = vectors(given, ["A"])?;
                length(graph, u)
            }
            "transpose" => transposed(matrix(given)?),
            "inverse" => inverse(graph, matrix(given)?),
            "matvecmultiplication" | "matrixvectormultiplication" => {
                let [v] = vectors(given, ["B"])?;
                self.warnings.insert(SIDE_OF_VECTORS);
                image(&mut self.graph, matrix(given)?, v)
            }
            _ => return Err(unknown(node)),
        })
    }

    /// Returns the value of a constant.
    fn constant(&mut self, kind: &str, attributes: &str) -> Result<PortValue, Obstacle> {
        let number = |key: &str| {
            let text = attribute(attributes, key).unwrap_or("");
            finite(text).ok_or_else(|| {
                Obstacle::corrupt(format!("{key}=\"{}\" is no finite number", shorten(text)))
            })
        };
        Ok(match kind {
            "constant" => PortValue::Scalar(self.graph.constant(number("value")?)),
            "constvec" => {
                let parts = [number("x")?, number("y")?, number("z")?];
                PortValue::Vector(parts.map(|c| self.graph.constant(c)))
            }
            "constmat" => {
                let text = attribute(attributes, "matrix").unwrap_or("");
                let numbers: Option<Vec<f64>> = text.split_ascii_whitespace().map(finite).collect();
                let found: Option<[f64; 16]> = numbers.and_then(|n| n.try_into().ok());
                let parts = found.ok_or_else(|| {
                    let why = format!("\"{}\" is no matrix of 16 numbers", shorten(text));
                    Obstacle::corrupt(why)
                })?;
                PortValue::Matrix(parts.map(|c| self.graph.constant(c)))
            }
            _ => {
                let text = attribute(attributes, "value")
                    .or_else(|| attribute(attributes, "resourceid"))
                    .unwrap_or("");
                let id = text.trim().parse().map_err(|_| {
                    let why = format!("\"{}\" is not the number of a resource", shorten(text));
                    Obstacle::corrupt(why)
                })?;
                PortValue::Resource(id)
            }
        })
    }
}

/// Returns the value of a node that composes or decomposes vectors and matrices; `None` for other
/// nodes.
fn composed(
    graph: &mut ScalarGraph,
    kind: &str,
    given: &[(&str, PortValue)],
    output: &str,
) -> Result<Option<PortValue>, Obstacle> {
    Ok(Some(match kind {
        "composevector" => {
            let parts = scalars(given, ["x", "y", "z"])?;
            PortValue::Vector(parts)
        }
        "vectorfromscalar" => {
            let [u] = scalars(given, ["A"])?;
            PortValue::Vector([u; 3])
        }
        "decomposevector" => {
            let [u] = vectors(given, ["A"])?;
            let at = ["x", "y", "z"].iter().position(|name| *name == output);
            let why = || Obstacle::corrupt(format!("{output} is none of x, y and z"));
            PortValue::Scalar(u[at.ok_or_else(why)?])
        }
        "composematrix" => {
            let names: [String; 16] = std::array::from_fn(|k| format!("m{}{}", k / 4, k % 4));
            PortValue::Matrix(scalars(given, std::array::from_fn(|k| names[k].as_str()))?)
        }
        "matrixfromrows" | "matrixfromcolumns" => {
            let given = vectors(given, ["A", "B", "C", "D"])?;
            matrix_of(graph, given, kind == "matrixfromrows")
        }
        _ => return Ok(None),
    }))
}

/// Returns the obstacle of a node that is not translated.
fn unknown(node: &FunctionNode) -> Obstacle {
    let name = shorten(&node.name);
    match &*node.kind {
        kind @ ("mesh" | "unsignedmesh" | "beamlattice") => Obstacle::new(
            ErrorKind::UnsupportedFormat,
            format!("node {name} computes the distance to a mesh ({kind}), which is no formula"),
        ),
        kind => {
            let kind = shorten(kind);
            Obstacle::unsupported(format!("node {name} is a {kind}, which is not known"))
        }
    }
}

/// Returns true for the nodes without inputs.
fn is_constant(kind: &str) -> bool {
    matches!(
        kind,
        "constant" | "constvec" | "constmat" | "constresourceid"
    )
}

/// Returns the name of a function, for messages.
fn title(id: u32, function: &ModelFunction) -> String {
    match &*function.title {
        "" => format!("function {id}"),
        title => format!("function {id} ({})", shorten(title)),
    }
}

/// Parses a finite number.
fn finite(text: &str) -> Option<f64> {
    parse_number(text.trim()).filter(|v| v.is_finite())
}

/// Returns a value for a port; the reason if it is of another type.
fn typed(value: PortValue, port: &Port) -> Result<PortValue, String> {
    if value.type_of() == port.of_type {
        return Ok(value);
    }
    Err(format!(
        "{} is {}, and is connected to {}",
        port.name,
        port.of_type.noun(),
        value.type_of().noun()
    ))
}

/// Returns the value of an input.
fn find(given: &[(&str, PortValue)], name: &str) -> Option<PortValue> {
    let found = given.iter().find(|(key, _)| *key == name);
    found.map(|(_, value)| *value)
}

/// Returns the values of inputs.
fn all(given: &[(&str, PortValue)], names: &[&str]) -> Result<Vec<PortValue>, Obstacle> {
    let value = |name: &&str| {
        let missing = || Obstacle::corrupt(format!("there is no input {name}"));
        find(given, name).ok_or_else(missing)
    };
    names.iter().map(value).collect()
}

/// Returns the values of inputs that are scalars.
fn scalars<const N: usize>(
    given: &[(&str, PortValue)],
    names: [&str; N],
) -> Result<[ScalarId; N], Obstacle> {
    let values = all(given, &names)?;
    let mut found = Vec::with_capacity(N);
    for (name, value) in names.iter().zip(values) {
        match value {
            PortValue::Scalar(u) => found.push(u),
            other => return Err(not_of(name, "a scalar", other)),
        }
    }
    found
        .try_into()
        .map_err(|_| Obstacle::corrupt("an input is missing".to_owned()))
}

/// Returns the values of inputs that are vectors.
fn vectors<const N: usize>(
    given: &[(&str, PortValue)],
    names: [&str; N],
) -> Result<[[ScalarId; 3]; N], Obstacle> {
    let values = all(given, &names)?;
    let mut found = Vec::with_capacity(N);
    for (name, value) in names.iter().zip(values) {
        match value {
            PortValue::Vector(u) => found.push(u),
            other => return Err(not_of(name, "a vector", other)),
        }
    }
    found
        .try_into()
        .map_err(|_| Obstacle::corrupt("an input is missing".to_owned()))
}

/// Returns the input A, which is a matrix.
fn matrix(given: &[(&str, PortValue)]) -> Result<[ScalarId; 16], Obstacle> {
    match all(given, &["A"])?[0] {
        PortValue::Matrix(u) => Ok(u),
        other => Err(not_of("A", "a matrix", other)),
    }
}

fn not_of(name: &str, wanted: &str, value: PortValue) -> Obstacle {
    let found = value.type_of().noun();
    Obstacle::corrupt(format!("input {name} is {found}, not {wanted}"))
}
