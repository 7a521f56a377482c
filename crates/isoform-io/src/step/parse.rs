//! Parser of ISO 10303-21: instances with their arguments.

use crate::solids::{SolidFileError, wrong};
use std::collections::BTreeMap;

/// Maximum depth of nested lists, which bounds the stack. Files of this crate need four.
const MAX_LIST_DEPTH: usize = 16;

/// Argument of a record.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// $ or *: unset, or derived.
    Nothing,
    /// Reference to an instance, such as #12.
    Reference(u64),
    /// Integer or real.
    Number(f64),
    /// Text in quotes.
    Text(String),
    /// Enumeration value without its dots, such as T for .T.
    Word(String),
    /// Arguments in parentheses.
    List(Vec<Self>),
    /// Typed argument, such as `LENGTH_MEASURE(1.)`.
    Typed(Record),
}

/// Keyword with arguments.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record {
    pub(super) name: String,
    pub(super) arguments: Vec<Value>,
}

/// Parsed file: records of the header, and the records of each instance by number.
#[derive(Debug, Default)]
pub(super) struct StepFile {
    pub(super) header: Vec<Record>,
    pub(super) instances: BTreeMap<u64, Vec<Record>>,
    /// Line of each instance, from 1.
    pub(super) lines: BTreeMap<u64, usize>,
}

type Result<T> = std::result::Result<T, SolidFileError>;

/// Parses a file.
pub(super) fn parse(text: &str) -> Result<StepFile> {
    let mut parser = StepParser {
        bytes: text.as_bytes(),
        at: 0,
    };
    let mut file = StepFile::default();
    parser.expect("ISO-10303-21;")?;
    parser.expect("HEADER;")?;
    while !parser.take("ENDSEC;") {
        file.header.push(parser.record(0)?);
        parser.expect(";")?;
    }
    let mut counted = (0, 1);
    loop {
        if parser.take("END-ISO-10303-21") {
            return Ok(file);
        }
        parser.data(&mut file, &mut counted)?;
    }
}

struct StepParser<'t> {
    bytes: &'t [u8],
    at: usize,
}

