//! Structured comments that describe a program and its parameters; other HyperFun readers ignore
//! them.
//!
//! `-- @param a[3] radius length min=0.1 max=50 start=5 unit=mm : of the hole`; see
//! docs/hyperfun.md.

use super::ast::{Defaults, Object, Statement};
use super::print::Placement;
use super::source::{Source, SyntaxError, Warning};
use isoform_geom::rotation;
use std::collections::BTreeMap;

/// Kind of quantity of a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QuantityKind {
    /// A coordinate along x.
    X,
    /// A coordinate along y.
    Y,
    /// A coordinate along z.
    Z,
    /// A length: it scales with the shape and is invariant under motions.
    Length,
    /// An angle in radians.
    Angle,
    /// A ratio: it is invariant under motions and scaling.
    Ratio,
    /// Another quantity.
    #[default]
    Number,
}

const KINDS: [(&str, QuantityKind); 7] = [
    ("x", QuantityKind::X),
    ("y", QuantityKind::Y),
    ("z", QuantityKind::Z),
    ("length", QuantityKind::Length),
    ("angle", QuantityKind::Angle),
    ("ratio", QuantityKind::Ratio),
    ("number", QuantityKind::Number),
];

/// Group of motions that a fit may apply to the whole model in addition to its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pose {
    /// The identity alone: the parameters describe the position, too.
    None,
    /// Translations.
    Translate,
    /// Translations and the choice of the model's axis.
    Axis,
    /// Rotations and translations.
    Rigid,
    /// Rotations, translations and a scale.
    Similarity,
}

impl Pose {
    /// All groups, each with its name.
    pub const ALL: [(&str, Self); 5] = [
        ("none", Self::None),
        ("translate", Self::Translate),
        ("axis", Self::Axis),
        ("rigid", Self::Rigid),
        ("similarity", Self::Similarity),
    ];
}

/// Value at which a parameter is held constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fixed {
    /// The start value.
    AtStart,
    /// A given value.
    At(f64),
}

/// Affine dependence of a parameter on others: constant + Σ factor · a\[index\], indices from 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Tie {
    /// The constant.
    pub constant: f64,
    /// Index from 0 and factor, by ascending index.
    pub terms: Vec<(usize, f64)>,
}

impl Tie {
    /// Returns the value for these parameters.
    pub fn value(&self, parameters: &[f64]) -> f64 {
        let terms = self.terms.iter().map(|&(i, factor)| factor * parameters[i]);
        self.constant + terms.sum::<f64>()
    }
}

/// Number as written, or a fraction of the data's size (`25%` of the diagonal of the data's
/// bounding box; `100%z` of its extent along the model's z axis). Fractions make a template
/// independent of units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// A number.
    Value(f64),
    /// A fraction of the diagonal.
    OfDiagonal(f64),
    /// A fraction of the extent along the axis with this index.
    OfExtent(f64, usize),
}

impl Amount {
    /// Returns true if the amount depends on the bounding box of the data.
    pub fn is_share(self) -> bool {
        !matches!(self, Self::Value(_))
    }
    /// Returns the number for a bounding box with these extents along the model's axes.
    pub fn resolve(self, extents: [f64; 3]) -> f64 {
        match self {
            Self::Value(v) => v,
            Self::OfDiagonal(share) => share * extents.iter().map(|e| e * e).sum::<f64>().sqrt(),
            Self::OfExtent(share, axis) => share * extents[axis],
        }
    }
    /// Returns the number; `None` if it depends on data.
    pub fn value(self) -> Option<f64> {
        if let Self::Value(v) = self {
            Some(v)
        } else {
            None
        }
    }
    /// Returns true if both are comparable without data and this one is greater.
    fn is_above(self, other: Self) -> bool {
        match (self, other) {
            (Self::Value(u), Self::Value(v)) | (Self::OfDiagonal(u), Self::OfDiagonal(v)) => u > v,
            (Self::OfExtent(u, i), Self::OfExtent(v, j)) => i == j && u > v,
            _ => false,
        }
    }
}

