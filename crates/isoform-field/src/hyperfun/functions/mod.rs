//! Function library: one row per function in [`Function::TABLE`], with its names, arguments,
//! implementation and a line of help.
//!
//! Primitives and blends that are single nodes of the expression are in [`crate::Library`]; all
//! others are formulas that any machine runs, so that they can be compiled, too. Array sizes are
//! known, so that loops over elements are unrolled.

mod attributes;
mod convolution;
mod files;
mod maps;
mod math;
mod shapes;
mod table;

use super::ast::Argument;
use super::files::FileTerm;
use super::formula::{E, E3};
use super::machine::Machine;
use super::{Mode, Program};
use crate::direct::Direct;
use crate::library::Library;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::LazyLock;

/// Value that the reference implementation returns for invalid arguments.
pub(crate) const SENTINEL: f64 = -1111111111111.0;

/// Maximum number of arguments of a function.
const MAX_ARGUMENTS: usize = 8;

/// Type of an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ArgumentShape {
    Number,
    /// A point of space: an array of three items.
    Point,
    /// An array with this minimum number of items.
    Array(u32),
    /// An array with this number of items per element; its size determines the number of elements.
    Elements(u32),
    /// An array with this minimum number of items per element.
    Each(u32),
    /// An array of the points of a chain of elements, 3 (elements + 1) items; its size determines
    /// the number of elements.
    Chain,
    /// The name of a file, whose index in the program is the argument.
    File,
}

impl ArgumentShape {
    /// Returns a description of the required array if one of `len` items does not match.
    pub(crate) fn refuses(self, len: u32, elements: u32, mode: Mode) -> Option<String> {
        match self {
            Self::Number | Self::File => None,
            Self::Point => {
                (len != 3 && mode == Mode::Default).then(|| "3 items, a point".to_owned())
            }
            Self::Array(n) => (len < n).then(|| format!("at least {n} items")),
            Self::Elements(k) => {
                (!len.is_multiple_of(k)).then(|| format!("{k} items for each element"))
            }
            Self::Each(k) => {
                let n = u64::from(k) * u64::from(elements);
                (u64::from(len) < n)
                    .then(|| format!("{n} items, {k} for each of {elements} elements"))
            }
            Self::Chain => (len < 6 || !len.is_multiple_of(3))
                .then(|| "3 items for each point, and two points at least".to_owned()),
        }
    }
    /// Returns the type in words.
    fn describe(self) -> String {
        match self {
            Self::Number => "number".to_owned(),
            Self::Point => "point, an array of 3 numbers".to_owned(),
            Self::Array(1) => "array".to_owned(),
            Self::Array(n) => format!("array of {n} numbers"),
            Self::Elements(1) | Self::Each(1) => "array, one number per element".to_owned(),
            Self::Elements(n) | Self::Each(n) => format!("array, {n} numbers per element"),
            Self::Chain => "array, 3 numbers per point".to_owned(),
            Self::File => "text in double quotes".to_owned(),
        }
    }
    /// Returns the number of elements of an array of `len` items, if this type determines it.
    pub(crate) fn elements(self, len: u32) -> Option<u32> {
        match self {
            Self::Elements(k) => Some(len / k),
            Self::Chain => Some((len / 3).saturating_sub(1)),
            _ => None,
        }
    }
}

/// Error of a formula.
pub(crate) struct FormulaError {
    pub(crate) message: String,
    /// True if the program is valid, but an unknown value is required.
    pub(crate) unknown: bool,
}

type Outcome<'c, M> = Result<E<'c, M>, FormulaError>;

/// Implementation of a function.
pub(crate) enum Implementation<M: Machine> {
    Primitive(Library, Sentinel),
    Formula(Formula<M>),
}

/// Formula of a function, for any machine.
pub(crate) type Formula<M> = for<'c> fn(&mut Call<'c, M>) -> Outcome<'c, M>;

