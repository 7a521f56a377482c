//! `isoform completions`: scripts that complete a command line in a shell.

use crate::gallery;
use clap_complete::Shell;

/// The script of a shell. Templates are a file or a name; the generator knows files only, so that
/// the names are put in here.
pub(crate) fn script(shell: Shell, command: &mut clap::Command) -> Vec<u8> {
    let mut script = Vec::new();
    clap_complete::generate(shell, command, "isoform", &mut script);
    match String::from_utf8(script) {
        Ok(text) => with_names(shell, &text).into_bytes(),
        Err(e) => e.into_bytes(),
    }
}

/// Phrase in the help of every template argument, and of no other argument.
const MARK: &str = "a HyperFun file or a name out of";

/// Returns the script with the names of the gallery added to the files of every template argument.
fn with_names(shell: Shell, text: &str) -> String {
    let names = gallery::names().join(" ");
    let mut lines: Vec<String> = Vec::new();
    // Bash: the line that follows the name of the option.
    let mut is_template = false;
    for line in text.lines() {
        let mut line = line.to_owned();
        let option = line.trim().to_owned();
        match shell {
            Shell::Bash => {
                if is_template && option.starts_with("COMPREPLY=") {
                    line = bash(&names);
                }
                // Only `fit` has an option -t.
                is_template = ["--template)", "-t)"].contains(&option.as_str())
                    || (is_template && !option.starts_with("return"));
            }
            Shell::Zsh if line.contains(MARK) => {
                let files = format!("{{compadd -- {names}; _files -g \"*.hf(-.)\"}}'");
                line = line.replace(":_files'", &format!(":{files}"));
            }
            Shell::Fish if line.contains(MARK) => line += &format!(" -a \"{names}\""),
            _ => {}
        }
        lines.push(line);
    }
    lines.join("\n") + "\n"
}

/// Names, programs, and folders on the way to them.
fn bash(names: &str) -> String {
    format!(
        "                    COMPREPLY=($(compgen -W \"{names}\" -- \"${{cur}}\") \
         $(compgen -f -X '!*.hf' -- \"${{cur}}\") $(compgen -d -S / -- \"${{cur}}\"))"
    )
}
