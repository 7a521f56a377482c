//! Requests: the arguments of a verb as JSON, and the schema of them.
//!
//! The declaration of a verb is that of its arguments on the command line. A request names these
//! arguments, with `_` in place of `-`, and is turned into the words of a command line: all ways to
//! a verb accept equal values, with equal checks.

use crate::disk;
use crate::failure::Failure;
use crate::help::HELP;
use clap::{Arg, ArgAction, Command};
use isoform::field::similar;
use serde_json::{Map, Value, json};
use std::any::TypeId;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Key of a request that names its verb.
const VERB: &str = "verb";

/// Verbs that are not for requests.
const APART: [&str; 5] = ["run", "schema", "completions", "studio", "help"];

/// Runs a request: a verb with its arguments, as JSON
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform run request.json
  echo '{\"verb\": \"mesh\", \"model\": \"part.hf\", \"size\": 0.25, \"output\": [\"part.msh\"]}' | isoform run -

The keys are the names of the verb's arguments on the command line, with _ in place of -: flags are
true, what may be repeated is a list, NAME=VALUE is an object. `isoform schema` describes them.")]
pub(crate) struct RunArgs {
    /// The request (- for stdin)
    pub(crate) file: PathBuf,
}

/// Prints the JSON schema of requests
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  isoform schema
  isoform schema mesh
  isoform schema --page")]
pub(crate) struct SchemaArgs {
    /// The verb [default: all of them]
    pub(crate) verb: Option<String>,
    /// Print the page docs/options.md instead: all options of all verbs
    #[arg(long, conflicts_with = "verb")]
    pub(crate) page: bool,
}

