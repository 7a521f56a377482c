//! Documentation as a site, and as a test.
//!
//! ```text
//! isoform-docs build FOLDER           writes the site; broken links are failures
//! isoform-docs run PROGRAM [PAGE...]  runs the commands of these pages, or of all of them
//! isoform-docs draw PROGRAM           copies the pictures that they draw into docs/images
//! ```
//!
//! A page refers by `images/NAME` to the picture that one of its commands, or of another page's,
//! writes as NAME. Pictures are committed although commands draw them: pages are also read where no
//! site is built, and a change shows its effect on them.
#![forbid(unsafe_code)]

mod commands;
mod notebook;
mod page;
mod pictures;
mod run;
mod site;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let done = match args.as_slice() {
        ["build", folder] => build(&root, Path::new(folder)),
        ["run", program, pages @ ..] => run::all(&root, Path::new(program), pages),
        ["draw", program] => run::draw(&root, Path::new(program)),
        _ => Err("usage: isoform-docs build FOLDER | run PROGRAM [PAGE...] | draw PROGRAM".into()),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

/// Writes the site; returns true if it is free of defects.
fn build(root: &Path, folder: &Path) -> Result<bool, Box<dyn Error>> {
    let site = site::Site::read(root)?;
    site.write(folder)?;
    let wrong = site.wrong();
    for line in &wrong {
        println!("{line}");
    }
    println!(
        "{}: {} pages, {} links",
        folder.join("index.html").display(),
        site.pages.len(),
        site.links()
    );
    Ok(wrong.is_empty())
}
