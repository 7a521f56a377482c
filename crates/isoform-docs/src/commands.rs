//! Commands in the code blocks of pages.
//!
//! A block counts if it contains a command of isoform: a line that begins with `isoform`, or with
//! `$ isoform` if the block shows a prompt and output. Then all of its commands count, since later
//! ones may need what earlier ones write. The text below `$ cat FILE` is the content of that file,
//! and a command shown with an error must fail with that error.

/// Step to be performed in the folder of a page.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum PageStep {
    /// Write a file (name, text).
    File(String, String),
    /// Run a command that must succeed.
    Run(String),
    /// Run a command that must fail with this line (command, line).
    Refused(String, String),
}

/// Returns the steps of a page's code blocks, in order.
pub(crate) fn steps(markdown: &str) -> Vec<PageStep> {
    blocks(markdown)
        .iter()
        .filter(|block| block.iter().any(|line| is_isoform(line)))
        .flat_map(|block| block_steps(block))
        .collect()
}

/// Returns true if a line is a command of isoform.
fn is_isoform(line: &str) -> bool {
    let command = line.strip_prefix("$ ").unwrap_or(line);
    command.starts_with("isoform ")
}

/// Returns the lines of each fenced block.
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

fn block_steps(block: &[&str]) -> Vec<PageStep> {
    if block.iter().any(|line| line.starts_with("$ ")) {
        session_steps(block)
    } else {
        let all = block.join("\n").replace("\\\n", " ");
        let commands = all.lines().filter(|line| !line.trim().is_empty());
        commands
            .map(|line| PageStep::Run(line.to_owned()))
            .collect()
    }
}

/// Returns the steps of a block with prompts; lines between commands are their output.
fn session_steps(block: &[&str]) -> Vec<PageStep> {
    let mut steps: Vec<PageStep> = Vec::new();
    for line in block {
        if let Some(command) = line.strip_prefix("$ ") {
            steps.push(match command.strip_prefix("cat ") {
                Some(file) => PageStep::File(file.to_owned(), String::new()),
                None => PageStep::Run(command.to_owned()),
            });
            continue;
        }
        match steps.last_mut() {
            Some(PageStep::File(_, text)) => *text += &format!("{line}\n"),
            Some(PageStep::Run(command)) if line.starts_with("error: ") => {
                let refused = PageStep::Refused(std::mem::take(command), (*line).to_owned());
                steps.pop();
                steps.push(refused);
            }
            _ => {}
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_with_our_commands() {
        let page = "```\ncargo test\n```\n\n```sh\ncp a b\nisoform fit b \\\n  -o c # why\n```\n";
        let run = |text: &str| PageStep::Run(text.to_owned());
        assert_eq!(
            steps(page),
            [run("cp a b"), run("isoform fit b    -o c # why")]
        );
        let session = "```\n$ cat f.hf\n-- one\ntwo\n$ isoform mesh f.hf\nprinted\n```\n";
        let file = PageStep::File("f.hf".to_owned(), "-- one\ntwo\n".to_owned());
        assert_eq!(steps(session), [file, run("isoform mesh f.hf")]);
        let refused = "```\n$ isoform eval x\nerror: no x\n  try: y\n```\n";
        let want = PageStep::Refused("isoform eval x".to_owned(), "error: no x".to_owned());
        assert_eq!(steps(refused), [want]);
        assert_eq!(steps("isoform fit x\n"), [], "no block");
    }
}