/// Condition on flat arguments under which the reference implementation returns its sentinel.
#[derive(Clone, Copy)]
pub(crate) enum Sentinel {
    Never,
    /// One of these arguments is smaller in size than the tolerance.
    Small(&'static [usize]),
    /// One of these arguments is negative.
    Negative(&'static [usize]),
}

impl Sentinel {
    pub(crate) fn apply<M: Machine>(self, m: &mut M, flat: &[M::V], mut v: M::V) -> M::V {
        let (which, limit) = match self {
            Self::Never => return v,
            Self::Small(which) => (which, super::machine::TRUTH_TOLERANCE),
            Self::Negative(which) => (which, 0.0),
        };
        let (limit, sentinel) = (m.constant(limit), m.constant(SENTINEL));
        for &i in which {
            let size = if matches!(self, Self::Small(_)) {
                m.abs(&flat[i])
            } else {
                flat[i].clone()
            };
            let bad = m.less(&size, &limit);
            v = m.select(&bad, &sentinel, &v);
        }
        v
    }
}

/// Row of the library.
pub(crate) struct Function<M: Machine> {
    /// Documented name, followed by synonyms.
    pub(crate) names: &'static [&'static str],
    pub(crate) arguments: &'static [(&'static str, ArgumentShape)],
    pub(crate) run: Implementation<M>,
    /// Index of the argument that is modified in place.
    pub(crate) writes: Option<usize>,
    /// True if an infinite value is admissible, since further arithmetic may make it finite.
    pub(crate) may_overflow: bool,
    /// Description of the value.
    pub(crate) help: &'static str,
    /// Statements of a program that uses the function.
    pub(crate) example: &'static str,
}

static NAMES: LazyLock<HashMap<String, u16>> = LazyLock::new(|| {
    let table = Function::<Direct<f64>>::TABLE;
    let rows = table.iter().enumerate();
    let by_name = rows.filter(|(_, row)| !row.reads_file());
    by_name
        .flat_map(|(i, row)| {
            row.names
                .iter()
                .map(move |n| (n.to_ascii_lowercase(), i as u16))
        })
        .collect()
});

/// Returns the index of the function with a (lower-case) name.
pub(crate) fn find(name: &str) -> Option<u16> {
    NAMES.get(name).copied()
}

/// Returns the index of the function of a file with a (lower-case) name. These names are not
/// reserved: the function is meant where the name of a file follows.
pub(crate) fn find_of_file(name: &str) -> Option<u16> {
    let mut rows = Function::<Direct<f64>>::TABLE.iter();
    let found = rows.position(|row| row.reads_file() && row.names.contains(&name));
    found.map(|i| i as u16)
}

/// Returns the names of all functions, synonyms included.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let rows = Function::<Direct<f64>>::TABLE.iter();
    rows.flat_map(|row| row.names.iter().copied())
}

/// Returns the row of a function, for everything except execution.
pub(crate) fn entry(function: u16) -> &'static Function<Direct<f64>> {
    &Function::<Direct<f64>>::TABLE[function as usize]
}

impl<M: Machine> Function<M> {
    /// Returns the signature, as in `hfSphere(x, center, R)`.
    pub(crate) fn signature(&self) -> String {
        let arguments: Vec<&str> = self.arguments.iter().map(|(name, _)| *name).collect();
        format!("{}({})", self.names[0], arguments.join(", "))
    }
    /// Returns true if an argument is the name of a file.
    pub(crate) fn reads_file(&self) -> bool {
        self.arguments
            .iter()
            .any(|(_, shape)| *shape == ArgumentShape::File)
    }
    /// Returns true if an array argument for a point does not have three items.
    pub(crate) fn has_wrong_point(&self, arguments: &[Argument]) -> bool {
        let is_wrong = |(argument, (_, shape)): (&Argument, &(&str, ArgumentShape))| {
            let Argument::Array(_, array) = argument else {
                return false;
            };
            *shape == ArgumentShape::Point && array.len != 3
        };
        arguments.iter().zip(self.arguments).any(is_wrong)
    }
}

/// Description of a library or mathematical function for users.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FunctionHelp {
    /// All names, in upper or lower case.
    pub names: Vec<&'static str>,
    /// Signature, as in `hfSphere(x, center, R)`.
    pub signature: String,
    /// Title of its section.
    pub section: &'static str,
    /// Name and type of each argument.
    pub arguments: Vec<(&'static str, String)>,
    /// Description of the value.
    pub help: &'static str,
    /// Program whose model uses the function. Its solid lies in the box from -2 to 2.
    pub example: String,
}

