//! Text of a CAD program.

use super::tree::{CadSolid, SolidTranslator, Vector};
use super::{CadDialect, CadOptions};
use isoform_field::hyperfun::{Model, ParamInfo};
use isoform_field::{Binary, Graph, Node, NodeId, Unary};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Half the size of the boxes that represent half spaces, in diagonals of the part.
const HALF_SPACE_DIAGONALS: f64 = 10.0;

/// Operations of each dialect, with equal names and meanings.
const BUILD123D: &str = include_str!("build123d.py");
const CADQUERY: &str = include_str!("cadquery.py");
const OPENSCAD: &str = include_str!("openscad.scad");

/// Names that the programs define, and keywords of the languages.
const RESERVED_NAMES: &str = "and as assert async await bd break class continue cq def del elif else except \
    finally for from global if import in is lambda nonlocal not or pass raise return try while \
    with yield part far sys one half_space block rod ball ring cones union common cut along each \
    difference intersection module function let echo true false undef pi e";

/// Writer of a program.
pub(super) struct ProgramWriter<'a> {
    graph: &'a Graph,
    model: &'a Model,
    values: &'a [f64],
    dialect: CadDialect,
    /// Names of the parameters, and of the statements.
    parameters: Vec<String>,
    names: Vec<String>,
    statements: &'a [(String, CadSolid)],
}

impl<'a> ProgramWriter<'a> {
    pub(super) fn new(
        translator: &'a SolidTranslator<'_>,
        model: &'a Model,
        values: &'a [f64],
        dialect: CadDialect,
    ) -> Self {
        let mut taken: BTreeSet<String> = RESERVED_NAMES
            .split_whitespace()
            .map(str::to_owned)
            .collect();
        let mut free = |wanted: &str| {
            let plain: String = wanted
                .chars()
                .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
                .collect();
            let plain = plain.trim_matches('_').to_owned();
            let plain = match plain.chars().next() {
                Some(c) if c.is_ascii_alphabetic() => plain,
                _ => format!("part_{plain}"),
            };
            let numbered = (2..).map(|k| format!("{plain}_{k}"));
            let name = std::iter::once(plain.clone())
                .chain(numbered)
                .find(|name| !taken.contains(name))
                .expect("there are more numbers than names");
            taken.insert(name.clone());
            name
        };
        let parameters = model.params().iter().map(|p| free(&p.name)).collect();
        let statements = &translator.statements;
        Self {
            graph: &translator.graph,
            model,
            values,
            dialect,
            parameters,
            names: statements.iter().map(|(name, _)| free(name)).collect(),
            statements,
        }
    }

    /// Returns the complete program.
    pub(super) fn program(&self, result: &CadSolid, options: &CadOptions) -> String {
        let comment = if self.is_python() { "#" } else { "//" };
        let end = if self.is_python() { "" } else { ";" };
        let mut text = String::new();
        let title: String = options.title.chars().filter(|c| !c.is_control()).collect();
        let unit = options
            .unit
            .as_ref()
            .map_or(String::new(), |unit| format!(" Lengths are in {unit}."));
        let _ = writeln!(text, "{comment} {title}{unit}");
        if self.is_python() {
            text += self.operations();
            text.push('\n');
        }
        let _ = writeln!(text, "\n{comment} Dimensions, with their 95 % intervals.");
        for (name, value, about) in self.dimensions(options) {
            let about = match about.is_empty() {
                true => String::new(),
                false => format!("  {comment} {about}"),
            };
            let _ = writeln!(text, "{name} = {value}{end}{about}");
        }
        let far = HALF_SPACE_DIAGONALS * options.diagonal;
        let _ = writeln!(
            text,
            "far = {far:?}{end}  {comment} Longer than the part.\n"
        );
        if !self.is_python() {
            text += self.operations();
            text.push('\n');
        }
        for (name, (_, solid)) in self.names.iter().zip(self.statements) {
            text += &self.statement(name, solid);
        }
        text += &self.statement("part", result);
        text += match self.dialect {
            CadDialect::Build123d => {
                "\nif __name__ == \"__main__\":\n    print(\"volume\", part.volume)\n    \
                 if len(sys.argv) > 1:\n        bd.export_step(part, sys.argv[1])\n"
            }
            CadDialect::CadQuery => {
                "\nif __name__ == \"__main__\":\n    print(\"volume\", part.Volume())\n    \
                 if len(sys.argv) > 1:\n        part.exportStep(sys.argv[1])\n"
            }
            CadDialect::OpenScad => "part();\n",
        };
        text
    }