impl StepParser<'_> {
    /// Parses a section of data; `counted` is a position, and its line.
    fn data(&mut self, file: &mut StepFile, counted: &mut (usize, usize)) -> Result<()> {
        let parser = self;
        parser.section()?;
        while !parser.take("ENDSEC;") {
            parser.peek();
            let start = parser.at;
            let passed = &parser.bytes[counted.0..start];
            counted.1 += passed.iter().filter(|b| **b == b'\n').count();
            counted.0 = start;
            parser.expect("#")?;
            let number = parser.whole()?;
            parser.expect("=")?;
            let records = if parser.peek() == Some(b'(') {
                parser.complex()?
            } else {
                vec![parser.record(0)?]
            };
            parser.expect(";")?;
            file.lines.insert(number, counted.1);
            if file.instances.insert(number, records).is_some() {
                parser.at = start;
                return Err(parser.wrong(&format!("#{number} is there twice")));
            }
        }
        Ok(())
    }

    /// Parses the head of a section of data, which may have arguments.
    fn section(&mut self) -> Result<()> {
        for name in ["ANCHOR;", "REFERENCE;", "SIGNATURE;"] {
            if self.take(name) {
                let name = &name[..name.len() - 1];
                return Err(self.wrong(&format!("sections {name} are not read")));
            }
        }
        if self.take("DATA;") {
            return Ok(());
        }
        if self.take("DATA(") {
            self.list(0)?;
            return self.expect(";");
        }
        Err(self.wrong("`DATA;` is expected"))
    }

    /// Returns an error at the present position, given as line and column from 1.
    fn wrong(&self, problem: &str) -> SolidFileError {
        let before = &self.bytes[..self.at.min(self.bytes.len())];
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        let start = before
            .iter()
            .rposition(|b| *b == b'\n')
            .map_or(0, |i| i + 1);
        let column = before.len() - start + 1;
        wrong(format!("line {line}, column {column}"), problem)
    }
    /// Returns the next byte that is neither a space nor in a comment.
    fn peek(&mut self) -> Option<u8> {
        let is_space = |b: &u8| b.is_ascii_whitespace();
        loop {
            while self.bytes.get(self.at).is_some_and(is_space) {
                self.at += 1;
            }
            if !self.bytes[self.at..].starts_with(b"/*") {
                return self.bytes.get(self.at).copied();
            }
            let mut rest = self.bytes[self.at + 2..].windows(2);
            // A comment without an end holds the rest of the file.
            let length = rest.position(|w| w == b"*/");
            self.at = length.map_or(self.bytes.len(), |n| self.at + n + 4);
        }
    }
    /// Consumes these characters and returns true if they come next.
    fn take(&mut self, what: &str) -> bool {
        self.peek();
        let comes = self.bytes[self.at..].starts_with(what.as_bytes());
        if comes {
            self.at += what.len();
        }
        comes
    }
    fn expect(&mut self, what: &str) -> Result<()> {
        if self.take(what) {
            return Ok(());
        }
        Err(self.wrong(&format!("`{what}` is expected")))
    }
    /// Consumes and returns the longest run of bytes that satisfy a predicate.
    fn run(&mut self, is: impl Fn(u8) -> bool) -> &str {
        let start = self.at;
        while self.bytes.get(self.at).is_some_and(|b| is(*b)) {
            self.at += 1;
        }
        // Predicates accept ASCII only, so the run starts and ends between characters.
        std::str::from_utf8(&self.bytes[start..self.at]).unwrap_or_default()
    }
    fn whole(&mut self) -> Result<u64> {
        let digits = self.run(|b| b.is_ascii_digit()).parse();
        digits.map_err(|_| self.wrong("a whole number is expected"))
    }
    fn word(&mut self) -> Result<String> {
        self.peek();
        let name = self.run(|b| b.is_ascii_alphanumeric() || b"_-!".contains(&b));
        if name.is_empty() {
            return Err(self.wrong("a keyword is expected"));
        }
        Ok(name.to_owned())
    }
    fn record(&mut self, depth: usize) -> Result<Record> {
        let name = self.word()?;
        self.expect("(")?;
        let arguments = self.list(depth)?;
        Ok(Record { name, arguments })
    }
    /// Parses several records in parentheses, without commas.
    fn complex(&mut self) -> Result<Vec<Record>> {
        self.expect("(")?;
        let mut records = Vec::new();
        while !self.take(")") {
            records.push(self.record(0)?);
        }
        Ok(records)
    }
    /// Parses arguments up to the closing parenthesis.
    fn list(&mut self, depth: usize) -> Result<Vec<Value>> {
        if depth > MAX_LIST_DEPTH {
            return Err(self.wrong("too many brackets in one another"));
        }
        let mut values = Vec::new();
        if self.take(")") {
            return Ok(values);
        }
        loop {
            values.push(self.value(depth)?);
            if self.take(")") {
                return Ok(values);
            }
            self.expect(",")?;
        }
    }
    fn value(&mut self, depth: usize) -> Result<Value> {
        match self.peek() {
            Some(b'$' | b'*') => {
                self.at += 1;
                Ok(Value::Nothing)
            }
            Some(b'#') => {
                self.at += 1;
                Ok(Value::Reference(self.whole()?))
            }
            Some(b'(') => {
                self.at += 1;
                Ok(Value::List(self.list(depth + 1)?))
            }
            Some(b'.') => {
                self.at += 1;
                let word = self.word()?;
                self.expect(".")?;
                Ok(Value::Word(word))
            }
            Some(b'\'') => self.text(),
            Some(b'"') => self.binary(),
            Some(b'0'..=b'9' | b'+' | b'-') => self.number(),
            _ => Ok(Value::Typed(self.record(depth + 1)?)),
        }
    }
    fn number(&mut self) -> Result<Value> {
        let start = self.at;
        let text = self.run(|b| b.is_ascii_digit() || b"+-.E".contains(&b));
        match text.parse() {
            Ok(number) if f64::is_finite(number) => Ok(Value::Number(number)),
            Ok(_) => {
                self.at = start;
                Err(self.wrong("a number is too large"))
            }
            Err(_) => {
                self.at = start;
                Err(self.wrong("a number is expected"))
            }
        }
    }
    /// Parses a binary number, which no shape needs.
    fn binary(&mut self) -> Result<Value> {
        self.at += 1;
        self.run(|b| b.is_ascii_hexdigit());
        self.expect("\"")?;
        Ok(Value::Nothing)
    }
    /// Parses a text in quotes; a doubled quote is a quote.
    fn text(&mut self) -> Result<Value> {
        let start = self.at;
        let mut bytes = Vec::new();
        loop {
            self.at += 1;
            match self.bytes.get(self.at) {
                Some(b'\'') if self.bytes.get(self.at + 1) == Some(&b'\'') => {
                    self.at += 1;
                    bytes.push(b'\'');
                }
                Some(b'\'') => break,
                Some(b) => bytes.push(*b),
                None => {
                    self.at = start;
                    return Err(self.wrong("a text does not end"));
                }
            }
        }
        self.at += 1;
        let text = String::from_utf8_lossy(&bytes);
        // Paths of Windows in headers often have backslashes without escapes.
        Ok(Value::Text(
            plain(&text).unwrap_or_else(|| text.into_owned()),
        ))
    }
}