/// Lists all functions of the library, in the order of its documentation.
pub fn library() -> Vec<FunctionHelp> {
    let mut section = "";
    let help = |row: &Function<Direct<f64>>| {
        let begun = table::SECTIONS.iter().find(|s| s.1 == row.names[0]);
        section = begun.map_or(section, |s| s.0);
        let arguments = row.arguments.iter();
        FunctionHelp {
            names: row.names.to_vec(),
            signature: row.signature(),
            section,
            arguments: arguments.map(|(n, shape)| (*n, shape.describe())).collect(),
            help: row.help,
            example: example(row.example),
        }
    };
    Function::<Direct<f64>>::TABLE.iter().map(help).collect()
}

/// Returns a program with these statements.
fn example(statements: &str) -> String {
    let words = |c: char| !c.is_ascii_alphanumeric() && c != '_';
    let has_attributes = statements.split(words).any(|word| word == "s");
    let attributes = if has_attributes { ", s[3]" } else { "" };
    let body = statements.replace('\n', "\n  ");
    format!("my_model(x[3], a[1]{attributes}) {{\n  {body}\n}}\n")
}

/// Evaluated arguments: numbers, and positions of arrays in memory (start, length).
pub(crate) struct Arguments<V> {
    pub(crate) numbers: [Option<V>; MAX_ARGUMENTS],
    pub(crate) arrays: [(usize, usize); MAX_ARGUMENTS],
}

impl<V> Default for Arguments<V> {
    fn default() -> Self {
        Self {
            numbers: [const { None }; MAX_ARGUMENTS],
            arrays: [(0, 0); MAX_ARGUMENTS],
        }
    }
}

/// Function call under evaluation. All items of its arrays are set.
pub(crate) struct Call<'c, M: Machine> {
    machine: &'c RefCell<M>,
    memory: &'c mut [Option<M::V>],
    arguments: &'c Arguments<M::V>,
    files: &'c [FileTerm],
    pub(crate) strict: bool,
    /// Number of steps used; `left` is the number available.
    pub(crate) spent: u64,
    left: u64,
}