/// Annotations of the parameter a\[index + 1\].
#[derive(Clone, Debug, PartialEq)]
pub struct ParamInfo {
    /// Index from 0.
    pub index: usize,
    /// The annotated name, else "a\[i\]" with i from 1.
    pub name: String,
    /// Kind of quantity.
    pub kind: QuantityKind,
    /// Lower bound.
    pub min: Option<Amount>,
    /// Upper bound.
    pub max: Option<Amount>,
    /// Start value of a fit.
    pub start: Option<Amount>,
    /// Value in the absence of data, for a model that is displayed or meshed by itself.
    pub typical: Option<f64>,
    /// Unit, as written.
    pub unit: Option<String>,
    /// Value at which the parameter is held constant; `None` if it is free.
    pub fixed: Option<Fixed>,
    /// Dependence on other parameters; `None` if it is independent.
    pub tie: Option<Tie>,
    /// The text after the colon.
    pub description: String,
}

impl ParamInfo {
    /// Returns the parameter's label in messages: `a[1]`, followed by its name if it has one.
    pub fn label(&self) -> String {
        let plain = format!("a[{}]", self.index + 1);
        if self.name == plain {
            plain
        } else {
            format!("{plain} ({})", self.name)
        }
    }
}

/// Annotations of a whole program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileInfo {
    /// `@title`
    pub title: Option<String>,
    /// `@fits`: description of the data that the template fits.
    pub fits: Option<String>,
    /// `@pose`: group of motions that a fit determines.
    pub pose: Option<Pose>,
    /// `@pose … at … turned …`: start placement of a fit, in the coordinates of the data.
    pub place: Option<Placement>,
    /// `@unit`: unit of lengths.
    pub unit: Option<String>,
}

/// All annotations of a program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Annotations {
    pub(crate) file: FileInfo,
    /// Annotated parameters, by object and index.
    params: BTreeMap<(usize, usize), AnnotatedParam>,
}

#[derive(Clone, Debug)]
pub(crate) struct AnnotatedParam {
    info: ParamInfo,
    /// Byte range of `start=…`, or the empty range where it would be inserted; `None` if the
    /// parameter has no line of its own.
    pub(crate) start: Option<(u32, u32)>,
}

impl Annotations {
    /// Returns the annotations of the first `n` parameters of an object, defaults for those
    /// without.
    pub(crate) fn params(&self, object: usize, n: usize) -> Vec<ParamInfo> {
        (0..n)
            .map(|i| {
                self.param(object, i)
                    .map_or_else(|| plain(i), |p| p.info.clone())
            })
            .collect()
    }
    pub(crate) fn param(&self, object: usize, index: usize) -> Option<&AnnotatedParam> {
        self.params.get(&(object, index))
    }
}

fn plain(index: usize) -> ParamInfo {
    ParamInfo {
        index,
        name: format!("a[{}]", index + 1),
        kind: QuantityKind::Number,
        min: None,
        max: None,
        start: None,
        typical: None,
        unit: None,
        fixed: None,
        tie: None,
        description: String::new(),
    }
}

/// Part of a comment with its byte offset in the source.
#[derive(Clone, Copy)]
struct CommentText<'s> {
    text: &'s str,
    at: u32,
}

impl<'s> CommentText<'s> {
    fn trimmed(self) -> Self {
        let start = self.text.len() - self.text.trim_start().len();
        Self {
            text: self.text.trim(),
            at: self.at + start as u32,
        }
    }
    /// Returns the byte offset of its end in the source.
    fn end(self) -> u32 {
        self.at + self.text.len() as u32
    }
    /// Splits off the first word; returns it and the rest.
    fn word(self) -> (Self, Self) {
        let p = self.trimmed();
        let end = p.text.find(char::is_whitespace).unwrap_or(p.text.len());
        (
            Self {
                text: &p.text[..end],
                at: p.at,
            },
            Self {
                text: &p.text[end..],
                at: p.at + end as u32,
            },
        )
    }
    fn split(self, at: usize, skip: usize) -> (Self, Self) {
        (
            Self {
                text: &self.text[..at],
                at: self.at,
            },
            Self {
                text: &self.text[at + skip..],
                at: self.at + (at + skip) as u32,
            },
        )
    }
}

type ReadResult<T> = Result<T, SyntaxError>;

