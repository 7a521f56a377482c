//! Relations of labels that were stated by hand: checked, and imposed on the surfaces.

use crate::cloud::Cloud;
use crate::entity::{Relation, RelationKind};
use crate::fit::mean;
use crate::given::LabelsError;
use crate::relations::{MAX_PARALLEL_ANGLE, PairFrame, angle_off, failure, is_angle, is_defined};
use crate::segment::Segmentation;
use crate::snap::imposed;
use isoform_geom::Aabb;

/// A relation of two labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelRelation {
    /// Kind of the relation.
    pub kind: RelationKind,
    /// The two labels.
    pub labels: [u32; 2],
}

/// Angle or length by which surfaces are off a relation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RelationDistance {
    /// Angle, in radians.
    Angle(f64),
    /// Length, in the scan's unit.
    Length(f64),
}

/// Returns a relation in words.
pub(crate) fn shown_relation(kind: RelationKind) -> String {
    kind.name().replace('_', " ")
}

/// Returns an angle or a length in words.
pub(crate) fn shown_distance(off: RelationDistance) -> String {
    match off {
        RelationDistance::Angle(angle) => format!("by {:.1} degrees", angle.to_degrees()),
        RelationDistance::Length(length) => {
            // Four digits, in any unit.
            let decimals = (3.0 - length.log10().floor()).clamp(0.0, 12.0) as usize;
            format!("by {length:.decimals$}")
        }
    }
}

/// Refits the surfaces of labels so that relations of these hold.
pub(crate) fn impose(
    (found, cloud, unit): (&mut Segmentation, &Cloud, f64),
    relations: &[LabelRelation],
    names: &[u32],
) -> Result<(), LabelsError> {
    found.related = related((found, cloud, unit), relations, names)?;
    found.surfaces =
        imposed(cloud, found, &found.related).map_err(|r| LabelsError::Contradiction {
            relation: r.kind,
            labels: r.entities.map(|i| names[i]),
        })?;
    Ok(())
}

/// Returns relations of labels as those of their surfaces, the lower index first; lengths of errors
/// are in units of `unit`.
fn related(
    (found, cloud, unit): (&Segmentation, &Cloud, f64),
    relations: &[LabelRelation],
    names: &[u32],
) -> Result<Vec<Relation>, LabelsError> {
    let members = found.members();
    let of = |given: &LabelRelation| {
        let kind = given.kind;
        let mut entities = given
            .labels
            .map(|label| names.partition_point(|name| *name < label));
        entities.sort_unstable();
        let labels = entities.map(|i| names[i]);
        let pair = entities.map(|i| &found.surfaces[i]);
        let kinds = pair.map(|s| s.kind);
        if !is_defined(kind, kinds) {
            return Err(LabelsError::Unrelated {
                relation: kind,
                labels,
                kinds,
            });
        }
        let far = |off| LabelsError::Far {
            relation: kind,
            labels,
            off,
        };
        if let Some(angle) = angle_off(kind, pair).filter(|a| *a > MAX_PARALLEL_ANGLE) {
            return Err(far(RelationDistance::Angle(angle)));
        }
        let size = |i: usize| match kind {
            RelationKind::EqualRadius => found.surfaces[i].size,
            _ => Aabb::from_points(&cloud.at(&members[i])).diagonal(),
        };
        let size = entities.map(size).into_iter().fold(0.0, f64::max);
        let about = entities.map(|i| found.surfaces[i].about(mean(&cloud.at(&members[i]))));
        let about = [&about[0], &about[1]];
        let off = failure(kind, &PairFrame::from_pair(about), about).size();
        // The angle that the larger one would turn by.
        if !is_angle(kind) && off > MAX_PARALLEL_ANGLE * size {
            return Err(far(RelationDistance::Length(off * unit)));
        }
        Ok(Relation {
            kind,
            entities,
            deviation: 0.0,
        })
    };
    relations.iter().map(of).collect()
}
