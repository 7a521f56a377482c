//! Options of reading HyperFun programs.

use isoform::field::hyperfun::{Mode, Model, Precedence, SyntaxError};

/// Options of reading a program, equal for all verbs.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Language {
    /// The object to evaluate [default: my_model, else the first one]
    #[arg(long, value_name = "NAME")]
    pub(crate) object: Option<String>,
    /// Compute what the reference implementation computes, its faults included
    #[arg(long)]
    pub(crate) strict: bool,
    /// Let set operators bind weaker than + and -, as HyperFun's documentation says
    #[arg(long)]
    pub(crate) documented_precedence: bool,
}

impl Language {
    /// True if a program is read as usual.
    pub(crate) fn is_default(&self) -> bool {
        self.object.is_none() && !self.strict && !self.documented_precedence
    }
}

/// Returns the first object of a program, without printing its warnings.
pub(crate) fn parse(text: &str, language: &Language) -> Result<Model, SyntaxError> {
    let mode = if language.strict {
        Mode::Strict
    } else {
        Mode::Default
    };
    let precedence = if language.documented_precedence {
        Precedence::Documented
    } else {
        Precedence::Flat
    };
    Model::parse_with(text, mode, precedence)
}
