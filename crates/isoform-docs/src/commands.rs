//! The commands in the blocks of pages.
//!
//! A block counts that has a command of isoform: a line that begins with `isoform`, or with
//! `$ isoform` where the block shows a prompt and what is printed. All of its commands count, since
//! later ones may need what earlier ones write. What `$ cat FILE` shows is that file, and a command
//! that is shown with an error is to end with it.

/// Something to be done in the folder of a page.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Act {
    /// A file is to be there with this text.
    File(String, String),
    /// A command is run.
    Run(String),
    /// A command is run, and refused with this line.
    Refused(String, String),
}

/// What the blocks of a page ask for, in their order.
pub(crate) fn acts(markdown: &str) -> Vec<Act> {
    blocks(markdown)
        .iter()
        .filter(|block| block.iter().any(|line| is_ours(line)))
        .flat_map(|block| of_block(block))
        .collect()
}

/// Whether a line is a command of isoform.
fn is_ours(line: &str) -> bool {
    let command = line.strip_prefix("$ ").unwrap_or(line);
    command.starts_with("isoform ")
}

/// The lines of fenced blocks.
fn blocks(markdown: &str) -> Vec<Vec<&str>> {
    let mut all = Vec::new();
    let mut open: Option<Vec<&str>> = None;
    for line in markdown.lines() {
        let is_fence = line.trim_start().starts_with("```");
        match (&mut open, is_fence) {
            (None, true) => open = Some(Vec::new()),
            (Some(_), true) => all.extend(open.take()),
            (Some(block), false) => block.push(line),
            (None, false) => {}
        }
    }
    all
}

fn of_block(block: &[&str]) -> Vec<Act> {
    if block.iter().any(|line| line.starts_with("$ ")) {
        of_session(block)
    } else {
        let all = block.join("\n").replace("\\\n", " ");
        let commands = all.lines().filter(|line| !line.trim().is_empty());
        commands.map(|line| Act::Run(line.to_owned())).collect()
    }
}

/// Commands behind a prompt; what is between them is what they print.
fn of_session(block: &[&str]) -> Vec<Act> {
    let mut acts: Vec<Act> = Vec::new();
    for line in block {
        if let Some(command) = line.strip_prefix("$ ") {
            acts.push(match command.strip_prefix("cat ") {
                Some(file) => Act::File(file.to_owned(), String::new()),
                None => Act::Run(command.to_owned()),
            });
            continue;
        }
        match acts.last_mut() {
            Some(Act::File(_, text)) => *text += &format!("{line}\n"),
            Some(Act::Run(command)) if line.starts_with("error: ") => {
                let refused = Act::Refused(std::mem::take(command), (*line).to_owned());
                acts.pop();
                acts.push(refused);
            }
            _ => {}
        }
    }
    acts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_with_our_commands() {
        let page = "```\ncargo test\n```\n\n```sh\ncp a b\nisoform fit b \\\n  -o c # why\n```\n";
        let run = |text: &str| Act::Run(text.to_owned());
        assert_eq!(
            acts(page),
            [run("cp a b"), run("isoform fit b    -o c # why")]
        );
        let session = "```\n$ cat f.hf\n-- one\ntwo\n$ isoform mesh f.hf\nprinted\n```\n";
        let file = Act::File("f.hf".to_owned(), "-- one\ntwo\n".to_owned());
        assert_eq!(acts(session), [file, run("isoform mesh f.hf")]);
        let refused = "```\n$ isoform eval x\nerror: no x\n  try: y\n```\n";
        let want = Act::Refused("isoform eval x".to_owned(), "error: no x".to_owned());
        assert_eq!(acts(refused), [want]);
        assert_eq!(acts("isoform fit x\n"), [], "no block");
    }
}
