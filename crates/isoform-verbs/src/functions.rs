//! `isoform functions`: the reference of HyperFun's functions, from the table that executes them.

use crate::failure::{DONE, Failure};

use crate::outcome::Outcome;
use isoform::field::hyperfun::{FunctionHelp, library};
use isoform::field::suggestion;
use serde_json::{Value, json};

/// Describes the functions of HyperFun
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform functions
  isoform functions hfBlock
  isoform functions hfBlock --example > block.hf
  isoform view block.hf -o block.html")]
pub(crate) struct Args {
    /// Name of a function [default: all of them, a line each]
    name: Option<String>,
    /// Print a whole program that uses the function
    #[arg(long, requires = "name")]
    example: bool,
    /// Print the page docs/functions.md
    #[arg(long, conflicts_with = "name")]
    page: bool,
}

/// Runs the verb.
pub(crate) fn run(args: &Args) -> Result<Outcome, Failure> {
    let all = library();
    let Some(name) = &args.name else {
        if args.page {
            return Ok(Outcome::text(page(&all).into_bytes()));
        }
        return Ok(outcome(&all, list(&all)));
    };
    let Some(found) = all.iter().find(|f| is_called(f, name)) else {
        let names = all.iter().flat_map(|f| f.names.iter().copied());
        let hint = suggestion(name, names)
            .unwrap_or_else(|| "`isoform functions` lists all of them".to_owned());
        return Err(Failure::usage(format!("no function is called `{name}`")).hint(hint));
    };
    let text = if args.example {
        found.example.clone()
    } else {
        entry(found)
    };
    Ok(outcome(std::slice::from_ref(found), text))
}

/// Returns true if a word is the name of a function.
pub(crate) fn is_function(word: &str) -> bool {
    library().iter().any(|f| is_called(f, word))
}

/// Returns true if a function has a name; case is ignored, as in programs.
fn is_called(function: &FunctionHelp, name: &str) -> bool {
    function.names.iter().any(|n| n.eq_ignore_ascii_case(name))
}

/// Returns the outcome with some functions as JSON and a text for the terminal.
fn outcome(functions: &[FunctionHelp], text: String) -> Outcome {
    let described: Vec<Value> = functions.iter().map(described).collect();
    Outcome {
        exit: DONE,
        json: json!({ "functions": described }),
        stdout: text.into_bytes(),
    }
}

/// Returns a function as JSON.
fn described(function: &FunctionHelp) -> Value {
    let arguments = function.arguments.iter();
    let arguments: Vec<Value> = arguments
        .map(|(name, kind)| json!({"name": name, "type": kind}))
        .collect();
    json!({
        "names": function.names,
        "section": function.section,
        "signature": function.signature,
        "arguments": arguments,
        "help": function.help,
        "example": function.example,
    })
}

/// Returns the list of functions, a line each.
fn list(functions: &[FunctionHelp]) -> String {
    let mut text = String::new();
    for section in sections(functions) {
        text += &format!(
            "{}{}\n",
            if text.is_empty() { "" } else { "\n" },
            section[0].section
        );
        let width = section.iter().map(|f| f.names[0].len()).max().unwrap_or(0);
        for function in section {
            text += &format!("  {:width$}  {}\n", function.names[0], function.help);
        }
    }
    text
}

/// Splits the functions into their sections.
fn sections(functions: &[FunctionHelp]) -> impl Iterator<Item = &[FunctionHelp]> {
    functions.chunk_by(|a, b| a.section == b.section)
}

/// Returns the description of a function for the terminal.
fn entry(function: &FunctionHelp) -> String {
    let mut text = format!("{}\n\n{}\n\n", function.signature, function.help);
    let width = function.arguments.iter().map(|a| a.0.len()).max();
    let width = width.unwrap_or(0);
    for (name, kind) in &function.arguments {
        text += &format!("  {name:width$}  {kind}\n");
    }
    if let [_, others @ ..] = function.names.as_slice()
        && !others.is_empty()
    {
        text += &format!("\nAlso called {}.\n", others.join(", "));
    }
    text + "\nExample:\n\n" + &function.example
}

/// Text at the start of docs/functions.md.
const PAGE_HEAD: &str = "\
# Functions

All functions of HyperFun, written by `isoform functions --page`. `isoform help hfBlock` describes
one of them; its program is printed by

```
isoform functions hfBlock --example > block.hf
```

A solid is positive inside and zero on its surface. Lengths are in the units of the model, angles in
radians unless the text says degrees. Arrays are declared at the start of an object
([hyperfun.md](hyperfun.md)). Pictures show the programs under them.
";

/// Returns true if the page shows a picture of a function: of shapes, one for all three axes.
fn has_picture(function: &FunctionHelp) -> bool {
    let is_shape = !["Mathematics", "Attributes", "Files"].contains(&function.section);
    is_shape && !function.names[0].ends_with(['X', 'Y'])
}

/// Returns the page of all functions, docs/functions.md.
fn page(functions: &[FunctionHelp]) -> String {
    let mut text = PAGE_HEAD.to_owned();
    for section in sections(functions) {
        text += &format!("\n## {}\n", section[0].section);
        for function in section {
            text += &format!("\n### {}\n\n", function.names.join(", "));
            text += &format!("`{}`: {}\n", function.signature, function.help);
            let arguments: Vec<String> = function
                .arguments
                .iter()
                .filter(|(_, kind)| kind != "number")
                .map(|(name, kind)| format!("`{name}`: {kind}"))
                .collect();
            if !arguments.is_empty() {
                text += &format!("\n{}.\n", arguments.join("; "));
            }
            if has_picture(function) {
                let name = function.names[0];
                text += &format!("\n![{name}](images/{name}.png)\n");
            }
            text += &format!("\n```\n{}```\n", function.example);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `isoform functions --page > docs/functions.md` writes it anew; scripts/draw_functions.sh draws its
    /// pictures.
    #[test]
    fn the_page_of_functions_is_current() {
        assert!(
            page(&library()) == include_str!("../../../docs/functions.md"),
            "docs/functions.md is stale"
        );
    }
}