/// Reads a request from a file; returns the words of its command line.
pub(crate) fn read(path: &Path, command: &Command) -> Result<Vec<OsString>, Failure> {
    let text = disk::text(disk::read_file(path)?);
    let text = text.trim_start_matches('\u{feff}');
    let json: Value = serde_json::from_str(text).map_err(|e| {
        let (line, column) = (e.line().max(1), e.column().max(1));
        Failure::input("json", format!("not JSON: {e}"))
            .at(path, line, column)
            .drawn(text.lines().nth(line - 1).unwrap_or_default())
    })?;
    let mut wrong = None;
    let named = match json {
        Value::Object(mut fields) => match fields.shift_remove(VERB) {
            Some(Value::String(verb)) => Some((verb, fields)),
            _ => {
                wrong = Some("the key `verb` is missing");
                None
            }
        },
        _ => None,
    };
    let Some((verb, fields)) = named else {
        let message = wrong.unwrap_or("an object is expected");
        return Err(
            Failure::input("request", format!("{}: {message}", path.display()))
                .hint(r#"{"verb": "mesh", "model": "part.hf", "size": 0.25}"#),
        );
    };
    words(&verb, &fields, command)
}

/// Returns the words of the command line that gives these arguments to a verb.
pub(crate) fn words(
    verb: &str,
    fields: &Map<String, Value>,
    command: &Command,
) -> Result<Vec<OsString>, Failure> {
    let Some(verb) = verbs(command).find(|c| c.get_name() == verb) else {
        let names: Vec<&str> = verbs(command).map(Command::get_name).collect();
        let near = similar(verb, names.iter().copied());
        let hint = if near.is_empty() { names } else { near };
        return Err(Failure::usage(format!("no verb is called `{verb}`"))
            .hint(format!("one of: {}", hint.join(", "))));
    };
    let (mut options, mut positional) = (Vec::new(), Vec::new());
    for (key, value) in fields {
        let Some(argument) = argument(verb, command, key) else {
            let all: Vec<String> = arguments(verb, command).map(name).collect();
            let near = similar(key, all.iter().map(String::as_str));
            let hint = if near.is_empty() {
                all.join(", ")
            } else {
                near.join(", ")
            };
            return Err(
                Failure::usage(format!("{} takes no `{key}`", verb.get_name()))
                    .hint(format!("one of: {hint}")),
            );
        };
        let wrong = |what: String| Failure::usage(format!("{}: {what}", name(argument)));
        match argument.get_long() {
            Some(long) => options.extend(option_words(long, argument, value).map_err(wrong)?),
            None => {
                let place = verb.get_positionals().position(|p| p == argument);
                let words = listed(value).map_err(wrong)?;
                if words.len() > 1 && !matches!(argument.get_action(), ArgAction::Append) {
                    return Err(wrong("one value is expected".to_owned()));
                }
                positional.push((place, words));
            }
        }
    }
    positional.retain(|p: &(_, Vec<String>)| !p.1.is_empty());
    positional.sort_by_key(|p| p.0);
    // A command line gives the first ones first.
    for (k, (place, _)) in positional.iter().enumerate() {
        if *place != Some(k)
            && let Some(missing) = verb.get_positionals().nth(k)
        {
            let message = format!("{}: `{}` is missing", verb.get_name(), name(missing));
            return Err(Failure::usage(message));
        }
    }
    let mut words = vec![verb.get_name().to_owned()];
    words.extend(options);
    // Nothing behind it is taken for an option.
    words.push("--".to_owned());
    words.extend(positional.into_iter().flat_map(|p| p.1));
    Ok(words.into_iter().map(OsString::from).collect())
}

/// Returns the verbs that requests may name.
fn verbs(command: &Command) -> impl Iterator<Item = &Command> {
    let is_verb = |c: &&Command| !APART.contains(&c.get_name());
    command.get_subcommands().filter(is_verb)
}

/// Returns the arguments of a verb, those that all verbs share last.
fn arguments<'c>(verb: &'c Command, command: &'c Command) -> impl Iterator<Item = &'c Arg> {
    let global = command.get_arguments().filter(|a| a.is_global_set());
    let is_told =
        |a: &&Arg| !a.is_hide_set() && !["help", "version"].contains(&a.get_id().as_str());
    let own = verb
        .get_arguments()
        .filter(|a| !a.is_global_set() && a.get_id() != HELP);
    own.chain(global).filter(is_told)
}

/// Returns the key of an argument in requests.
fn name(argument: &Arg) -> String {
    let long = argument.get_long().unwrap_or(argument.get_id().as_str());
    long.replace('-', "_")
}

/// Returns the argument of a key.
fn argument<'c>(verb: &'c Command, command: &'c Command, key: &str) -> Option<&'c Arg> {
    arguments(verb, command).find(|a| name(a) == key)
}

/// Returns the words of one option.
fn option_words(long: &str, argument: &Arg, value: &Value) -> Result<Vec<String>, String> {
    let with = |text: String| format!("--{long}={text}");
    Ok(match (argument.get_action(), value) {
        (_, Value::Null) => Vec::new(),
        (ArgAction::SetTrue | ArgAction::Count, Value::Bool(false)) => Vec::new(),
        (ArgAction::SetTrue | ArgAction::Count, Value::Bool(true)) => vec![format!("--{long}")],
        (ArgAction::SetTrue | ArgAction::Count, _) => {
            return Err("true or false is expected".to_owned());
        }
        (ArgAction::Append, value) => listed(value)?.into_iter().map(with).collect(),
        (_, value) => {
            let items = listed(value)?;
            if items.len() > 1 && is_text(argument) {
                return Err("one value is expected".to_owned());
            }
            vec![with(items.join(","))]
        }
    })
}

/// True if the value of an argument is a text, or the path of a file.
fn is_text(argument: &Arg) -> bool {
    let id = argument.get_value_parser().type_id();
    id == TypeId::of::<String>() || id == TypeId::of::<PathBuf>()
}

/// Returns the items of a value as texts: those of a list, NAME=VALUE of an object.
fn listed(value: &Value) -> Result<Vec<String>, String> {
    let item = |value: &Value| match value {
        Value::Null => Err("a value is null".to_owned()),
        value => listed(value),
    };
    Ok(match value {
        Value::Null => Vec::new(),
        Value::String(text) => vec![text.clone()],
        Value::Array(items) => {
            let items: Result<Vec<Vec<String>>, String> = items.iter().map(item).collect();
            items?.concat()
        }
        Value::Object(fields) => {
            let pair = |(key, value): (&String, &Value)| match item(value)?.as_slice() {
                [value] => Ok(format!("{key}={value}")),
                _ => Err(format!("{key}: one value is expected")),
            };
            fields.iter().map(pair).collect::<Result<_, String>>()?
        }
        other => vec![other.to_string()],
    })
}

/// Returns the JSON schema of requests, of one verb or of all.
pub(crate) fn schema(only: Option<&str>, command: &Command) -> Result<Value, Failure> {
    if let Some(only) = only
        && !verbs(command).any(|c| c.get_name() == only)
    {
        let names: Vec<&str> = verbs(command).map(Command::get_name).collect();
        return Err(Failure::usage(format!("no verb is called `{only}`"))
            .hint(format!("one of: {}", names.join(", "))));
    }
    let chosen = verbs(command).filter(|c| only.is_none_or(|only| c.get_name() == only));
    let of_verb = |verb: &Command| {
        let mut properties = Map::new();
        properties.insert(VERB.to_owned(), json!({"const": verb.get_name()}));
        let mut required = vec![VERB.to_owned()];
        for argument in arguments(verb, command) {
            properties.insert(name(argument), of_argument(argument));
            if argument.is_required_set() {
                required.push(name(argument));
            }
        }
        json!({
            "title": verb.get_name(),
            "description": verb.get_about().map(ToString::to_string),
            "type": "object",
            "properties": properties,
            "required": required,
            "additionalProperties": false,
        })
    };
    let all: Vec<Value> = chosen.map(of_verb).collect();
    Ok(json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A request to Isoform",
        "oneOf": all,
    }))
}

