//! Counts of what makes comments and names hard to read, by crate, and the list that bounds them.

use std::collections::BTreeMap;

/// Words with which the first sentence of a doc comment does not start: a value starts with a noun,
/// a function with a verb.
const QUESTION_WORDS: [&str; 24] = [
    "whether", "what", "how", "where", "of", "it", "its", "in", "as", "so", "that", "which", "who",
    "whose", "there", "none", "beside", "within", "along", "at", "on", "by", "about", "upon",
];

/// Phrases that plain technical English does without.
const PHRASES: [&str; 24] = [
    "is no",
    "are no",
    "has not",
    "have not",
    "none where",
    "so many",
    "that which",
    "it is worth",
    "looked at",
    "beside",
    "is told",
    "are told",
    "to be had",
    "of ours",
    "what of",
    "from which on",
    "one behind the other",
    "is asked for",
    "all the same",
    "as good as",
    "upon each other",
    "somewhere",
    "as it is",
    "the same",
];

/// Numeric types whose constants are counted.
const NUMERIC_TYPES: [&str; 8] = ["f64", "f32", "usize", "u64", "u32", "i32", "u8", "i64"];

/// Maximum number of declarations of one name, of types or of constants, that need not be listed: a
/// name that is declared more often says little.
const MAX_DECLARATIONS: usize = 4;

/// Counts of one crate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Counts {
    /// First sentences of doc comments that start with one of [`QUESTION_WORDS`].
    pub(crate) openings: usize,
    /// Lines of doc comments with one of [`PHRASES`].
    pub(crate) phrases: usize,
    /// Named numeric constants.
    pub(crate) constants: usize,
    /// Functions called `of`.
    pub(crate) of: usize,
}

/// Counts by crate, and uses of names in all crates.
#[derive(Default)]
pub(crate) struct Prose {
    crates: BTreeMap<String, Counts>,
    types: BTreeMap<String, usize>,
    constants: BTreeMap<String, usize>,
}

impl Prose {
    /// Adds a source file of a crate.
    pub(crate) fn add(&mut self, room: &str, text: &str) {
        let counts = self.crates.entry(room.to_owned()).or_default();
        let (mut is_code_block, mut is_comment) = (false, false);
        for line in text.lines().map(str::trim_start) {
            let Some(doc) = line.strip_prefix("///").or(line.strip_prefix("//!")) else {
                (is_code_block, is_comment) = (false, false);
                let declared = line.strip_prefix("pub").map_or(line, after_visibility);
                if let Some(name) = numeric_constant(declared) {
                    counts.constants += 1;
                    *self.constants.entry(name.to_owned()).or_default() += 1;
                }
                if let Some(name) = declared_type(declared) {
                    *self.types.entry(name.to_owned()).or_default() += 1;
                }
                let function = declared.strip_prefix("const ").unwrap_or(declared);
                counts.of +=
                    usize::from(function.starts_with("fn of(") || function.starts_with("fn of<"));
                continue;
            };
            if doc.trim_start().starts_with("```") {
                is_code_block = !is_code_block;
            } else if !is_code_block {
                let doc = doc.to_lowercase();
                counts.phrases += usize::from(PHRASES.iter().any(|p| has_phrase(&doc, p)));
                counts.openings += usize::from(!is_comment && opens_badly(&doc));
            }
            is_comment = true;
        }
    }

    /// Returns the counts that the list bounds: those of each crate, and the number of declarations
    /// of each name that is declared too often.
    fn rows(&self) -> BTreeMap<&str, Vec<(&str, usize)>> {
        let crates = self.crates.iter().map(|(room, counts)| {
            let counts = vec![
                ("openings", counts.openings),
                ("phrases", counts.phrases),
                ("constants", counts.constants),
                ("functions `of`", counts.of),
            ];
            (room.as_str(), counts)
        });
        let names = self.types.iter().chain(&self.constants);
        let worn = names
            .filter(|&(_, &uses)| uses > MAX_DECLARATIONS)
            .map(|(name, &uses)| (name.as_str(), vec![("declarations", uses)]));
        crates.chain(worn).collect()
    }

    /// Returns the rows of the list, one in each line.
    pub(crate) fn list(&self) -> String {
        let mut list = String::new();
        for (key, counts) in self.rows() {
            list += key;
            for (_, count) in counts {
                list += &format!(" {count}");
            }
            list.push('\n');
        }
        list
    }

