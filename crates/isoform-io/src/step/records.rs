//! Arguments of records, with messages that name the instance.

use super::parse::{Record, Value};
use crate::solids::{SolidFileError, wrong};
use isoform_geom::Point3;
use std::collections::BTreeMap;

type Result<T> = std::result::Result<T, SolidFileError>;

/// Map from instance numbers to indices.
pub(super) type InstanceIndices = BTreeMap<u64, u32>;

/// Arguments of a record of an instance.
#[derive(Clone, Copy)]
pub(super) struct RecordArguments<'f> {
    pub(super) number: u64,
    /// Line of the instance, from 1; `None` in messages that do without.
    pub(super) line: Option<usize>,
    pub(super) record: &'f Record,
}

impl<'f> RecordArguments<'f> {
    pub(super) fn wrong(&self, problem: &str) -> SolidFileError {
        let line = self.line.map_or(String::new(), |n| format!(" (line {n})"));
        let Self { number, record, .. } = self;
        wrong(format!("#{number} {}{line}", record.name), problem)
    }
    /// Converts an argument by `as_it`; an error states the expected kind if the conversion fails.
    pub(super) fn read<T>(
        &self,
        k: usize,
        expected: &str,
        as_it: impl FnOnce(&'f Value) -> Option<T>,
    ) -> Result<T> {
        let value = self.record.arguments.get(k).and_then(as_it);
        value.ok_or_else(|| self.wrong(&format!("argument {}: {expected}", k + 1)))
    }
    pub(super) fn reference(&self, k: usize) -> Result<u64> {
        self.read(k, "a reference is expected", reference)
    }
    pub(super) fn references(&self, k: usize) -> Result<Vec<u64>> {
        let references = |v: &'f Value| list(v)?.iter().map(reference).collect();
        self.read(k, "references are expected", references)
    }
    /// Returns the index of the instance referred to by an argument.
    pub(super) fn indexed(&self, k: usize, indices: &InstanceIndices) -> Result<u32> {
        let index = |v: &'f Value| indices.get(&reference(v)?).copied();
        self.read(
            k,
            "a reference to another kind of instance is expected",
            index,
        )
    }
    pub(super) fn number(&self, k: usize) -> Result<f64> {
        self.read(k, "a number is expected", number)
    }
    /// Returns a positive number.
    pub(super) fn radius(&self, k: usize) -> Result<f64> {
        let radius = self.number(k)?;
        if radius > 0.0 {
            return Ok(radius);
        }
        Err(self.wrong("its radius must be positive"))
    }
    pub(super) fn numbers(&self, k: usize) -> Result<Vec<f64>> {
        self.read(k, "numbers are expected", numbers)
    }
    pub(super) fn whole(&self, k: usize) -> Result<usize> {
        self.read(k, "a whole number is expected", whole)
    }
    pub(super) fn wholes(&self, k: usize) -> Result<Vec<usize>> {
        let wholes = |v: &'f Value| list(v)?.iter().map(whole).collect();
        self.read(k, "whole numbers are expected", wholes)
    }
    pub(super) fn point(&self, k: usize) -> Result<Point3> {
        let numbers = self.numbers(k)?;
        let point = numbers.try_into();
        point.map_err(|_| self.wrong("three numbers are expected"))
    }
    pub(super) fn text(&self, k: usize) -> Result<&'f str> {
        self.read(k, "a text is expected", |v| match v {
            Value::Text(text) => Some(text.as_str()),
            _ => None,
        })
    }
    pub(super) fn flag(&self, k: usize) -> Result<bool> {
        self.read(k, ".T. or .F. is expected", |v| match v {
            Value::Word(word) if word == "T" => Some(true),
            Value::Word(word) if word == "F" => Some(false),
            _ => None,
        })
    }
    pub(super) fn list(&self, k: usize) -> Result<&'f [Value]> {
        self.read(k, "a list is expected", list)
    }
    /// Returns the number of a typed argument.
    pub(super) fn measure(&self, k: usize) -> Result<f64> {
        self.read(k, "a measure is expected", |v| match v {
            Value::Typed(record) => record.arguments.first().and_then(number),
            // Some programs write the number alone.
            Value::Number(number) => Some(*number),
            _ => None,
        })
    }
}

pub(super) fn list(value: &Value) -> Option<&[Value]> {
    match value {
        Value::List(list) => Some(list),
        _ => None,
    }
}

pub(super) fn reference(value: &Value) -> Option<u64> {
    match value {
        Value::Reference(number) => Some(*number),
        _ => None,
    }
}

pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => Some(*number),
        _ => None,
    }
}

pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    list(value)?.iter().map(number).collect()
}

/// Converts a number to a count; `None` unless it is an integer from 0 to 2³².
fn whole(value: &Value) -> Option<usize> {
    let number = number(value)?;
    let is_count = number.fract() == 0.0 && (0.0..=4_294_967_296.0).contains(&number);
    is_count.then_some(number as usize)
}