/// Returns the page of all options of all verbs, docs/options.md.
pub(crate) fn page(command: &Command) -> String {
    let mut page = "# Options\n\nAll verbs and their options, written by `isoform schema --page`. \
        In Python, and in\nrequests (`isoform run request.json`), `--time-limit` is `time_limit`.\n"
        .to_owned();
    for verb in verbs(command) {
        let about = verb.get_about().map(ToString::to_string);
        let own = arguments(verb, command).filter(|a| !a.is_global_set());
        page += &section(verb.get_name(), about.as_deref().unwrap_or_default(), own);
    }
    let all = command.get_arguments().filter(|a| a.is_global_set());
    page + &section("All verbs", "Options that every verb takes", all)
}

/// Returns a section of the page with a table of arguments.
fn section<'a>(title: &str, about: &str, arguments: impl Iterator<Item = &'a Arg>) -> String {
    let mut text = format!("\n## {title}\n\n{about}.\n\n| | |\n|---|---|\n");
    for argument in arguments {
        let values = argument.get_value_names().unwrap_or_default();
        let values: Vec<&str> = values.iter().map(clap::builder::Str::as_str).collect();
        let is_flag = !argument.get_action().takes_values();
        let value = match (argument.get_long(), is_flag) {
            (Some(long), true) => format!("--{long}"),
            (Some(long), false) => format!("--{long} {}", values.join(" ")),
            (None, _) => values.join(" "),
        };
        let short = argument
            .get_short()
            .map_or(String::new(), |c| format!("`-{c}`, "));
        let help = argument
            .get_help()
            .map(ToString::to_string)
            .unwrap_or_default();
        let mut cell = help.replace('|', "\\|").replace('\n', " ");
        let names: Vec<String> = (argument.get_possible_values().iter())
            .filter(|_| !is_flag)
            .map(|v| format!("`{}`", v.get_name()))
            .collect();
        if !names.is_empty() {
            cell += &format!(": {}", names.join(", "));
        }
        if let [default] = argument.get_default_values()
            && !is_flag
            && let Some(default) = default.to_str()
        {
            cell += &format!(" [default: {default}]");
        }
        text += &format!("| {short}`{}` | {cell} |\n", value.replace('|', "\\|"));
    }
    text
}

/// Returns the schema of an argument.
fn of_argument(argument: &Arg) -> Value {
    let mut schema = of_type(argument);
    if matches!(argument.get_action(), ArgAction::Append) {
        schema = match is_text(argument) {
            true => json!({"type": ["string", "array"], "items": schema}),
            false => json!({"type": ["string", "array", "object"], "items": schema}),
        };
    }
    if let Some(help) = argument.get_help() {
        schema["description"] = help.to_string().into();
    }
    if let [default] = argument.get_default_values()
        && let Some(text) = default.to_str()
    {
        let typed = serde_json::from_str(text).ok().filter(Value::is_number);
        schema["default"] = typed.unwrap_or_else(|| text.into());
    }
    schema
}