/// Reads the annotations in the comments; one before or inside an object belongs to it.
pub(crate) fn read(
    source: &Source,
    objects: &mut [Object],
    comments: &[(u32, u32)],
    warnings: &mut Vec<Warning>,
) -> ReadResult<Annotations> {
    let mut found = Annotations::default();
    let mut ties: Vec<(usize, usize, CommentText<'_>)> = Vec::new();
    let mut values: Vec<(usize, CommentText<'_>, CommentText<'_>)> = Vec::new();
    let mut object = 0;
    for &(start, end) in comments {
        while object < objects.len() && objects[object].span.1 <= start {
            object += 1;
        }
        let comment = CommentText {
            text: &source.text()[start as usize..end as usize],
            at: start,
        };
        let (key, rest) = comment.word();
        let Some(name) = key.text.strip_prefix('@') else {
            continue;
        };
        let text = rest.trimmed();
        let own = |text: CommentText<'_>| Some(text.text.to_owned());
        match name.to_ascii_lowercase().as_str() {
            "title" => found.file.title = own(text),
            "fits" => found.file.fits = own(text),
            "unit" => found.file.unit = own(text),
            "pose" => {
                let (word, place) = text.word();
                found.file.pose = Some(one_of(source, word, &Pose::ALL, "a pose")?);
                found.file.place = placement(source, place)?;
            }
            "param" => {
                let Some(of) = objects.get(object) else {
                    let message = "no object follows that this parameter could belong to";
                    return Err(source.error(key.at, message, ""));
                };
                let (param, tie) = param(source, rest, of)?;
                ties.extend(tie.map(|tie| (object, param.info.index, tie)));
                found.add(source, key, object, param)?;
            }
            "values" => values.push((object, key, text)),
            _ => {
                let (line, column) = source.position(key.at);
                let message = format!(
                    "`{}` is no annotation; known are @param, @title, @fits, @pose, @unit and \
                     @values",
                    key.text
                );
                warnings.push(Warning {
                    line,
                    column,
                    message,
                });
            }
        }
    }
    resolve_ties(source, objects, &mut found, &ties)?;
    for of in values {
        found.take_values(source, objects, of, warnings)?;
    }
    Ok(found)
}

/// Relative difference from a tied value below which a default of it does not cause a warning:
/// programs show a few digits only.
const TIED_DEFAULT_TOLERANCE: f64 = 1e-3;

impl Annotations {
    /// Reads `@values ARRAY of OBJECT`: the constants of a local array of this object are the
    /// defaults of its parameters, whose annotations are those of the other object, above it.
    fn take_values(
        &mut self,
        source: &Source,
        objects: &mut [Object],
        (object, key, text): (usize, CommentText<'_>, CommentText<'_>),
        warnings: &mut Vec<Warning>,
    ) -> ReadResult<()> {
        let fail =
            |piece: CommentText<'_>, message: String| Err(source.error(piece.at, message, ""));
        let Some(of) = objects.get(object) else {
            return fail(text, "no object follows that has these values".to_owned());
        };
        let (array, rest) = text.word();
        let (word, other) = rest.word();
        let other = other.trimmed();
        if !word.text.eq_ignore_ascii_case("of") {
            let message = format!("`of` expected, found `{}`", word.text);
            return Err(source.error(word.at, message, "ARRAY of OBJECT"));
        }
        let assigned = of.body.iter().find_map(|statement| match statement {
            Statement::AssignArray {
                array: to,
                values,
                span,
            } if of.arrays[to.id as usize]
                .name
                .eq_ignore_ascii_case(array.text) =>
            {
                Some((*to, values, *span))
            }
            _ => None,
        });
        let Some((to, values, span)) = assigned else {
            let message = format!("`{}` assigns no array `{}`", of.name, array.text);
            return fail(array, message);
        };
        let is_other = |o: &Object| o.name.eq_ignore_ascii_case(other.text);
        let Some(template) = objects[..object].iter().position(is_other) else {
            return fail(other, format!("no object `{}` above this one", other.text));
        };
        let sizes = [of.n_params(), objects[template].n_params()];
        if sizes != [values.len(); 2] {
            let message = format!(
                "`{}` has {} values, `{}` and `{}` have {} and {} parameters",
                array.text,
                values.len(),
                of.name,
                other.text,
                sizes[0],
                sizes[1]
            );
            return fail(array, message);
        }
        for (info, value) in self.params(template, values.len()).into_iter().zip(values) {
            let tied = info.tie.as_ref().map(|tie| tie.value(values));
            if let Some(tied) =
                tied.filter(|t| (t - value).abs() > TIED_DEFAULT_TOLERANCE * t.abs())
            {
                let (line, column) = source.position(array.at);
                let message = format!(
                    "{} is tied: it is {tied} for these values, and the {value} here does not count",
                    info.label()
                );
                warnings.push(Warning {
                    line,
                    column,
                    message,
                });
            }
            let info = ParamInfo {
                typical: Some(*value),
                start: Some(Amount::Value(*value)),
                fixed: info.fixed.map(|_| Fixed::At(*value)),
                ..info
            };
            let param = AnnotatedParam { info, start: None };
            if self
                .params
                .insert((object, param.info.index), param)
                .is_some()
            {
                return fail(array, "parameters are described twice".to_owned());
            }
        }
        objects[object].defaults = Some(Defaults {
            array: to,
            assigned: span,
            annotation: key.at,
            of: template,
        });
        // The template's start placement is contained in this object.
        self.file.place = None;
        Ok(())
    }

    /// Adds a parameter of an object; fails if its index or its name is annotated already.
    fn add(
        &mut self,
        source: &Source,
        key: CommentText<'_>,
        object: usize,
        param: AnnotatedParam,
    ) -> ReadResult<()> {
        let (index, name) = (param.info.index, &param.info.name);
        let is_twin = |((of, _), other): (&(usize, usize), &AnnotatedParam)| {
            *of == object && other.info.name.eq_ignore_ascii_case(name)
        };
        if self.params.iter().any(is_twin) {
            let message = format!("there is a parameter `{name}` already");
            return Err(source.error(key.at, message, ""));
        }
        if self.params.insert((object, index), param).is_some() {
            let message = format!("a[{}] is described already", index + 1);
            return Err(source.error(key.at, message, ""));
        }
        Ok(())
    }
}

fn one_of<T: Copy>(
    source: &Source,
    word: CommentText<'_>,
    table: &[(&str, T)],
    what: &str,
) -> ReadResult<T> {
    if let Some((_, v)) = table
        .iter()
        .find(|(name, _)| word.text.eq_ignore_ascii_case(name))
    {
        return Ok(*v);
    }
    let names: Vec<&str> = table.iter().map(|(n, _)| *n).collect();
    let known = names.join(", ");
    Err(source.error(
        word.at,
        format!("`{}` is not {what}; known are {known}", word.text),
        known,
    ))
}

/// Reads `[at X Y Z] [turned RX RY RZ]`: the model's origin, and a rotation vector in radians.
fn placement(source: &Source, text: CommentText<'_>) -> ReadResult<Option<Placement>> {
    let (mut translation, mut vector, mut is_placed) = ([0.0; 3], [0.0; 3], false);
    let mut rest = text.trimmed();
    while !rest.text.is_empty() {
        let (key, after) = rest.word();
        let to = match key.text {
            "at" => &mut translation,
            "turned" => &mut vector,
            other => {
                let message = format!(
                    "`{other}` is no part of a pose; known are at X Y Z and turned RX RY RZ"
                );
                return Err(source.error(key.at, message, "at, turned"));
            }
        };
        rest = after;
        for v in to {
            let (word, after) = rest.word();
            *v = number(source, word)?;
            rest = after.trimmed();
        }
        is_placed = true;
    }
    Ok(is_placed.then(|| Placement {
        rotation: rotation::about(vector),
        translation,
        scale: 1.0,
    }))
}

const KEYS: &str = "min=, max=, start=, typical=, unit=, fixed, fixed=, tie=";

/// Reads `a[i] [NAME [KIND]] [key=value …] [: description]`; returns the parameter and the text of
/// its tie.
fn param<'s>(
    source: &Source,
    text: CommentText<'s>,
    object: &Object,
) -> ReadResult<(AnnotatedParam, Option<CommentText<'s>>)> {
    let (text, description) = match text.text.find(':') {
        Some(colon) => text.split(colon, 1),
        None => text.split(text.text.len(), 0),
    };
    let (target, mut rest) = text.word();
    let mut info = plain(index(source, target, object)?);
    info.description = description.text.trim().to_owned();
    let mut line = ParamLine {
        source,
        text,
        info,
        tie: None,
        in_tie: false,
        next: NextWord::Name,
        start: None,
    };
    let mut end = target.end();
    loop {
        let (word, after) = rest.word();
        if word.text.is_empty() {
            break;
        }
        rest = after;
        line.read(word)?;
        end = word.end();
    }
    line.check(target)?;
    let param = AnnotatedParam {
        start: Some(line.start.unwrap_or((end, end))),
        info: line.info,
    };
    Ok((param, line.tie))
}

