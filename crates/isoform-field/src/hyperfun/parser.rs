//! Recursive-descent parser of HyperFun.
//!
//! Names are checked and resolved during parsing, so that the first error in text order is
//! reported, at the token where the reference implementation reports it. Operators of one
//! precedence form a left-associative chain; in ascending precedence they are logic, comparisons,
//! sums with set operators, products, and powers.

use super::ast::{
    Argument, Array, ArrayRef, Expr, HEAD_ARRAYS, Level, Link, Object, Operator, Statement,
};
use super::files::FileTerm;
use super::functions::{self, ArgumentShape};
use super::lexer::{Token, TokenKind, Word};
use super::source::{Source, SyntaxError, Warning};
use super::{MAX_ARRAY_ITEMS, MAX_NESTING_DEPTH, Mode, Precedence};
use crate::suggestion;
use std::collections::HashMap;

type ParseResult<T> = Result<T, SyntaxError>;

/// Meaning of a name in an object.
#[derive(Clone, Copy)]
enum NameMeaning {
    Variable(u32),
    Array(ArrayRef),
}

/// Parses a program; returns its objects and the warnings.
pub(crate) fn parse(
    source: &Source,
    (tokens, comments): (&[Token], &[(u32, u32)]),
    mode: Mode,
    precedence: Precedence,
) -> ParseResult<Parsed> {
    let mut parser = Parser {
        source,
        tokens,
        comments,
        at: 0,
        mode,
        precedence,
        objects: Vec::new(),
        files: Vec::new(),
        object_names: HashMap::new(),
        names: HashMap::new(),
        own_name: String::new(),
        arrays: Vec::new(),
        memory: 0,
        variables: Vec::new(),
        items: 0,
        depth: 0,
        deepest: 0,
        warnings: Vec::new(),
    };
    while parser.kind() != TokenKind::End || parser.objects.is_empty() {
        let object = parser.object()?;
        parser
            .object_names
            .insert(object.name.clone(), parser.objects.len() as u32);
        parser.objects.push(object);
    }
    parser.warn_of_comments();
    Ok(Parsed {
        objects: parser.objects,
        files: parser.files,
        warnings: parser.warnings,
    })
}

/// Contents of a program.
pub(crate) struct Parsed {
    pub(crate) objects: Vec<Object>,
    pub(crate) files: Vec<FileTerm>,
    pub(crate) warnings: Vec<Warning>,
}

/// State of the parser.
struct Parser<'s> {
    source: &'s Source,
    tokens: &'s [Token],
    /// The byte ranges of the comments, without the two dashes.
    comments: &'s [(u32, u32)],
    /// Index of the present token.
    at: usize,
    mode: Mode,
    precedence: Precedence,
    /// Objects parsed so far.
    objects: Vec<Object>,
    /// Files named so far.
    files: Vec<FileTerm>,
    /// Index of each object, by name.
    object_names: HashMap<String, u32>,
    /// Names defined in the present object.
    names: HashMap<String, NameMeaning>,
    /// Name of the present object.
    own_name: String,
    /// Arrays of the present object.
    arrays: Vec<Array>,
    /// Number of items in the memory of the present object so far.
    memory: u32,
    /// Variables of the present object.
    variables: Vec<String>,
    /// Number of array items in the whole program so far.
    items: u64,
    /// Present depth of nesting.
    depth: u32,
    /// Maximum depth of nesting in the present object.
    deepest: u32,
    warnings: Vec<Warning>,
}