/// Returns the schema of one value.
fn of_type(argument: &Arg) -> Value {
    let names: Vec<String> = argument
        .get_possible_values()
        .iter()
        .map(|v| v.get_name().to_owned())
        .collect();
    let id = argument.get_value_parser().type_id();
    let is_one_of = |types: &[TypeId]| types.iter().any(|t| id == *t);
    if matches!(argument.get_action(), ArgAction::SetTrue | ArgAction::Count) {
        json!({"type": "boolean"})
    } else if is_one_of(&[
        TypeId::of::<u8>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
    ]) {
        json!({"type": "integer"})
    } else if !names.is_empty() {
        json!({"enum": names})
    } else if is_one_of(&[TypeId::of::<f64>()]) {
        json!({"type": "number"})
    } else if is_one_of(&[TypeId::of::<String>(), TypeId::of::<PathBuf>()]) {
        json!({"type": "string"})
    } else {
        // Numbers with commas, or NAME=VALUE.
        json!({"type": ["number", "string", "array", "object"]})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words_of(json: &str) -> Result<String, String> {
        let Ok(Value::Object(mut fields)) = serde_json::from_str(json) else {
            panic!("{json}");
        };
        let Some(Value::String(verb)) = fields.shift_remove(VERB) else {
            panic!("{json}");
        };
        let words = words(&verb, &fields, &crate::command(crate::help::Extent::Whole))
            .map_err(|e| e.message + ": " + &e.hint)?;
        let words: Vec<String> = words
            .into_iter()
            .filter_map(|w| w.into_string().ok())
            .collect();
        Ok(words.join(" "))
    }

    #[test]
    fn requests_are_command_lines() {
        for (json, words) in [
            (
                r#"{"verb": "mesh", "model": "-a.hf", "size": 0.25, "surface_only": true, "close": false,
                    "output": ["a.msh", "b.stl"], "box": [[-1, -2, -3], [1, 2, 3.5]]}"#,
                "mesh --size=0.25 --surface-only --output=a.msh --output=b.stl \
                 --box=-1,-2,-3,1,2,3.5 -- -a.hf",
            ),
            (
                r#"{"verb": "fit", "fix": {"radius": 2}, "scan": "s.ply", "template": "cup", "seed": 7}"#,
                "fit --fix=radius=2 --template=cup --seed=7 -- s.ply",
            ),
            (
                r#"{"verb": "compare", "second": "b", "first": "a", "params": {"r": 1, "h": 2}}"#,
                "compare --params=r=1,h=2 -- a b",
            ),
        ] {
            assert_eq!(words_of(json).as_deref(), Ok(words));
        }
        for (wrong, why) in [
            (
                r#"{"verb": "mesh", "params": [1, null]}"#,
                "params: a value is null",
            ),
            (
                r#"{"verb": "recover", "template": "cup"}"#,
                "`scan` is missing",
            ),
            (
                r#"{"verb": "render", "file": "a", "output": ["b", "c"]}"#,
                "one value",
            ),
            (r#"{"verb": "mesh", "close": 1}"#, "true or false"),
        ] {
            assert!(words_of(wrong).is_err_and(|e| e.contains(why)), "{wrong}");
        }
        let near = words_of(r#"{"verb": "mesh", "sise": 1}"#);
        assert_eq!(near, Err("mesh takes no `sise`: one of: size".to_owned()));
        assert!(words_of(r#"{"verb": "mash"}"#).is_err_and(|e| e.ends_with("mesh")));
    }

    /// `isoform schema --page > docs/options.md` writes it anew.
    #[test]
    fn the_page_of_options_is_not_stale() {
        let page = page(&crate::command(crate::help::Extent::Whole));
        assert!(
            page == include_str!("../../../docs/options.md"),
            "docs/options.md is stale"
        );
    }

    #[test]
    fn the_schema_names_every_argument_once() {
        let command = crate::command(crate::help::Extent::Whole);
        let schema = schema(None, &command).unwrap_or_else(|e| panic!("{}", e.message));
        let all = schema["oneOf"].as_array().expect("a list");
        assert_eq!(all.len(), verbs(&command).count());
        for (verb, schema) in verbs(&command).zip(all) {
            let keys = schema["properties"].as_object().expect("an object").len();
            assert_eq!(
                keys,
                1 + arguments(verb, &command).count(),
                "{}",
                verb.get_name()
            );
        }
        let mesh = &all[2]["properties"];
        assert_eq!(mesh["size"]["type"], "number");
        assert_eq!(mesh["output"]["type"], json!(["string", "array"]));
        assert_eq!(mesh["surface_only"]["type"], "boolean");
    }
}