/// Meaning of the next word without `=`.
#[derive(Clone, Copy)]
enum NextWord {
    Name,
    Kind,
    /// Neither: the name and the kind have been read.
    Nothing,
}

/// State of reading a parameter's line, word by word.
struct ParamLine<'a, 's> {
    source: &'a Source,
    /// The line without its description.
    text: CommentText<'s>,
    info: ParamInfo,
    tie: Option<CommentText<'s>>,
    /// True while the expression of a tie is read, which extends over spaces up to the next key.
    in_tie: bool,
    next: NextWord,
    /// Byte range of `start=…`.
    start: Option<(u32, u32)>,
}

impl<'s> ParamLine<'_, 's> {
    fn read(&mut self, word: CommentText<'s>) -> ReadResult<()> {
        if let Some(eq) = word.text.find('=') {
            let (key, value) = word.split(eq, 1);
            self.in_tie = false;
            return self.value(word, key, value);
        }
        if self.in_tie
            && let Some(tie) = &mut self.tie
        {
            let from = (tie.at - self.text.at) as usize;
            let to = (word.end() - self.text.at) as usize;
            tie.text = &self.text.text[from..to];
            return Ok(());
        }
        if word.text.eq_ignore_ascii_case("fixed") {
            self.info.fixed = Some(Fixed::AtStart);
            return Ok(());
        }
        self.plain(word)
    }

    /// Reads `key=value`.
    fn value(
        &mut self,
        word: CommentText<'s>,
        key: CommentText<'s>,
        value: CommentText<'s>,
    ) -> ReadResult<()> {
        let source = self.source;
        match key.text.to_ascii_lowercase().as_str() {
            "min" => self.info.min = Some(amount(source, value)?),
            "max" => self.info.max = Some(amount(source, value)?),
            "start" => {
                self.info.start = Some(amount(source, value)?);
                self.start = Some((word.at, word.end()));
            }
            "typical" => self.info.typical = Some(number(source, value)?),
            "unit" => self.info.unit = Some(value.text.to_owned()),
            "fixed" => self.info.fixed = Some(Fixed::At(number(source, value)?)),
            "tie" => {
                self.tie = Some(value);
                self.in_tie = true;
            }
            _ => return Err(self.unknown(key)),
        }
        Ok(())
    }

    /// Reads the parameter's name or, after it, its kind.
    fn plain(&mut self, word: CommentText<'s>) -> ReadResult<()> {
        match self.next {
            NextWord::Name if !is_name(word.text) => {
                let message = format!(
                    "`{}` is no name: letters, digits and underscores",
                    word.text
                );
                return Err(self.source.error(word.at, message, "a name"));
            }
            NextWord::Name => {
                self.info.name = word.text.to_owned();
                self.next = NextWord::Kind;
            }
            NextWord::Kind => {
                self.info.kind = one_of(self.source, word, &KINDS, "a kind of parameter")?;
                self.next = NextWord::Nothing;
            }
            NextWord::Nothing => return Err(self.unknown(word)),
        }
        Ok(())
    }

    fn unknown(&self, key: CommentText<'_>) -> SyntaxError {
        let message = format!("`{}` is no key of @param; known are {KEYS}", key.text);
        self.source.error(key.at, message, KEYS)
    }

    /// Checks the consistency of the values; errors are reported at the parameter, `target`.
    fn check(&self, target: CommentText<'_>) -> ReadResult<()> {
        let wrong = |message| Err(self.source.error(target.at, message, ""));
        let (min, max) = (self.info.min, self.info.max);
        if min.is_some_and(|min| max.is_some_and(|max| min.is_above(max))) {
            return wrong("min is above max");
        }
        let is_outside =
            |v| min.is_some_and(|min| min.is_above(v)) || max.is_some_and(|max| v.is_above(max));
        if self.info.start.is_some_and(is_outside) {
            return wrong("start is outside the bounds");
        }
        if self.info.typical.map(Amount::Value).is_some_and(is_outside) {
            return wrong("typical is outside the bounds");
        }
        if self.info.fixed.is_some() && self.tie.is_some() {
            return wrong("a parameter is fixed or tied, not both");
        }
        Ok(())
    }
}