impl Parser<'_> {
    /// Returns the present token.
    fn token(&self) -> Token {
        self.tokens[self.at]
    }
    /// Returns the kind of the present token.
    fn kind(&self) -> TokenKind {
        self.token().kind
    }
    /// Returns the byte offset of the present token.
    fn start(&self) -> u32 {
        self.token().start
    }
    /// Advances to the next token; returns the present one.
    fn advance(&mut self) -> Token {
        let token = self.token();
        if token.kind != TokenKind::End {
            self.at += 1;
        }
        token
    }
    /// Returns the text of the present token in lower case.
    fn text(&self) -> String {
        let token = self.token();
        self.source.text()[token.start as usize..token.end as usize].to_ascii_lowercase()
    }
    /// Returns true if the present token is the given symbol.
    fn is_symbol(&self, symbol: &str) -> bool {
        matches!(self.kind(), TokenKind::Symbol(s) if s == symbol)
    }
    /// Returns true if the present token is the given reserved word.
    fn is_word(&self, word: Word) -> bool {
        self.kind() == TokenKind::Word(word)
    }

    /// Returns the text of the present token for messages.
    fn found(&self) -> String {
        let token = self.token();
        match token.kind {
            TokenKind::End => "the end of the program".to_owned(),
            _ => {
                let text = &self.source.text()[token.start as usize..token.end as usize];
                let short: String = text.chars().take(40).flat_map(char::escape_debug).collect();
                format!("`{short}`")
            }
        }
    }
    /// Returns the error that something else was expected. If a comment has hidden an intended
    /// operand, the message says so.
    fn expected<T>(&self, what: &str) -> ParseResult<T> {
        self.expected_with(what, "")
    }
    /// Returns the error that something else was expected, with a remedy.
    fn expected_with<T>(&self, what: &str, hint: &str) -> ParseResult<T> {
        if let Some(at) = self.swallowed(self.at) {
            let (line, column) = self.source.position(at);
            let message = format!(
                "{what} expected, found {}: the `--` in line {line}, column {column} begins a \
                 comment; to subtract what has a sign, write `- -` or parentheses",
                self.found()
            );
            return Err(self.source.error(self.start(), message, ""));
        }
        let is_comment = ["//", "/*"].iter().any(|mark| {
            let rest = &self.source.text()[self.start() as usize..];
            rest.starts_with(mark)
        });
        let hint = if is_comment {
            "comments begin with `--`"
        } else {
            hint
        };
        Err(self.source.error(
            self.start(),
            format!("{what} expected, found {}", self.found()),
            hint,
        ))
    }
    /// Returns the remedy for a missing symbol: the place after the token before.
    fn missing(&self, symbol: &str) -> String {
        let Some(before) = self.at.checked_sub(1).map(|i| self.tokens[i]) else {
            return String::new();
        };
        let text = &self.source.text()[before.start as usize..before.end as usize];
        let (line, _) = self.source.position(before.start);
        format!("write `{symbol}` after `{text}` in line {line}")
    }
    /// Returns the byte offset of two dashes before a token that begin a comment which looks like
    /// an operand: it immediately follows another operand, or begins with a number.
    fn swallowed(&self, token: usize) -> Option<u32> {
        let before = self.tokens[token.checked_sub(1)?];
        let ends_operand = matches!(
            before.kind,
            TokenKind::Number(_) | TokenKind::Name | TokenKind::Symbol("]" | ")")
        );
        let next = self.comments.partition_point(|c| c.0 < before.end);
        let &(start, end) = self.comments.get(next).filter(|_| ends_operand)?;
        let first = self.source.text().as_bytes()[start as usize..end as usize].first()?;
        let is_number = first.is_ascii_digit() || *first == b'.';
        let is_close = start == before.end + 2;
        let is_operand = is_number || is_close && (first.is_ascii_alphabetic() || *first == b'(');
        is_operand.then_some(start - 2)
    }
    /// Warns of comments that look like operands in programs that are valid with them:
    /// `x[1]--0.03`, with the rest of the sum in the next line.
    fn warn_of_comments(&mut self) {
        let is_close = |(token, at): (usize, u32)| {
            (self.tokens[token - 1].end == at).then(|| self.source.position(at))
        };
        let swallowed = |token| Some((token, self.swallowed(token)?));
        let places = (1..self.tokens.len()).filter_map(swallowed);
        let places: Vec<(usize, usize)> = places.filter_map(is_close).collect();
        let message = "`--` begins a comment, though it looks like a difference; to subtract what \
                       has a sign, write `- -` or parentheses";
        self.warnings
            .extend(places.into_iter().map(|(line, column)| Warning {
                line,
                column,
                message: message.to_owned(),
            }));
    }
    /// Returns the meaning of the present token if it is a reserved name.
    fn reserved(&self) -> Option<&'static str> {
        match self.kind() {
            TokenKind::Word(word) => Some(word.meaning()),
            TokenKind::Name if functions::find(&self.text()).is_some() => {
                Some("a function of the library")
            }
            _ => None,
        }
    }
    /// Returns the error that a name was expected, with the meaning of a reserved one in its place.
    fn expected_name<T>(&self, what: &str) -> ParseResult<T> {
        match self.reserved() {
            Some(meaning) => self.fail(
                self.start(),
                format!(
                    "{what} expected, found {}: this name is reserved, {meaning}",
                    self.found()
                ),
            ),
            None => self.expected(what),
        }
    }
    /// Returns an error at a byte offset.
    fn fail<T>(&self, at: u32, message: impl Into<String>) -> ParseResult<T> {
        Err(self.source.error(at, message, ""))
    }
    /// Reads a symbol; `what` is its name in the message if it is missing.
    fn symbol(&mut self, symbol: &str, what: &str) -> ParseResult<()> {
        self.symbol_with(symbol, what, |parser| match symbol {
            ";" | ")" | "]" | "}" => parser.missing(symbol),
            _ => String::new(),
        })
    }
    /// Reads a symbol; `hint` returns the remedy if it is missing.
    fn symbol_with(
        &mut self,
        symbol: &str,
        what: &str,
        hint: impl FnOnce(&Self) -> String,
    ) -> ParseResult<()> {
        if self.is_symbol(symbol) {
            self.advance();
            return Ok(());
        }
        self.expected_with(what, &hint(self))
    }
    /// Reads a reserved word; `what` is its name in the message if it is missing.
    fn word(&mut self, word: Word, what: &str) -> ParseResult<()> {
        if self.is_word(word) {
            self.advance();
            return Ok(());
        }
        self.expected(what)
    }
    /// Parses one nesting level deeper.
    fn nested<T>(&mut self, inner: impl FnOnce(&mut Self) -> ParseResult<T>) -> ParseResult<T> {
        self.go_deeper(1)?;
        self.depth += 1;
        let result = inner(self);
        self.depth -= 1;
        result
    }
    /// Records a depth of nesting; fails beyond the limit, which prevents stack overflow in
    /// evaluation.
    fn go_deeper(&mut self, by: u32) -> ParseResult<()> {
        if self.depth + by > MAX_NESTING_DEPTH {
            return self.fail(
                self.start(),
                format!(
                    "nested more than {MAX_NESTING_DEPTH} levels deep (calls of objects included)"
                ),
            );
        }
        self.deepest = self.deepest.max(self.depth + by);
        Ok(())
    }

    /// Reads an object: name head { array declarations, statements, name = expression; }
    fn object(&mut self) -> ParseResult<Object> {
        let start = self.start();
        if self.kind() == TokenKind::End && self.objects.is_empty() {
            let hint = "a program is `my_model(x[3], a[1]) { my_model = 1 - x[1]^2; }`";
            let error = self.source.error(start, "the program is empty", hint);
            return Err(error);
        }
        if self.kind() != TokenKind::Name {
            return self.expected_name("the name of an object");
        }
        let name = self.text();
        if functions::find(&name).is_some() {
            return self.fail(
                start,
                format!("`{name}` is the name of a library function; an object needs another"),
            );
        }
        if self.object_names.contains_key(&name) {
            return self.fail(start, format!("there is an object `{name}` already"));
        }
        self.advance();
        self.names.clear();
        self.arrays.clear();
        self.variables.clear();
        self.memory = 0;
        (self.depth, self.deepest) = (0, 0);
        self.own_name.clone_from(&name);
        let has_s = self.head()?;
        self.symbol("{", "left brace `{`")?;
        while self.is_word(Word::Array) {
            self.advance();
            self.declaration()?;
        }
        let first_variable = self.memory;
        let body = self.block()?;
        let result_at = self.start();
        if self.kind() != TokenKind::Name || self.text() != name {
            return self.expected(&format!("a statement or the result `{name} = ...`"));
        }
        self.advance();
        self.symbol("=", "`=`")?;
        let result = self.expr()?;
        self.symbol(";", "semicolon `;`")?;
        let end = self.token().end;
        self.symbol("}", "right brace `}` after the result")?;
        Ok(Object {
            name,
            span: (start, end),
            has_s,
            arrays: std::mem::take(&mut self.arrays),
            first_variable,
            variables: std::mem::take(&mut self.variables),
            body,
            result_at,
            result,
            depth: self.deepest,
            defaults: None,
        })
    }

    /// Reads a head: (x\[n\], a\[n\] \[, s\[n\]\]); returns true if it declares s.
    fn head(&mut self) -> ParseResult<bool> {
        self.symbol("(", "left parenthesis `(`")?;
        self.word(Word::X, "the coordinates `x[...]`")?;
        self.head_array("x", 1)?;
        self.symbol(",", "comma `,` and the parameters `a[...]`")?;
        self.word(Word::A, "the parameters `a[...]`")?;
        self.head_array("a", 0)?;
        let has_s = self.is_symbol(",");
        if has_s {
            self.advance();
            self.word(Word::S, "the attributes `s[...]`")?;
            self.head_array("s", 1)?;
        } else {
            self.declare("s", 1)?;
        }
        self.symbol(
            ")",
            if has_s {
                "right parenthesis `)`"
            } else {
                "right parenthesis `)` or comma `,`"
            },
        )?;
        Ok(has_s)
    }
    /// Reads the size of an array of the head.
    fn head_array(&mut self, name: &str, least: u32) -> ParseResult<()> {
        self.symbol_with("[", "left bracket `[`", |_| {
            "give the sizes: `(x[3], a[2])` for two parameters".to_owned()
        })?;
        let len = self.size(least)?;
        self.declare(name, len)?;
        self.symbol("]", "right bracket `]`")
    }
    /// Reads the size of an array: a number, rounded to the nearest integer.
    fn size(&mut self, least: u32) -> ParseResult<u32> {
        let at = self.start();
        let TokenKind::Number(value) = self.kind() else {
            return self.expected("the size, a number");
        };
        let size = (value + 0.5).floor();
        if size < f64::from(least) {
            return self.fail(
                at,
                format!("the size must be at least {least}, not {value}"),
            );
        }
        if size > MAX_ARRAY_ITEMS as f64 || self.items + size as u64 > MAX_ARRAY_ITEMS {
            return self.fail(
                at,
                format!("the arrays of a program may have {MAX_ARRAY_ITEMS} items in all"),
            );
        }
        self.advance();
        self.items += size as u64;
        Ok(size as u32)
    }
    /// Adds an array to the memory of the object.
    fn declare(&mut self, name: &str, len: u32) -> ParseResult<()> {
        let array = ArrayRef {
            id: self.arrays.len() as u32,
            start: self.memory,
            len,
        };
        self.memory += len;
        self.arrays.push(Array {
            name: name.to_owned(),
            len,
        });
        self.names
            .insert(name.to_owned(), NameMeaning::Array(array));
        Ok(())
    }
    /// Reads name\[size\] (, name\[size\])* ; after the word `array`.
    fn declaration(&mut self) -> ParseResult<()> {
        loop {
            let at = self.start();
            if self.kind() != TokenKind::Name {
                return self.expected_name("the name of an array");
            }
            let name = self.text();
            if functions::find(&name).is_some()
                || self.object_names.contains_key(&name)
                || name == self.own_name
            {
                return self.fail(
                    at,
                    format!(
                        "`{name}` is the name of a function or object; the array needs another"
                    ),
                );
            }
            if self.names.contains_key(&name) {
                return self.fail(at, format!("there is an array `{name}` already"));
            }
            self.advance();
            self.symbol("[", "left bracket `[`")?;
            let len = self.size(1)?;
            self.symbol("]", "right bracket `]`")?;
            self.declare(&name, len)?;
            if self.is_symbol(",") {
                self.advance();
                continue;
            }
            return self.symbol(";", "semicolon `;` or comma `,`");
        }
    }

    /// Reads statements, up to a token that cannot begin one.
    fn block(&mut self) -> ParseResult<Vec<Statement>> {
        let mut statements = Vec::new();
        loop {
            let statement = match self.kind() {
                TokenKind::Word(Word::If) => self.nested(Self::if_statement)?,
                TokenKind::Word(Word::While) => self.nested(Self::while_statement)?,
                TokenKind::Word(Word::S) => self.assignment()?,
                TokenKind::Name => {
                    let name = self.text();
                    if name == self.own_name || functions::find(&name).is_some() {
                        self.check_assigned()?;
                        return Ok(statements);
                    }
                    self.assignment()?
                }
                _ => {
                    self.check_assigned()?;
                    return Ok(statements);
                }
            };
            statements.push(statement);
        }
    }
    /// Fails at an assignment to a reserved name, which cannot begin a statement.
    fn check_assigned(&self) -> ParseResult<()> {
        let next = self.tokens.get(self.at + 1).map(|t| t.kind);
        let is_item = matches!(self.kind(), TokenKind::Word(Word::X | Word::A));
        let is_assigned = matches!(next, Some(TokenKind::Symbol("=")))
            || (is_item && matches!(next, Some(TokenKind::Symbol("["))));
        match self.reserved().filter(|_| is_assigned) {
            Some(meaning) => self.fail(
                self.start(),
                format!(
                    "nothing can be assigned to {}: this name is reserved, {meaning}; a variable \
                     needs another",
                    self.found()
                ),
            ),
            None => Ok(()),
        }
    }

    /// Reads if condition then block \[else block\] endif;
    fn if_statement(&mut self) -> ParseResult<Statement> {
        let at = self.advance().start;
        let condition = self.condition()?.0;
        self.word(Word::Then, "`then`")?;
        let then = self.block()?;
        let otherwise = if self.is_word(Word::Else) {
            self.advance();
            Some(self.block()?)
        } else {
            None
        };
        self.word(
            Word::Endif,
            if otherwise.is_some() {
                "`endif`"
            } else {
                "`else` or `endif`"
            },
        )?;
        self.symbol(";", "semicolon `;`")?;
        Ok(Statement::If {
            at,
            condition,
            then,
            otherwise,
        })
    }

    /// Reads while condition loop block endloop;
    fn while_statement(&mut self) -> ParseResult<Statement> {
        let at = self.advance().start;
        let condition = self.condition()?.0;
        self.word(Word::Loop, "`loop`")?;
        let body = self.block()?;
        self.word(Word::Endloop, "`endloop`")?;
        self.symbol(";", "semicolon `;`")?;
        Ok(Statement::While {
            at,
            condition,
            body,
        })
    }

    /// Reads name = expression; or array\[index\] = expression; or array = \[numbers\];
    fn assignment(&mut self) -> ParseResult<Statement> {
        let name = self.text();
        let is_attributes = self.is_word(Word::S);
        let start = self.advance().start;
        let statement = match self.names.get(&name).copied() {
            Some(NameMeaning::Array(array)) if self.is_symbol("[") => {
                self.advance();
                let index = self.nested(Self::expr)?;
                self.symbol("]", "right bracket `]`")?;
                self.symbol("=", "`=`")?;
                Statement::AssignItem {
                    array,
                    index,
                    value: self.expr()?,
                }
            }
            Some(NameMeaning::Array(array)) => {
                self.symbol("=", "`[` or `=`")?;
                if is_attributes && !self.is_symbol("[") {
                    let found = self.found();
                    let message = format!(
                        "left bracket `[` expected, found {found}: the name `s` is reserved, {}; \
                         a variable needs another",
                        Word::S.meaning()
                    );
                    return self.fail(self.start(), message);
                }
                Statement::AssignArray {
                    array,
                    values: self.literal(array.len)?,
                    span: (start, self.start()),
                }
            }
            known => {
                self.symbol("=", "`=`")?;
                let value = self.expr()?;
                // The variable is defined after its value: a name is undefined in its own first
                // value.
                let slot = match known {
                    Some(NameMeaning::Variable(slot)) => slot,
                    _ => self.new_variable(name)?,
                };
                Statement::Assign { slot, value }
            }
        };
        self.symbol(";", "semicolon `;`")?;
        Ok(statement)
    }
    /// Reserves a slot in memory for a new variable.
    fn new_variable(&mut self, name: String) -> ParseResult<u32> {
        let slot = self.memory;
        self.memory += 1;
        self.names.insert(name.clone(), NameMeaning::Variable(slot));
        self.variables.push(name);
        Ok(slot)
    }

    /// Reads \[ number, … \] with exactly `len` signed numbers.
    fn literal(&mut self, len: u32) -> ParseResult<Vec<f64>> {
        self.symbol("[", "left bracket `[`")?;
        let mut values = Vec::new();
        for i in 0..len {
            if i > 0 {
                self.symbol(
                    ",",
                    &format!("comma `,` (the array has {len} items, each a signed number)"),
                )?;
            }
            let negative = self.is_symbol("-");
            if negative || self.is_symbol("+") {
                self.advance();
            }
            let TokenKind::Number(value) = self.kind() else {
                return self.expected("a number");
            };
            self.advance();
            values.push(if negative { -value } else { value });
        }
        self.symbol("]", &format!("right bracket `]` after {len} numbers"))?;
        Ok(values)
    }

    /// Returns the operator of the present token, if `those` accepts it.
    fn operator(&self, those: impl Fn(Operator) -> bool) -> Option<Operator> {
        let operator = match self.kind() {
            TokenKind::Symbol(symbol) => Operator::from_text(symbol)?,
            TokenKind::Word(Word::And) => Operator::And,
            TokenKind::Word(Word::Or) => Operator::Or,
            _ => return None,
        };
        those(operator).then_some(operator)
    }

    /// Reads operand (operator operand)*, from left to right.
    fn chain(
        &mut self,
        those: impl Fn(Operator) -> bool,
        first: Expr,
        mut operand: impl FnMut(&mut Self) -> ParseResult<Expr>,
    ) -> ParseResult<Expr> {
        let mut rest = Vec::new();
        while let Some(operator) = self.operator(&those) {
            let at = self.advance().start;
            rest.push(Link {
                at,
                operator,
                operand: operand(self)?,
            });
        }
        Ok(if rest.is_empty() {
            first
        } else {
            Expr::Chain {
                first: Box::new(first),
                rest,
            }
        })
    }

    /// Reads a condition; returns it, and true if it is a plain expression. A plain expression in
    /// parentheses may begin a longer one: `(x[1]+1)*2 > 3`.
    fn condition(&mut self) -> ParseResult<(Expr, bool)> {
        let (first, plain) = self.comparison()?;
        let plain = plain && self.operator(|o| o.level() == Level::Logic).is_none();
        Ok((
            self.chain(
                |o| o.level() == Level::Logic,
                first,
                |p| Ok(p.comparison()?.0),
            )?,
            plain,
        ))
    }
    /// Reads expressions joined by comparisons; returns them, and true for a plain expression.
    fn comparison(&mut self) -> ParseResult<(Expr, bool)> {
        let (first, plain) = self.condition_primary()?;
        let plain = plain && self.operator(|o| o.level() == Level::Comparison).is_none();
        Ok((
            self.chain(
                |o| o.level() == Level::Comparison,
                first,
                |p| Ok(p.condition_primary()?.0),
            )?,
            plain,
        ))
    }
    /// Reads not condition, (condition), or an expression; returns it, and true for a plain
    /// expression.
    fn condition_primary(&mut self) -> ParseResult<(Expr, bool)> {
        let at = self.start();
        if self.is_word(Word::Not) {
            self.advance();
            let operand = Box::new(self.nested(Self::condition_primary)?.0);
            return Ok((Expr::Not { at, operand }, false));
        }
        if self.is_symbol("(") {
            self.advance();
            let (inner, plain) = self.nested(Self::condition)?;
            self.symbol(")", "right parenthesis `)`")?;
            let group = Expr::Group {
                at,
                inner: Box::new(inner),
            };
            return if plain {
                Ok((self.expr_from(Some(group))?, true))
            } else {
                Ok((group, false))
            };
        }
        Ok((self.expr()?, true))
    }

    /// Reads an expression.
    fn expr(&mut self) -> ParseResult<Expr> {
        self.expr_from(None)
    }
    /// Reads an expression, whose first primary may have been read already.
    fn expr_from(&mut self, begun: Option<Expr>) -> ParseResult<Expr> {
        let first = self.sum(begun)?;
        if self.precedence == Precedence::Documented {
            return self.chain(|o| o.is_set_operator(), first, |p| p.sum(None));
        }
        self.warn_of_precedence(&first);
        Ok(first)
    }
    /// Reads a sum of products; set operators have equal precedence unless the documented one is
    /// requested.
    fn sum(&mut self, begun: Option<Expr>) -> ParseResult<Expr> {
        let first = self.product(begun)?;
        let only_sums = self.precedence == Precedence::Documented;
        let here = |o: Operator| o.level() == Level::Sum && !(only_sums && o.is_set_operator());
        self.chain(here, first, |p| p.product(None))
    }
    /// Reads powers joined by * and /.
    fn product(&mut self, begun: Option<Expr>) -> ParseResult<Expr> {
        let first = self.power(begun)?;
        self.chain(|o| o.level() == Level::Product, first, |p| p.power(None))
    }
    /// Reads primaries joined by ^, from left to right.
    fn power(&mut self, begun: Option<Expr>) -> ParseResult<Expr> {
        let first = match begun {
            Some(expr) => expr,
            None => self.unary()?,
        };
        self.chain(|o| o.level() == Level::Power, first, Self::unary)
    }

    /// Reads a signed primary, a parenthesis, a number, or a named primary.
    fn unary(&mut self) -> ParseResult<Expr> {
        let token = self.token();
        let at = token.start;
        match token.kind {
            TokenKind::Symbol(sign @ ("+" | "-" | "~")) => {
                self.advance();
                Ok(Expr::Sign {
                    at,
                    sign,
                    operand: Box::new(self.nested(Self::unary)?),
                })
            }
            TokenKind::Symbol("(") => {
                self.advance();
                let inner = Box::new(self.nested(Self::expr)?);
                self.symbol(")", "right parenthesis `)`")?;
                Ok(Expr::Group { at, inner })
            }
            TokenKind::Number(value) => {
                self.advance();
                Ok(Expr::Number { at, value })
            }
            TokenKind::Name | TokenKind::Word(Word::X | Word::A | Word::S) => self.named(at),
            _ => self.expected("an expression"),
        }
    }

    /// Reads a call of a function or an object, a variable, or an item of an array.
    fn named(&mut self, at: u32) -> ParseResult<Expr> {
        let name = self.text();
        if let Some(function) = functions::find(&name) {
            self.advance();
            return self.function(at, function);
        }
        if let Some(function) = functions::find_of_file(&name).filter(|_| self.names_file()) {
            self.advance();
            return self.file_function(at, function);
        }
        let next_is_parenthesis = matches!(
            self.tokens.get(self.at + 1),
            Some(Token {
                kind: TokenKind::Symbol("("),
                ..
            })
        );
        match (
            self.names.get(&name).copied(),
            self.object_names.get(&name).copied(),
        ) {
            (_, Some(object)) if next_is_parenthesis => {
                self.advance();
                self.call(at, object)
            }
            (Some(NameMeaning::Variable(slot)), _) => {
                self.advance();
                Ok(Expr::Variable { at, slot })
            }
            (Some(NameMeaning::Array(array)), _) => {
                self.advance();
                self.symbol("[", "left bracket `[`")?;
                let index = Box::new(self.nested(Self::expr)?);
                self.symbol("]", "right bracket `]`")?;
                Ok(Expr::Item { at, array, index })
            }
            (None, Some(_)) => {
                self.advance();
                self.expected("left parenthesis `(`")
            }
            (None, None) => self.unassigned(at, &name, next_is_parenthesis),
        }
    }
    /// Returns the error that a name is undefined.
    fn unassigned<T>(&self, at: u32, name: &str, called: bool) -> ParseResult<T> {
        if name == self.own_name {
            let message = format!("`{name}` is the result of this object and has no value here");
            return self.fail(at, message);
        }
        if called && functions::find_of_file(name).is_some() {
            let message = format!("`{name}` needs the name of a file in double quotes");
            let hint = format!("{name}(\"part.stl\"), or {name}(p, \"part.stl\") at a point p");
            return Err(self.source.error(at, message, hint));
        }
        let mut known: Vec<&str> = Vec::new();
        let message = if called {
            known.extend(self.object_names.keys().map(String::as_str));
            for function in functions::names() {
                known.push(function);
            }
            format!("there is no function `{name}`, and no object of this name before this one")
        } else {
            known.extend(self.names.keys().map(String::as_str));
            format!("`{name}` has no value here: nothing is assigned to it before")
        };
        let hint = suggestion(name, known).unwrap_or_default();
        Err(self.source.error(at, message, hint))
    }

    /// Reads the arguments of a library function and checks them against its signature.
    fn function(&mut self, at: u32, function: u16) -> ParseResult<Expr> {
        let entry = functions::entry(function);
        let shapes = entry.arguments;
        let usage = |_: &Self| format!("{}: {}", entry.signature(), entry.help);
        self.symbol_with("(", "left parenthesis `(`", usage)?;
        let mut arguments = Vec::with_capacity(shapes.len());
        let mut elements = 0;
        for (i, (what, shape)) in shapes.iter().enumerate() {
            if i > 0 {
                self.symbol_with(",", &format!("comma `,` and the argument `{what}`"), usage)?;
            }
            if *shape == ArgumentShape::Number {
                arguments.push(Argument::Number(self.nested(Self::expr)?));
                continue;
            }
            let (at, array) = self.array_argument(what)?;
            elements = shape.elements(array.len).unwrap_or(elements);
            if let Some(wanted) = shape.refuses(array.len, elements, self.mode) {
                return self.fail(
                    at,
                    format!(
                        "`{what}` must be an array of {wanted}, this one has {}",
                        array.len
                    ),
                );
            }
            arguments.push(Argument::Array(at, array));
        }
        self.symbol_with(")", "right parenthesis `)`", usage)?;
        Ok(Expr::Function {
            at,
            function,
            arguments,
        })
    }

    /// Returns true if the name of a file is the first argument after the present token, or the
    /// second after an array.
    fn names_file(&self) -> bool {
        let kinds = self.tokens[self.at + 1..].iter().map(|token| token.kind);
        let kinds: Vec<TokenKind> = kinds.take(4).collect();
        matches!(
            kinds[..],
            [TokenKind::Symbol("("), TokenKind::Text, ..]
                | [
                    TokenKind::Symbol("("),
                    _,
                    TokenKind::Symbol(","),
                    TokenKind::Text
                ]
        )
    }

    /// Reads the arguments of the function of a file: (\[point,\] "name" \[, accuracy\]), where the
    /// point is x if it is not given.
    fn file_function(&mut self, at: u32, function: u16) -> ParseResult<Expr> {
        let entry = functions::entry(function);
        let usage = |_: &Self| format!("{}: {}", entry.signature(), entry.help);
        self.symbol_with("(", "left parenthesis `(`", usage)?;
        let point = if self.kind() == TokenKind::Text {
            let Some(NameMeaning::Array(x)) = self.names.get("x").copied() else {
                return self.expected("the name of an array for the point");
            };
            (at, x)
        } else {
            let point = self.array_argument("x")?;
            self.symbol(",", "comma `,`")?;
            point
        };
        if point.1.len != 3 {
            let message = format!("the point must have 3 items, this one has {}", point.1.len);
            return self.fail(point.0, message);
        }
        let name = self.advance();
        let path = &self.source.text()[name.start as usize + 1..name.end as usize - 1];
        let mut accuracy = None;
        if entry.arguments.len() > 2 && self.is_symbol(",") {
            self.advance();
            accuracy = match self.kind() {
                TokenKind::Number(value) if value > 0.0 => Some(value),
                _ => return self.expected("a number above 0, the accuracy"),
            };
            self.advance();
        }
        self.symbol_with(")", "right parenthesis `)`", usage)?;
        let term = FileTerm::new(
            entry.names[0],
            path,
            accuracy,
            self.source.place(name.start),
        );
        let known = self.files.iter().position(|file| file.is_same(&term));
        let file = known.unwrap_or(self.files.len());
        if known.is_none() {
            self.files.push(term);
        }
        let mut arguments = vec![
            Argument::Array(point.0, point.1),
            Argument::Number(Expr::Number {
                at: name.start,
                value: file as f64,
            }),
        ];
        if let Some(value) = accuracy {
            let at = name.start;
            arguments.push(Argument::Number(Expr::Number { at, value }));
        }
        Ok(Expr::Function {
            at,
            function,
            arguments,
        })
    }

    /// Reads the bare name of an array.
    fn array_argument(&mut self, what: &str) -> ParseResult<(u32, ArrayRef)> {
        let at = self.start();
        let name = match self.kind() {
            TokenKind::Name | TokenKind::Word(Word::X | Word::A | Word::S) => self.text(),
            _ => String::new(),
        };
        let Some(NameMeaning::Array(array)) = self.names.get(&name).copied() else {
            let hint =
                "`array v[3];` at the start of the object, `v = [0, 0, 0];` after it, and `v` here";
            return self.expected_with(&format!("the name of an array for `{what}`"), hint);
        };
        self.advance();
        if !self.is_symbol(",") && !self.is_symbol(")") {
            return self.fail(
                at,
                format!("`{what}` must be a whole array, its name alone"),
            );
        }
        Ok((at, array))
    }

    /// Reads the arguments of an object defined before: whole arrays of the sizes in its head.
    fn call(&mut self, at: u32, object: u32) -> ParseResult<Expr> {
        let called = &self.objects[object as usize];
        let (depth, name) = (called.depth, called.name.clone());
        let wanted: Vec<(String, u32)> = called.arrays[..HEAD_ARRAYS]
            .iter()
            .map(|a| (a.name.clone(), a.len))
            .collect();
        self.go_deeper(depth + 1)?;
        self.symbol("(", "left parenthesis `(`")?;
        let mut arguments = Vec::with_capacity(HEAD_ARRAYS);
        for (i, (what, len)) in wanted.iter().enumerate() {
            if i == 2 && *len == 1 && self.is_symbol(")") {
                break;
            }
            if i > 0 {
                self.symbol(
                    ",",
                    &format!("comma `,` and the array for `{what}` of `{name}`"),
                )?;
            }
            let (at, array) = self.array_argument(what)?;
            if array.len != *len {
                return self.fail(
                    at,
                    format!(
                        "`{what}` of `{name}` has {len} items, this array has {}",
                        array.len
                    ),
                );
            }
            arguments.push((at, array));
        }
        self.symbol(")", "right parenthesis `)`")?;
        Ok(Expr::Call {
            at,
            object,
            arguments,
        })
    }

    /// Warns of a sum operator after a set operator: HyperFun's documentation gives set operators a
    /// lower precedence, its implementation an equal one.
    fn warn_of_precedence(&mut self, sum: &Expr) {
        let Expr::Chain { rest, .. } = sum else {
            return;
        };
        let mut links = rest.iter().skip_while(|l| !l.operator.is_set_operator());
        let Some(set) = links.next() else { return };
        if let Some(link) = links.find(|l| !l.operator.is_set_operator()) {
            let (line, column) = self.source.position(link.at);
            let (set, op) = (set.operator.text(), link.operator.text());
            self.warnings.push(Warning {
                line,
                column,
                message: format!(
                    "`{op}` after `{set}` without parentheses: read from left to right, (u {set} v) {op} w; \
                     HyperFun's documentation would read u {set} (v {op} w)"
                ),
            });
        }
    }
}