    fn is_python(&self) -> bool {
        self.dialect != CadDialect::OpenScad
    }

    fn operations(&self) -> &'static str {
        match self.dialect {
            CadDialect::Build123d => BUILD123D,
            CadDialect::CadQuery => CADQUERY,
            CadDialect::OpenScad => OPENSCAD,
        }
    }

    /// Returns the names, values and comments of the parameters, each after those to which it is
    /// tied.
    fn dimensions(&self, options: &CadOptions) -> Vec<(&str, String, String)> {
        let infos = self.model.params();
        let mut open: Vec<&ParamInfo> = infos.iter().collect();
        let mut done = vec![false; infos.len()];
        let mut lines = Vec::new();
        while !open.is_empty() {
            let is_ready = |p: &&ParamInfo| {
                let tie = p.tie.as_ref();
                tie.is_none_or(|tie| tie.terms.iter().all(|(k, _)| done[*k]))
            };
            let (ready, rest): (Vec<_>, Vec<_>) = open.into_iter().partition(is_ready);
            if ready.is_empty() {
                break;
            }
            for p in ready {
                done[p.index] = true;
                let interval = options.intervals.get(p.index).copied().flatten();
                let interval = interval.filter(|_| p.tie.is_none());
                let interval = interval.map(|(low, high)| format!("{low:?} to {high:?}"));
                let about: String = p.description.chars().filter(|c| !c.is_control()).collect();
                let about = interval
                    .into_iter()
                    .chain((!about.is_empty()).then_some(about));
                let value = match &p.tie {
                    Some(tie) => {
                        let terms = tie.terms.iter();
                        let terms = terms.map(|(k, by)| (*by, self.parameters[*k].clone()));
                        sum(tie.constant, terms)
                    }
                    None => number(self.values[p.index]),
                };
                let about = about.collect::<Vec<_>>().join("; ");
                lines.push((self.parameters[p.index].as_str(), value, about));
            }
            open = rest;
        }
        lines
    }

    fn statement(&self, name: &str, solid: &CadSolid) -> String {
        match self.is_python() {
            true => format!("{name} = {}\n", self.solid(solid)),
            false => format!("module {name}() {{ {} }}\n", self.solid(solid)),
        }
    }

    /// Returns the text of a solid: an expression in Python, a statement in OpenSCAD.
    fn solid(&self, solid: &CadSolid) -> String {
        let made = |operation: &str, arguments: &[String]| {
            let end = if self.is_python() { "" } else { ";" };
            format!("{operation}({}){end}", arguments.join(", "))
        };
        match solid {
            CadSolid::Half(n, d) => made("half_space", &[self.vector(n), self.number(*d)]),
            CadSolid::Block(low, high) => made("block", &[self.vector(low), self.vector(high)]),
            CadSolid::Rod(at, way, radius) => made(
                "rod",
                &[self.vector(at), self.vector(way), self.number(*radius)],
            ),
            CadSolid::Ball(at, radius) => made("ball", &[self.vector(at), self.number(*radius)]),
            CadSolid::Ring(at, way, circle, tube) => {
                let radii = [circle, tube].map(|r| self.number(*r));
                made(
                    "ring",
                    &[&[self.vector(at), self.vector(way)], &radii[..]].concat(),
                )
            }
            CadSolid::Cones(at, way, slope) => made(
                "cones",
                &[self.vector(at), self.vector(way), self.number(*slope)],
            ),
            CadSolid::Union(all) => self.operation(["union", "union"], all.iter()),
            CadSolid::Common(all) => self.operation(["common", "intersection"], all.iter()),
            CadSolid::Cut(first, others) => {
                let all = std::iter::once(first.as_ref()).chain(others);
                self.operation(["cut", "difference"], all)
            }
            CadSolid::Named(k) if self.is_python() => self.names[*k].clone(),
            CadSolid::Named(k) => format!("{}();", self.names[*k]),
        }
    }

    fn operation<'s>(
        &self,
        [python, scad]: [&str; 2],
        solids: impl Iterator<Item = &'s CadSolid>,
    ) -> String {
        let texts: Vec<String> = solids.map(|s| self.solid(s)).collect();
        match self.is_python() {
            true => format!("{python}({})", texts.join(", ")),
            false => format!("{scad}() {{ {} }}", texts.join(" ")),
        }
    }

    fn vector(&self, v: &Vector) -> String {
        let items = v.map(|id| self.number(id)).join(", ");
        match self.is_python() {
            true => format!("({items})"),
            false => format!("[{items}]"),
        }
    }

    /// Returns the text of an expression of the parameters.
    fn number(&self, id: NodeId) -> String {
        let operand = |id: NodeId| match self.graph.node(id) {
            Node::Binary(..) | Node::Unary(Unary::Neg, _) => format!("({})", self.number(id)),
            _ => self.number(id),
        };
        match self.graph.node(id) {
            Node::Constant(bits) => number(f64::from_bits(*bits)),
            Node::Param(k) => self.parameters[*k as usize].clone(),
            Node::Unary(Unary::Neg, a) => format!("-{}", operand(*a)),
            Node::Unary(Unary::Square, a) => format!("{0}*{0}", operand(*a)),
            Node::Unary(op, a) => self.function(*op, &self.number(*a)),
            Node::Binary(op, a, b) => {
                let sign = match op {
                    Binary::Add => "+",
                    Binary::Sub => "-",
                    Binary::Mul => "*",
                    Binary::Div => "/",
                    _ => return self.value(id),
                };
                format!("{} {sign} {}", operand(*a), operand(*b))
            }
            _ => self.value(id),
        }
    }

    /// Returns the text of a function of a number. Angles are in radians, in OpenSCAD in degrees.
    fn function(&self, op: Unary, of: &str) -> String {
        let name = match op {
            Unary::Sqrt => "sqrt",
            Unary::Sin => "sin",
            Unary::Cos => "cos",
            Unary::Tan => "tan",
            Unary::Atan => "atan",
            Unary::Asin => "asin",
            Unary::Acos => "acos",
            Unary::Exp => "exp",
            Unary::Abs if self.is_python() => "fabs",
            Unary::Abs => "abs",
            Unary::Ln if self.is_python() => "log",
            Unary::Ln => "ln",
            _ => "floor",
        };
        match (self.is_python(), op) {
            (false, Unary::Sin | Unary::Cos | Unary::Tan) => format!("{name}(({of})*180/PI)"),
            (false, Unary::Atan | Unary::Asin | Unary::Acos) => format!("({name}({of})*PI/180)"),
            _ => format!("{name}({of})"),
        }
    }

    /// Returns the value of an expression without a text as a number, which does not follow the
    /// parameters.
    fn value(&self, id: NodeId) -> String {
        number(self.graph.eval(id, &[], self.values))
    }
}

/// Returns the text of a number that reads back exactly.
fn number(v: f64) -> String {
    match v {
        0.0 => "0".to_owned(),
        1.0 | -1.0 => format!("{v:.0}"),
        _ => format!("{v:?}"),
    }
}

/// Returns the text of a sum of names with factors.
fn sum(constant: f64, terms: impl Iterator<Item = (f64, String)>) -> String {
    let mut terms: Vec<(f64, String)> = terms.filter(|(by, _)| *by != 0.0).collect();
    terms.sort_by_key(|(by, _)| *by < 0.0);
    let mut text = String::new();
    for (by, name) in terms {
        text += match (text.is_empty(), by < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        if by.abs() != 1.0 {
            let _ = write!(text, "{:?}*", by.abs());
        }
        text += &name;
    }
    match (text.is_empty(), constant == 0.0) {
        (true, _) => number(constant),
        (false, true) => text,
        (false, false) => format!("{text} + {}", number(constant)),
    }
}