/// Returns true if a word consists of letters, digits and underscores and does not begin with a
/// digit.
fn is_name(word: &str) -> bool {
    word.chars().all(|c| c.is_alphanumeric() || c == '_')
        && !word.starts_with(|c: char| c.is_ascii_digit())
}

/// Reads `a[i]`; returns the index from 0.
fn index(source: &Source, word: CommentText<'_>, object: &Object) -> ReadResult<usize> {
    let inner = word
        .text
        .strip_prefix(['a', 'A'])
        .and_then(|t| t.strip_prefix('['))
        .and_then(|t| t.strip_suffix(']'));
    match inner.and_then(|t| t.trim().parse::<usize>().ok()) {
        Some(i) if (1..=object.n_params()).contains(&i) => Ok(i - 1),
        Some(i) => {
            let message = format!(
                "a[{i}] does not exist: `{}` has a[{}]",
                object.name,
                object.n_params()
            );
            Err(source.error(word.at, message, ""))
        }
        None => Err(source.error(
            word.at,
            format!("a[i] with an index expected, found `{}`", word.text),
            "a[i]",
        )),
    }
}

/// Reads a number, or a number followed by %, %x, %y or %z.
fn amount(source: &Source, word: CommentText<'_>) -> ReadResult<Amount> {
    let Some(at) = word.text.find('%') else {
        return number(source, word).map(Amount::Value);
    };
    let (share, axis) = word.split(at, 1);
    let share = number(source, share)? / 100.0;
    match axis.text {
        "" => Ok(Amount::OfDiagonal(share)),
        "x" | "y" | "z" => Ok(Amount::OfExtent(
            share,
            usize::from(axis.text.as_bytes()[0] - b'x'),
        )),
        other => Err(source.error(
            axis.at,
            format!("`%{other}`: x, y, z or nothing expected after %"),
            "%, %x, %y or %z",
        )),
    }
}

