//! Printing: data on stdout, messages on stderr.

use crate::failure::Failure;
use crate::outcome::document;
use serde_json::json;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

/// Prints a line on stderr; a closed stderr is not an error.
pub(crate) fn say(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "{message}");
}

/// Reports a failure and ends the process, from a thread other than the working one.
pub(crate) fn give_up(json: bool, failure: &Failure) -> ! {
    let _ = fail(json, failure);
    std::process::exit(i32::from(failure.exit))
}

/// Reports a failure and returns its exit code.
pub(crate) fn fail(json: bool, failure: &Failure) -> ExitCode {
    say(failure.text());
    if json {
        let _ = to_stdout(&document(false, json!({"error": failure.json()})));
    }
    ExitCode::from(failure.exit)
}

/// Writes to stdout; a reader that has closed it is not an error.
pub(crate) fn to_stdout(bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}