/// Decodes the escapes of ISO 10303-21: \\, \X2\…\X0\ and \X4\…\X0\ (Unicode), \X\hh and \S\c
/// (ISO 8859-1); other code pages count as that.
fn plain(text: &str) -> Option<String> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, escaped)) = rest.split_once('\\') {
        out.push_str(before);
        rest = escape(escaped, &mut out)?;
    }
    out.push_str(rest);
    Some(out)
}

/// Decodes the escape after a backslash, and returns what follows it.
fn escape<'t>(escaped: &'t str, out: &mut String) -> Option<&'t str> {
    if let Some(after) = escaped.strip_prefix('\\') {
        out.push('\\');
        return Some(after);
    }
    if let Some(after) = escaped.strip_prefix("X\\") {
        let code = u8::from_str_radix(after.get(..2)?, 16).ok()?;
        out.push(char::from(code));
        return Some(&after[2..]);
    }
    if let Some(after) = escaped.strip_prefix("S\\") {
        let letter = after.chars().next().filter(char::is_ascii)?;
        out.push(char::from(letter as u8 | 0x80));
        return Some(&after[1..]);
    }
    if escaped.starts_with('P') && escaped.as_bytes().get(2) == Some(&b'\\') {
        return escaped.get(3..);
    }
    let (width, hex) = match escaped.get(..3)? {
        "X2\\" => (4, &escaped[3..]),
        "X4\\" => (8, &escaped[3..]),
        _ => return None,
    };
    let (digits, after) = hex.split_once("\\X0\\")?;
    if !digits.is_ascii() || digits.len() % width != 0 {
        return None;
    }
    let mut units = Vec::new();
    for code in digits.as_bytes().chunks(width) {
        let code = u32::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok()?;
        match u16::try_from(code) {
            Ok(unit) => units.push(unit),
            Err(_) => units.extend_from_slice(char::from_u32(code)?.encode_utf16(&mut [0; 2])),
        }
    }
    // Some programs write pairs of surrogates.
    let letters: std::result::Result<String, _> = char::decode_utf16(units).collect();
    out.push_str(&letters.ok()?);
    Some(after)
}

#[cfg(test)]
mod tests {
    use super::super::part21;
    use super::*;
    use proptest::prelude::*;

    fn data(instances: &str) -> String {
        format!("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n{instances}ENDSEC;\nEND-ISO-10303-21;\n")
    }

    #[test]
    fn instances_are_taken_apart() {
        let text = data("#1=A('x',(1,-2.5E-3),$,*,#7,.T.,L(2.));\n#30=(B()C((#1)));\n");
        let file = parse(&text).expect("a file");
        let record = |name: &str, arguments| Record {
            name: name.to_owned(),
            arguments,
        };
        let a = vec![
            Value::Text("x".to_owned()),
            Value::List(vec![Value::Number(1.0), Value::Number(-0.0025)]),
            Value::Nothing,
            Value::Nothing,
            Value::Reference(7),
            Value::Word("T".to_owned()),
            Value::Typed(record("L", vec![Value::Number(2.0)])),
        ];
        assert_eq!(file.instances[&1], [record("A", a)]);
        let one = Value::List(vec![Value::Reference(1)]);
        let both = [record("B", vec![]), record("C", vec![one])];
        assert_eq!(file.instances[&30], both);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let said = |instances: &str| parse(&data(instances)).expect_err(instances).to_string();
        assert_eq!(said("#1=A(1;"), "line 5, column 7: `,` is expected");
        assert_eq!(
            said("#1=A();\n#1=B();"),
            "line 6, column 1: #1 is there twice"
        );
        assert_eq!(said("#1=A('x"), "line 5, column 6: a text does not end");
        assert_eq!(said("#1=A(1-2);"), "line 5, column 6: a number is expected");
        let deep = format!("#1=A({});", "(".repeat(100_000));
        assert!(said(&deep).contains("too many brackets"));
        assert!(parse("solid x").is_err() && parse("").is_err());
    }

    proptest! {
        #[test]
        fn texts_read_back(text in "\\PC*") {
            let file = parse(&data(&format!("#1=A({});", part21::text(&text)))).expect("a file");
            prop_assert_eq!(&file.instances[&1][0].arguments[0], &Value::Text(text));
        }
    }
}