fn number(source: &Source, word: CommentText<'_>) -> ReadResult<f64> {
    match word.text.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(source.error(
            word.at,
            format!("`{}` is not a number", word.text),
            "a number",
        )),
    }
}

// ---- ties
// -----------------------------------------------------------------------------------------------------------------

fn resolve_ties(
    source: &Source,
    objects: &[Object],
    found: &mut Annotations,
    ties: &[(usize, usize, CommentText<'_>)],
) -> ReadResult<()> {
    for &(object, index, text) in ties {
        let names: BTreeMap<String, usize> = found
            .params
            .range((object, 0)..(object + 1, 0))
            .map(|((_, i), p)| (p.info.name.to_ascii_lowercase(), *i))
            .collect();
        let mut reader = TieParser {
            source,
            text,
            at: 0,
            names: &names,
            n: objects[object].n_params(),
            depth: 0,
        };
        let form = reader.sum()?;
        if reader.peek().is_some() {
            return reader.fail("an operator or the end expected");
        }
        let terms: Vec<(usize, f64)> = form.terms.into_iter().filter(|(_, f)| *f != 0.0).collect();
        for (i, _) in &terms {
            if *i == index || ties.iter().any(|(o, tied, _)| (*o, *tied) == (object, *i)) {
                return Err(source.error(
                    text.at,
                    format!(
                        "a tie must follow free parameters; a[{}] is tied itself",
                        i + 1
                    ),
                    "",
                ));
            }
        }
        if let Some(param) = found.params.get_mut(&(object, index)) {
            param.info.tie = Some(Tie {
                constant: form.constant,
                terms,
            });
        }
    }
    Ok(())
}

/// Affine function of the parameters, under construction.
struct AffineForm {
    constant: f64,
    terms: BTreeMap<usize, f64>,
}

impl AffineForm {
    fn scaled(mut self, k: f64) -> Self {
        self.constant *= k;
        self.terms.values_mut().for_each(|f| *f *= k);
        self
    }
    fn plus(mut self, o: Self) -> Self {
        self.constant += o.constant;
        for (i, f) in o.terms {
            *self.terms.entry(i).or_insert(0.0) += f;
        }
        self
    }
}

/// Parser of the expression of a tie: sums of products of numbers and parameters.
struct TieParser<'s> {
    source: &'s Source,
    text: CommentText<'s>,
    at: usize,
    names: &'s BTreeMap<String, usize>,
    n: usize,
    depth: u32,
}

impl TieParser<'_> {
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text.text[self.at..].chars().next()
    }
    fn take(&mut self, c: char) -> bool {
        let is = self.peek() == Some(c);
        if is {
            self.at += c.len_utf8();
        }
        is
    }
    fn fail<T>(&self, message: &str) -> ReadResult<T> {
        let at = self.text.at + self.at as u32;
        Err(self.source.error(
            at,
            format!("tie: {message}"),
            "a linear expression of other parameters",
        ))
    }
    fn while_(&mut self, f: impl Fn(char) -> bool) -> &str {
        let from = self.at;
        let rest = &self.text.text[from..];
        self.at += rest.find(|c| !f(c)).unwrap_or(rest.len());
        &self.text.text[from..self.at]
    }
    fn sum(&mut self) -> ReadResult<AffineForm> {
        let mut form = self.product()?;
        loop {
            if self.take('+') {
                form = form.plus(self.product()?);
            } else if self.take('-') {
                form = form.plus(self.product()?.scaled(-1.0));
            } else {
                return Ok(form);
            }
        }
    }
    fn product(&mut self) -> ReadResult<AffineForm> {
        let mut form = self.primary()?;
        loop {
            if self.take('*') {
                let factor = self.at;
                let other = self.primary()?;
                form = match (form.terms.is_empty(), other.terms.is_empty()) {
                    (_, true) => form.scaled(other.constant),
                    (true, false) => other.scaled(form.constant),
                    (false, false) => {
                        self.at = factor;
                        return self.fail("a product of two parameters is not linear");
                    }
                };
            } else if self.take('/') {
                let other = self.primary()?;
                if !other.terms.is_empty() || other.constant == 0.0 {
                    return self.fail("only division by a number other than 0 is linear");
                }
                form = form.scaled(1.0 / other.constant);
            } else {
                return Ok(form);
            }
        }
    }
    fn primary(&mut self) -> ReadResult<AffineForm> {
        self.depth += 1;
        if self.depth > super::MAX_NESTING_DEPTH {
            return self.fail("nested too deep");
        }
        let form = self.inner_primary();
        self.depth -= 1;
        form
    }
    fn inner_primary(&mut self) -> ReadResult<AffineForm> {
        if self.take('-') {
            return Ok(self.primary()?.scaled(-1.0));
        }
        if self.take('+') {
            return self.primary();
        }
        if self.take('(') {
            let form = self.sum()?;
            return if self.take(')') {
                Ok(form)
            } else {
                self.fail("`)` expected")
            };
        }
        match self.peek() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.parameter(),
            _ => self.fail("a number or a parameter expected"),
        }
    }
    fn number(&mut self) -> ReadResult<AffineForm> {
        let from = self.at;
        self.while_(|c| c.is_ascii_digit() || c == '.');
        let digits = self.at;
        if self.text.text[self.at..].starts_with(['e', 'E']) {
            self.at += 1;
            if self.text.text[self.at..].starts_with(['+', '-']) {
                self.at += 1;
            }
            if self.while_(|c| c.is_ascii_digit()).is_empty() {
                self.at = digits;
            }
        }
        match self.text.text[from..self.at].parse::<f64>() {
            Ok(constant) if constant.is_finite() => Ok(AffineForm {
                constant,
                terms: BTreeMap::new(),
            }),
            _ => self.fail("a number expected"),
        }
    }

    /// Reads a parameter, by its name or as `a[i]`.
    fn parameter(&mut self) -> ReadResult<AffineForm> {
        let from = self.at;
        let name = self
            .while_(|c| c.is_alphanumeric() || c == '_')
            .to_ascii_lowercase();
        let index = match self.names.get(&name) {
            Some(&index) => index,
            None if name == "a" && self.take('[') => self.index()?,
            None => {
                self.at = from;
                return self.fail(&format!("no parameter `{name}`"));
            }
        };
        Ok(AffineForm {
            constant: 0.0,
            terms: BTreeMap::from([(index, 1.0)]),
        })
    }

    /// Reads `i]`; returns the index from 0.
    fn index(&mut self) -> ReadResult<usize> {
        let i = self.while_(|c| c.is_ascii_digit());
        let i = i.parse::<usize>().unwrap_or(0);
        if !self.take(']') || i == 0 || i > self.n {
            return self.fail("no such parameter");
        }
        Ok(i - 1)
    }
}
