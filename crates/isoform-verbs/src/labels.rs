//! Labels that the points of a scan were given by hand, for `recognize` and `recover`.

use crate::context::Context;
use crate::failure::{Failure, INPUT};
use crate::scan;
use isoform::geom::PointCloud;
use isoform::recognize::{LabelFacts, LabelRelation, LabelsError, PrimitiveKind, RelationKind};
use isoform::report::brief;
use isoform::{Recognized, ScanLabels};
use std::path::{Path, PathBuf};

/// Options for labels given by hand.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Given {
    /// Search nothing: each number of the column `entity` of this file becomes one entity, fitted to
    /// exactly its points, -1 none. The file is what recognize -o labels.ply or .csv writes,
    /// perhaps edited: the points of the scan in their order
    #[arg(long, value_name = "FILE")]
    pub(crate) labels: Option<PathBuf>,
    /// Kind of the entity of a label: plane, sphere, cylinder, cone or torus (repeatable) [default:
    /// the kind that describes its points best]
    #[arg(long = "kind", value_name = "N=KIND", requires = "labels", value_parser = kind)]
    kinds: Vec<(u32, PrimitiveKind)>,
    /// Relation of two labels that templates keep, though the points may not show it: parallel,
    /// perpendicular, coaxial, coplanar, concentric, equal_radius or tangent (repeatable)
    #[arg(long = "relate", value_name = "KIND=N,N", requires = "labels", value_parser = relation)]
    relations: Vec<LabelRelation>,
}

/// Reads a relation of two labels.
fn relation(text: &str) -> Result<LabelRelation, String> {
    let all = RelationKind::ALL.map(RelationKind::name).join(", ");
    let (name, labels) = text
        .split_once('=')
        .ok_or("a relation and two labels are expected, such as parallel=3,5")?;
    let kind = RelationKind::ALL
        .into_iter()
        .find(|kind| kind.name() == name.trim())
        .ok_or_else(|| format!("`{}` is no relation; these are: {all}", name.trim()))?;
    let numbers: Result<Vec<u32>, _> = labels.split(',').map(|l| l.trim().parse()).collect();
    let labels = numbers.ok().and_then(|all| <[u32; 2]>::try_from(all).ok());
    let labels =
        labels.ok_or("two labels are expected, whole numbers of 0 or more, such as 3,5")?;
    Ok(LabelRelation { kind, labels })
}

/// Reads a label with its kind.
fn kind(text: &str) -> Result<(u32, PrimitiveKind), String> {
    let all = PrimitiveKind::NAMED.map(|named| named.0).join(", ");
    let (label, name) = text
        .split_once('=')
        .ok_or("a label and a kind are expected, such as 3=cylinder")?;
    let label = label.trim().parse::<u32>();
    let label = label.map_err(|_| "a label is a whole number, 0 or more".to_owned())?;
    let mut kinds = PrimitiveKind::NAMED.iter();
    match kinds.find(|named| named.0 == name.trim()) {
        Some((_, kind)) => Ok((label, *kind)),
        None => Err(format!("`{}` is no kind; these are: {all}", name.trim())),
    }
}

impl Given {
    /// Returns the kinds, the last one of each label, and the relations.
    pub(crate) fn facts(&self) -> LabelFacts {
        LabelFacts {
            kinds: self.kinds.iter().copied().collect(),
            relations: self.relations.clone(),
        }
    }

    /// Reads the labels of a scan; `None` without a file.
    pub(crate) fn read(
        &self,
        cloud: &PointCloud,
        context: &Context,
    ) -> Result<Option<ScanLabels>, Failure> {
        let Some(path) = &self.labels else {
            return Ok(None);
        };
        let file = scan::read_vertices(path, None, context)?;
        let labels = ScanLabels::from_file(cloud, &file).map_err(|error| {
            let mut failure = Failure::new(INPUT, "labels", format!("{}: {error}", path.display()));
            failure.place.file = Some(path.clone());
            failure.hint("the file that recognize -o labels.ply writes for this scan")
        })?;
        Ok(Some(labels))
    }
}