    /// Returns a sentence for each count that differs from the list's.
    pub(crate) fn against(&self, list: &str) -> Vec<String> {
        let mut listed: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for line in list.lines().filter(|line| !line.starts_with('#')) {
            let mut cells = line.split_whitespace();
            let key = cells.next().unwrap_or_default();
            listed.insert(key, cells.filter_map(|cell| cell.parse().ok()).collect());
        }
        let mut differences = Vec::new();
        for (key, counts) in self.rows() {
            let limits = listed.remove(key).unwrap_or_default();
            for (i, (label, count)) in counts.into_iter().enumerate() {
                match limits.get(i).copied().unwrap_or_default() {
                    limit if count > limit => {
                        differences.push(format!("{key}: {count} {label}, listed are {limit}"));
                    }
                    limit if count < limit => {
                        differences.push(format!("{key}: {count} {label}: lower the {limit}"));
                    }
                    _ => {}
                }
            }
        }
        let unused = listed.keys().map(|key| format!("{key}: remove its row"));
        differences.extend(unused);
        differences
    }
}

/// Returns what follows a visibility without its `pub`.
fn after_visibility(rest: &str) -> &str {
    let rest = match rest.strip_prefix('(').and_then(|r| r.split_once(')')) {
        Some((_, rest)) => rest,
        None => rest,
    };
    rest.trim_start()
}

/// Returns the name of a numeric constant that a line declares.
fn numeric_constant(line: &str) -> Option<&str> {
    let (name, of) = line.strip_prefix("const ")?.split_once(": ")?;
    let kind = of.split(|c: char| !c.is_alphanumeric()).next()?;
    (NUMERIC_TYPES.contains(&kind) && !name.contains(' ')).then_some(name)
}

/// Returns the name of a type or trait that a line declares.
fn declared_type(line: &str) -> Option<&str> {
    let rest = ["struct ", "enum ", "trait "]
        .iter()
        .find_map(|word| line.strip_prefix(word))?;
    rest.split(|c: char| !c.is_alphanumeric() && c != '_')
        .next()
}

/// Returns true if a sentence in lower case starts with a question word.
fn opens_badly(doc: &str) -> bool {
    let doc = doc.trim_start();
    let start = doc.trim_start_matches(|c: char| !c.is_alphanumeric());
    let word = start
        .split(|c: char| !c.is_ascii_alphabetic() && c != '\'')
        .next();
    !doc.starts_with('`') && word.is_some_and(|word| QUESTION_WORDS.contains(&word))
}

/// Returns true if a line in lower case holds a phrase as whole words.
fn has_phrase(doc: &str, phrase: &str) -> bool {
    let is_border = |c: Option<char>| !c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    doc.match_indices(phrase).any(|(at, _)| {
        is_border(doc[..at].chars().next_back())
            && is_border(doc[at + phrase.len()..].chars().next())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(text: &str) -> Counts {
        let mut prose = Prose::default();
        prose.add("a", text);
        prose.crates["a"]
    }

    #[test]
    fn openings_and_phrases_are_counted() {
        let text = "//! Of a file.\n/// Returns it.\nfn f() {}\n    /// What is no more,\n    /// what \
            was beside it.\n/// `of` is fine, as is \"this note\".\n";
        let counts = counted(text);
        assert_eq!((counts.openings, counts.phrases), (2, 2));
        let block = "/// Runs.\n/// ```\n/// what is no code\n/// ```\n/// whether it ends\n";
        assert_eq!(
            counted(block),
            Counts::default(),
            "a code block, a second sentence"
        );
    }

    #[test]
    fn constants_and_functions_are_counted() {
        let text = "pub(crate) const STEPS: usize = 3;\nconst TEXT: &str = \"\";\nconst fn of(x: f64) \
            {}\n    pub fn of<T>() {}\nfn offset() {}\npub const PAIR: [f64; 2] = [1.0, 2.0];\n";
        let counts = counted(text);
        assert_eq!((counts.constants, counts.of), (1, 2));
    }

    #[test]
    fn counts_above_and_below_the_list_are_named() {
        let mut prose = Prose::default();
        prose.add("a", "/// What it is.\nconst A: f64 = 1.0;\n");
        assert_eq!(prose.against(&prose.list()), Vec::<String>::new());
        let wrong = prose.against("# comment\na 0 0 2 0\nb 0 0 0 0\n");
        assert_eq!(wrong.len(), 3, "{wrong:?}");
    }

    #[test]
    fn worn_names_are_named() {
        let mut prose = Prose::default();
        for room in ["a", "b", "c", "d", "e"] {
            prose.add(room, "struct Args {\npub(super) enum Rare {}\n");
            prose.add(room, "const NEAR: f64 = 1.0;\n");
        }
        let list = prose.list();
        for row in ["Args 5\n", "Rare 5\n", "NEAR 5\n"] {
            assert!(list.contains(row), "{row} is missing in {list}");
        }
    }
}
