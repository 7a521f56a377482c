//! List of failures that are expected, tests/expected_failures.txt.

use std::collections::{BTreeMap, BTreeSet};

const LIST: &str = include_str!("../../../tests/expected_failures.txt");

/// Cases of one suite that are known to fail, each with its reason. A case that fails without being
/// listed is a failure, and so is a listed case that passes: the list can only shrink.
pub struct ExpectedFailures {
    reasons: BTreeMap<String, String>,
    seen: BTreeSet<String>,
    wrong: Vec<String>,
}

impl ExpectedFailures {
    /// Reads the entries of a suite.
    ///
    /// # Panics
    /// If a line of the list cannot be read.
    pub fn for_suite(suite: &str) -> Self {
        Self::read(LIST, suite)
    }

    fn read(list: &str, suite: &str) -> Self {
        let mut reasons = BTreeMap::new();
        for line in list.lines() {
            if line.trim().is_empty() || line.starts_with('#') {
                continue;
            }
            let fields: Vec<&str> = line.split(" | ").map(str::trim).collect();
            let [of, case, reason] = fields[..] else {
                panic!("expected failures: `{line}` is not `suite | case | reason`");
            };
            assert!(
                !reason.is_empty(),
                "expected failures: {case} has no reason"
            );
            if of == suite {
                let before = reasons.insert(case.to_owned(), reason.to_owned());
                assert!(before.is_none(), "expected failures: {case} stands twice");
            }
        }
        Self {
            reasons,
            seen: BTreeSet::new(),
            wrong: Vec::new(),
        }
    }

    /// Records the outcome of a case; `why` is only called if the case failed.
    pub fn note(&mut self, case: &str, passed: bool, why: impl FnOnce() -> String) {
        self.seen.insert(case.to_owned());
        match (self.reasons.get(case), passed) {
            (None, false) => self.wrong.push(format!("{case} fails: {}", why())),
            (Some(_), true) => self
                .wrong
                .push(format!("{case} passes: take it off the list")),
            (Some(reason), false) => println!("expected failure: {case}: {reason}"),
            (None, true) => {}
        }
    }

    /// Ends the suite: checks that every outcome was as expected and that every listed case was
    /// run.
    ///
    /// # Panics
    /// If either does not hold.
    pub fn finish(mut self) {
        for case in self.reasons.keys().filter(|c| !self.seen.contains(*c)) {
            self.wrong
                .push(format!("{case} is listed and was not tried"));
        }
        assert!(self.wrong.is_empty(), "{:#?}", self.wrong);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "# a comment\n\nsuite | hard | too hard\nother | easy | of another suite\n";

    fn run(outcomes: &[(&str, bool)]) {
        let mut expected = ExpectedFailures::read(SMALL, "suite");
        for (case, passed) in outcomes {
            expected.note(case, *passed, || "because".to_owned());
        }
        expected.finish();
    }

    #[test]
    fn the_list_can_be_read() {
        ExpectedFailures::for_suite("surfaces_of_the_zoo");
        let reasons = ExpectedFailures::read(SMALL, "suite").reasons;
        assert!(reasons.len() == 1 && reasons["hard"] == "too hard");
    }

    #[test]
    fn as_expected() {
        run(&[("hard", false), ("easy", true)]);
    }

    #[test]
    #[should_panic(expected = "hard passes: take it off the list")]
    fn a_listed_case_that_passes() {
        run(&[("hard", true)]);
    }

    #[test]
    #[should_panic(expected = "easy fails: because")]
    fn a_case_that_fails_and_is_not_listed() {
        run(&[("hard", false), ("easy", false)]);
    }

    #[test]
    #[should_panic(expected = "hard is listed and was not tried")]
    fn a_listed_case_that_is_gone() {
        run(&[("easy", true)]);
    }

    #[test]
    #[should_panic(expected = "is not `suite | case | reason`")]
    fn a_case_without_a_reason() {
        ExpectedFailures::read("suite | hard\n", "suite");
    }
}
