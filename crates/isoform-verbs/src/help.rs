//! Order and groups of verbs and options in help, in one place for all verbs.

use clap::{Arg, ArgAction, Command};

/// Verbs by task. A verb that is missing here comes last.
const TASKS: [(&str, &[&str]); 4] = [
    (
        "From a scan",
        &["recover", "fit", "recognize", "implicitize"],
    ),
    (
        "From a program or formula",
        &["mesh", "brep", "parameterize", "triangulate", "eval"],
    ),
    (
        "Look and compare",
        &["studio", "view", "render", "inspect", "compare"],
    ),
    (
        "Other",
        &[
            "convert",
            "functions",
            "run",
            "schema",
            "completions",
            "help",
        ],
    ),
];

/// Title of the group of options that only one verb has.
const OWN: &str = "Options";
/// Name of the option that prints the help.
pub(crate) const HELP: &str = "help";
/// Title of the group of options that all verbs have.
pub(crate) const COMMON: &str = "Common";

/// Groups of options, in their order. Options that are missing here form the group [`OWN`].
const GROUPS: [(&str, &[&str]); 6] = [
    (
        "Output",
        &[
            "output", "to", "title", "report", "sidecar", "domain", "trace", "figure", "dialect",
            "frame", "ap214", "ascii", "grid", "units",
        ],
    ),
    (
        "Model",
        &[
            "params",
            "settings",
            "params_second",
            "region",
            "half_width",
            "rectangle",
            "polygon",
        ],
    ),
    (
        "Input",
        &[
            "from",
            "kind",
            "max_points",
            "no_outlier_filter",
            "keep_planes",
            "keep_apart",
        ],
    ),
    (
        "Size",
        &[
            "size",
            "grade",
            "sizes",
            "order",
            "surface_only",
            "angles",
            "memory",
            "tol",
            "longest",
            "triangles",
        ],
    ),
    (OWN, &[]),
    ("Language", &["object", "strict", "documented_precedence"]),
];

/// Groups whose options are in the short help.
const SHORT: [&str; 4] = ["Output", "Model", "Size", COMMON];

/// Returns the place of an option: its group, and its place there.
fn place(arg: &Arg) -> (usize, usize) {
    let id = arg.get_id().as_str();
    let find = |(group, (_, ids)): (usize, &(&str, &[&str]))| {
        ids.iter().position(|i| *i == id).map(|at| (group, at))
    };
    let own = GROUPS.iter().position(|group| group.0 == OWN);
    let listed = GROUPS.iter().enumerate().find_map(find);
    listed.unwrap_or((own.unwrap_or(0), 0))
}

/// Extent of the help.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// Options that most runs need.
    Short,
    /// All options and examples.
    Whole,
}

/// Sorts the options of all verbs into groups, and the verbs by task.
pub(crate) fn arranged(command: Command, extent: Extent) -> Command {
    let tasks = tasks(&command);
    command
        .mut_subcommands(|verb| grouped(verb, extent))
        .help_template("{about-with-newline}\n{usage-heading} {usage}{after-help}\n{options}")
        .after_help(tasks)
}

/// Returns the list of verbs by task.
fn tasks(command: &Command) -> String {
    let mut text = String::new();
    for (i, (task, verbs)) in TASKS.iter().enumerate() {
        text += &format!("{}{task}:\n", if i > 0 { "\n" } else { "" });
        for verb in *verbs {
            let about = command.find_subcommand(verb).and_then(Command::get_about);
            let about = match about {
                Some(about) => about.to_string(),
                None if *verb == HELP => "Prints the help of a verb or function".to_owned(),
                // A verb that this machine lacks.
                None => continue,
            };
            text += &format!("  {verb:<13} {about}\n");
        }
    }
    text += "\nisoform VERB -h is a short help, isoform VERB --help all of it with examples.\n";
    text + "\nCommon:"
}

/// Sorts the options of a verb into groups.
fn grouped(verb: Command, extent: Extent) -> Command {
    let is_short = extent == Extent::Short;
    let (options, mut args): (Vec<Arg>, Vec<Arg>) = verb
        .get_arguments()
        .cloned()
        .partition(|arg| !arg.is_positional());
    let mut options: Vec<Arg> = options
        .into_iter()
        .filter(|arg| !arg.is_global_set())
        .collect();
    options.sort_by_key(place);
    args.extend(options.into_iter().map(|arg| {
        let title = GROUPS[place(&arg).0].0;
        let is_hidden = arg.is_hide_set() || is_short && !SHORT.contains(&title);
        arg.help_heading(title).hide(is_hidden)
    }));
    let args = args
        .into_iter()
        .enumerate()
        .map(|(i, arg)| arg.display_order(i));
    // The flag that clap makes itself has a group of its own.
    let help = Arg::new(HELP).short('h').long(HELP).action(ArgAction::Help);
    let help = help
        .help("Print help")
        .help_heading(COMMON)
        .display_order(usize::MAX);
    let name = verb.get_name().to_owned();
    let more = format!("isoform {name} --help: all options, examples and exit codes");
    let mut new = Command::new(name)
        .args(args)
        .disable_help_flag(true)
        .arg(help)
        .groups(verb.get_groups().cloned());
    if let Some(about) = verb.get_about() {
        new = new.about(about.clone());
    }
    match verb.get_after_help() {
        Some(after) if !is_short => new.after_help(joined(&after.to_string())),
        Some(_) => new.after_help(more),
        None => new,
    }
}

/// Joins the lines of each paragraph, for clap to wrap them to the terminal; indented lines stay.
fn joined(text: &str) -> String {
    let mut joined = String::new();
    let mut is_open = false;
    for line in text.lines() {
        let is_text = !line.is_empty() && !line.starts_with(' ');
        if !joined.is_empty() {
            joined.push(if is_open && is_text { ' ' } else { '\n' });
        }
        joined += line;
        is_open = is_text && !line.ends_with(':');
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each verb is in the list of tasks, and each option of the lists is an option of a verb.
    #[test]
    fn lists_are_complete_and_have_no_other_names() {
        let command = crate::command(Extent::Whole);
        let listed: Vec<&str> = TASKS.iter().flat_map(|task| task.1).copied().collect();
        for verb in command.get_subcommands() {
            assert!(listed.contains(&verb.get_name()), "{}", verb.get_name());
        }
        for id in GROUPS.iter().flat_map(|group| group.1) {
            let mut verbs = command.get_subcommands();
            let is_option = |verb: &Command| verb.get_arguments().any(|a| a.get_id() == *id);
            assert!(verbs.any(is_option), "no verb has the option {id}");
        }
    }

    /// The output comes first, and the short help is shorter.
    #[test]
    fn help_begins_with_the_output() {
        let [long, short] = [Extent::Whole, Extent::Short].map(|extent| {
            let found = crate::command(extent).try_get_matches_from(["isoform", "mesh", "-h"]);
            found.expect_err("help").render().to_string()
        });
        let at = |text: &str, word: &str| text.find(word).unwrap_or(usize::MAX);
        let titles = [
            "Output:",
            "Model:",
            "Size:",
            "Options:",
            "Language:",
            "Common:",
        ];
        assert!(titles.is_sorted_by_key(|title| at(&long, title)), "{long}");
        assert!(at(&long, "--output") < at(&long, "--to"));
        assert!(long.contains("--strict") && long.contains("Examples:"));
        assert!(
            !short.contains("--strict") && !short.contains("Examples:"),
            "{short}"
        );
        assert!(short.contains("--size"));
        assert!(short.lines().count() < long.lines().count());
    }
}