/// Why labels become no entities.
pub(crate) fn failure(error: &LabelsError, message: String) -> Failure {
    let failure = Failure::new(INPUT, "labels", message);
    match error {
        LabelsError::Undetermined { label, kind, .. } => {
            let other = match kind {
                Some(_) => format!(", or another --kind {label}=..."),
                None => String::new(),
            };
            failure.hint(format!(
                "more points for label {label}, or another label for these, -1 for none{other}"
            ))
        }
        LabelsError::Split { .. } => failure.hint("one label for all points at a place"),
        LabelsError::Unknown(_) => failure.hint("--kind and --relate with labels of the file"),
        LabelsError::OneLabel(_) => failure.hint("--relate parallel=3,5 with two labels"),
        LabelsError::Unrelated { .. }
        | LabelsError::Far { .. }
        | LabelsError::Contradiction { .. } => {
            failure.hint("another relation, or other points or another --kind for one of them")
        }
        _ => failure,
    }
}

/// Returns true if templates keep the tangency of two kinds of surfaces.
fn is_kept(kinds: [&str; 2]) -> bool {
    let has = |kind| kinds.contains(&kind);
    let is_round = has("sphere") || has("torus");
    has("plane") && (is_round || has("cylinder")) || has("cylinder") && is_round
}

/// Names the labels whose points their surfaces do not explain, and relations that templates lose.
pub(crate) fn warn(found: &Recognized<'_>, scan: &Path, facts: &LabelFacts, context: &Context) {
    let entities = found.recognition.entities.iter();
    for e in entities.filter(|e| !e.is_explained) {
        let label = e.label.unwrap_or_default();
        let is_related = facts.relations.iter().any(|r| r.labels.contains(&label));
        let why = match (is_related, facts.kinds.contains_key(&label)) {
            (true, _) => "they contradict a relation, or are of several surfaces",
            (false, true) => "they may be of another kind, or of several surfaces",
            (false, false) => "no kind explains them, they may be of several surfaces",
        };
        context.warn(format_args!(
            "{}: label {label}: its {} points are {} off the {} (rms), {} times the noise: {why}",
            scan.display(),
            e.points,
            brief(e.rms),
            e.surface.name(),
            brief(e.rms / found.recognition.noise),
        ));
    }
    let kind_of = |label: u32| {
        let mut entities = found.recognition.entities.iter();
        entities
            .find(|e| e.label == Some(label))
            .map(|e| e.surface.name())
    };
    let tangencies = facts.relations.iter();
    for r in tangencies.filter(|r| r.kind == RelationKind::Tangent) {
        let [a, b] = r.labels;
        if let (Some(first), Some(second)) = (kind_of(a), kind_of(b))
            && !is_kept([first, second])
        {
            context.warn(format_args!(
                "{}: labels {a} and {b}: a template does not keep the tangency of a {first} with a \
                 {second}; the entities are tangent",
                scan.display(),
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relations_are_read_with_their_labels() {
        let found = relation(" equal_radius = 3, 15").expect("a relation");
        assert_eq!(
            (found.kind, found.labels),
            (RelationKind::EqualRadius, [3, 15])
        );
        for wrong in [
            "",
            "parallel",
            "parallel=3",
            "parallel=3,4,5",
            "parallel=3,-1",
            "near=1,2",
        ] {
            assert!(relation(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn kinds_are_read_with_their_labels() {
        assert_eq!(kind("3=cylinder"), Ok((3, PrimitiveKind::Cylinder)));
        assert_eq!(kind(" 0 = torus "), Ok((0, PrimitiveKind::Torus)));
        for wrong in [
            "",
            "3",
            "3=",
            "=plane",
            "-1=plane",
            "3=ball",
            "1.5=cone",
            "99999999999=cone",
        ] {
            assert!(kind(wrong).is_err(), "{wrong}");
        }
    }
}