impl<'c, M: Machine> Call<'c, M> {
    pub(crate) fn new(
        machine: &'c RefCell<M>,
        memory: &'c mut [Option<M::V>],
        arguments: &'c Arguments<M::V>,
        program: &'c Program,
        left: u64,
    ) -> Self {
        Self {
            machine,
            memory,
            arguments,
            files: &program.files,
            strict: program.mode == Mode::Strict,
            spent: 0,
            left,
        }
    }
    /// Returns the constant `v`.
    fn c(&self, v: f64) -> E<'c, M> {
        let v = self.machine.borrow_mut().constant(v);
        E::new(self.machine, v)
    }
    /// Returns argument `i`, a number.
    fn n(&self, i: usize) -> E<'c, M> {
        match &self.arguments.numbers[i] {
            Some(v) => E::new(self.machine, v.clone()),
            None => self.c(f64::NAN),
        }
    }
    /// Returns the file of argument `i`.
    fn file(&self, i: usize) -> &'c FileTerm {
        let index = self.n(i).known().map_or(0, |v| v as usize);
        &self.files[index]
    }
    /// Returns the size of argument `i`, an array.
    fn len(&self, i: usize) -> usize {
        self.arguments.arrays[i].1
    }
    /// Returns item `k` (from 0) of argument `i`.
    fn item(&self, i: usize, k: usize) -> E<'c, M> {
        let (start, len) = self.arguments.arrays[i];
        match &self.memory[start..start + len][k] {
            Some(v) => E::new(self.machine, v.clone()),
            None => self.c(f64::NAN),
        }
    }
    fn put(&mut self, i: usize, k: usize, v: E<'c, M>) {
        let (start, len) = self.arguments.arrays[i];
        self.memory[start..start + len][k] = Some(v.v);
    }
    /// Returns items 3k, 3k + 1, 3k + 2 of argument `i`.
    fn triple(&self, i: usize, k: usize) -> E3<'c, M> {
        std::array::from_fn(|j| self.item(i, 3 * k + j))
    }
    fn point(&self, i: usize) -> E3<'c, M> {
        self.triple(i, 0)
    }
    fn put_point(&mut self, i: usize, p: E3<'c, M>) {
        for (k, v) in p.into_iter().enumerate() {
            self.put(i, k, v);
        }
    }
    /// Returns the value of `v` if run-time errors are detected.
    fn value(&self, v: &E<'c, M>) -> Option<f64> {
        if M::CHECKED { v.known() } else { None }
    }
    fn fail<T>(&self, message: impl Into<String>) -> Result<T, FormulaError> {
        Err(FormulaError {
            message: message.into(),
            unknown: false,
        })
    }
    /// Returns the value of argument `i`, on which the structure of the formula depends.
    fn need(&self, i: usize, what: &str) -> Result<f64, FormulaError> {
        let known = self.n(i).known();
        known.ok_or_else(|| FormulaError {
            message: format!("{what} depends on the point or the parameters"),
            unknown: true,
        })
    }
    /// Counts steps; fails beyond the step limit.
    fn spend(&mut self, steps: u64) -> Result<(), FormulaError> {
        self.spent = self.spent.saturating_add(steps);
        if self.spent > self.left {
            return Err(FormulaError {
                message: "stopped: too many steps".to_owned(),
                unknown: !M::CHECKED,
            });
        }
        Ok(())
    }
    /// Sets an item to `new` where `condition` holds.
    fn put_where(&mut self, condition: &E<'c, M>, i: usize, k: usize, new: &E<'c, M>) {
        let old = self.item(i, k);
        let v = condition.select(new, &old);
        self.put(i, k, v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Imported;
    use crate::hyperfun::Model;
    use isoform_geom::{Field, Point3};
    use isoform_num::{Jet2, Real};
    use std::collections::{BTreeSet, HashSet};
    use std::sync::Arc;

    /// The ball of radius 1.5, for examples with files.
    struct Part;

    impl Field for Part {
        fn value(&self, p: Point3) -> f64 {
            1.5 - isoform_geom::norm(p)
        }
        fn jet(&self, p: Point3) -> Jet2 {
            Jet2::constant(self.value(p))
        }
    }

    #[test]
    fn every_row_is_sound() {
        let mut seen = BTreeSet::new();
        for row in Function::<Direct<f64>>::TABLE {
            assert!(
                !row.help.is_empty()
                    && row.arguments.len() <= MAX_ARGUMENTS
                    && !row.arguments.is_empty()
            );
            for name in row.names {
                assert!(seen.insert(name.to_ascii_lowercase()), "{name} twice");
            }
            if let Implementation::Primitive(library, sentinel) = &row.run {
                let flat: usize = row
                    .arguments
                    .iter()
                    .map(|(_, s)| if *s == ArgumentShape::Number { 1 } else { 3 })
                    .sum();
                assert_eq!(flat, library.arity(), "{:?}", row.names);
                if let Sentinel::Small(which) | Sentinel::Negative(which) = sentinel {
                    assert!(which.iter().all(|&i| (6..flat).contains(&i)));
                }
            }
            if let Some(i) = row.writes {
                assert_ne!(row.arguments[i].1, ArgumentShape::Number);
            }
        }
    }

    /// Every example is a program that changes its sign in the box from -2 to 2, and is negative on
    /// the sides of the box.
    #[test]
    fn examples_are_solids() {
        for function in library() {
            let name = function.names[0];
            let called = function.example.contains(name);
            assert!(called && !function.section.is_empty(), "{name}");
            let mut model = Model::parse(&function.example, Mode::Default).expect(name);
            for file in 0..model.files().len() {
                model.set_file(file, Imported::new("part", Arc::new(Part)), None);
            }
            let at = |i: i32| f64::from(i) / 4.0;
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for (i, j, k) in (0..17 * 17 * 17).map(|n| (n % 17 - 8, n / 17 % 17 - 8, n / 289 - 8)) {
                let value = model
                    .eval(&[at(i), at(j), at(k)], &[0.0], &[0.0; 3])
                    .expect(name)
                    .f;
                let is_side = [i, j, k].iter().any(|v| v.abs() == 8);
                assert!(!is_side || value < 0.0, "{name}: {value} at {i} {j} {k}");
                range = [range[0].min(value), range[1].max(value)];
            }
            assert!(range[0] < 0.0 && range[1] > 0.0, "{name}: {range:?}");
        }
        let sections = library().iter().map(|f| f.section).collect::<HashSet<_>>();
        assert_eq!(sections.len(), table::SECTIONS.len());
    }
}
