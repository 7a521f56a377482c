//! Suggestions for misspelt names.

/// Maximum number of suggested names; a longer list is harder to read than the manual.
const MAX_SUGGESTIONS: usize = 3;

/// Returns the candidates most similar to a name: those that differ from it in at most a third of
/// its characters (at least one), and those that begin with it. A pair of swapped characters counts
/// once. Case, the prefix `hf` of functions and the ending `.hf` of files are ignored.
///
/// ```
/// assert_eq!(isoform_field::similar("hfBlok", ["hfBlock", "hfSphere"]), ["hfBlock"]);
/// ```
pub fn similar<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Vec<&'c str> {
    let plain = |text: &str| {
        let low = text.to_lowercase();
        low.strip_suffix(".hf").map_or(low.clone(), str::to_owned)
    };
    let name = plain(name);
    let characters = name.chars().count();
    let mut found: Vec<(usize, &str)> = candidates
        .into_iter()
        .filter_map(|candidate| {
            let other = plain(candidate);
            let begins = characters > 1 && other.starts_with(&name);
            if begins || other.strip_prefix("hf") == Some(&name) {
                return Some((1, candidate));
            }
            let distance = strsim::osa_distance(&name, &other);
            (distance <= (characters / 3).max(1)).then_some((distance, candidate))
        })
        .collect();
    found.sort_unstable();
    found.truncate(MAX_SUGGESTIONS);
    found.into_iter().map(|(_, candidate)| candidate).collect()
}

/// Returns the question whether one of some candidates was meant; `None` if none is similar.
pub fn suggestion<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<String> {
    let near = similar(name, candidates);
    (!near.is_empty()).then(|| format!("did you mean {}?", near.join(" or ")))
}

#[cfg(test)]
mod tests {
    use super::{similar, suggestion};

    #[test]
    fn functions_are_found_without_their_prefix() {
        let all = ["hfBlock", "hfSphere"];
        assert_eq!(
            suggestion("block", all).as_deref(),
            Some("did you mean hfBlock?")
        );
        assert_eq!(
            suggestion("sphere", all).as_deref(),
            Some("did you mean hfSphere?")
        );
        assert_eq!(suggestion("torus", all), None);
    }

    #[test]
    fn misspelt_names_are_found() {
        let all = ["bottle", "box", "cup", "plate-holes", "models/part.hf"];
        let near = |name: &str| similar(name, all);
        assert_eq!(near("cpu"), ["cup"]);
        assert_eq!(near("Botle.hf"), ["bottle"]);
        assert_eq!(near("plate"), ["plate-holes"]);
        assert_eq!(near("models/prat.hf"), ["models/part.hf"]);
        assert!(near("teapot").is_empty() && near("").is_empty());
    }
}
