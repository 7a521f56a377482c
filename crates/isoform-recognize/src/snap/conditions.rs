//! Relations as independent equations: those implied by others are left out.

use crate::chart::{DIFFERENCE_STEP, MAX_PARAMETERS, ParameterRow, Primitive};
use crate::entity::{Relation, RelationKind};
use crate::relations::{Components, Failure, PairFrame, UncertainSurface, failure};
use isoform_geom::UnionFind;
use std::collections::BTreeSet;
use std::ops::Range;

/// Equations between two entities: some components of the vector that is 0 if a relation holds.
pub(super) struct Condition {
    pub(super) kind: RelationKind,
    pub(super) entities: [usize; 2],
    rows: Range<usize>,
}

impl Condition {
    /// Returns the components that are equations: those of tangency are fewer for some surfaces.
    fn rows(&self, of: &Failure) -> Range<usize> {
        self.rows.start..self.rows.end.min(of.count)
    }

    pub(super) fn values(&self, pair: [&Primitive; 2]) -> Vec<f64> {
        let found = failure(self.kind, &PairFrame::from_pair(pair), pair);
        found.values[self.rows(&found)].to_vec()
    }

    /// Returns values and derivatives by the parameters of both, at the given steps from the
    /// starts.
    pub(super) fn linearised(
        &self,
        starts: [&UncertainSurface; 2],
        steps: [&ParameterRow; 2],
    ) -> (Vec<f64>, Vec<[ParameterRow; 2]>) {
        let at = |which: usize, step: &ParameterRow| starts[which].surface.moved(step);
        let now = [at(0, steps[0]), at(1, steps[1])];
        let frame = PairFrame::from_pair([&now[0], &now[1]]);
        let found = |s: &[Primitive; 2]| failure(self.kind, &frame, [&s[0], &s[1]]);
        let here = found(&now);
        let own = self.rows(&here);
        let mut rows = vec![[[0.0; MAX_PARAMETERS]; 2]; own.len()];
        for which in 0..2 {
            for k in 0..starts[which].surface.kind.parameters() {
                let side = |h: f64| {
                    let (mut step, mut moved) = (*steps[which], now);
                    step[k] += h;
                    moved[which] = at(which, &step);
                    found(&moved).values
                };
                let (plus, minus) = (side(DIFFERENCE_STEP), side(-DIFFERENCE_STEP));
                for (row, i) in rows.iter_mut().zip(own.clone()) {
                    row[which][k] = (plus[i] - minus[i]) / (2.0 * DIFFERENCE_STEP);
                }
            }
        }
        (here.values[own].to_vec(), rows)
    }
}

/// A property that a relation makes common to two entities.
#[derive(Clone, Copy, PartialEq)]
enum SharedProperty {
    Direction,
    Line,
    Plane,
    Center,
    Radius,
}

const SHARED_PROPERTIES: [SharedProperty; 5] = [
    SharedProperty::Direction,
    SharedProperty::Line,
    SharedProperty::Plane,
    SharedProperty::Center,
    SharedProperty::Radius,
];

impl SharedProperty {
    /// Returns true if a relation makes this property common.
    fn is_of(self, kind: RelationKind) -> bool {
        use RelationKind::{Coaxial, Concentric, Coplanar, EqualRadius, Parallel};
        match self {
            Self::Direction => matches!(kind, Parallel | Coaxial | Coplanar),
            Self::Line => kind == Coaxial,
            Self::Plane => kind == Coplanar,
            Self::Center => kind == Concentric,
            Self::Radius => kind == EqualRadius,
        }
    }

    /// Returns the relation, and its components, that state that the property is common.
    fn equations(self) -> (RelationKind, Range<usize>) {
        match self {
            Self::Direction => (RelationKind::Parallel, 0..2),
            Self::Line => (RelationKind::Coaxial, 2..4),
            Self::Plane => (RelationKind::Coplanar, 2..3),
            Self::Center => (RelationKind::Concentric, 0..3),
            Self::Radius => (RelationKind::EqualRadius, 0..1),
        }
    }

    fn from_condition(condition: &Condition) -> Option<Self> {
        SHARED_PROPERTIES
            .into_iter()
            .find(|s| s.equations().0 == condition.kind)
    }
}

/// Returns a minimal set of conditions that implies all relations: a spanning forest for each
/// shared property, and one right angle for two classes of directions.
pub(super) fn conditions(relations: &[Relation], entities: usize) -> Vec<Condition> {
    let mut found = Vec::new();
    let mut directions = UnionFind::new(entities);
    for shared in SHARED_PROPERTIES {
        let (kind, rows) = shared.equations();
        let mut sets = UnionFind::new(entities);
        for r in relations.iter().filter(|r| shared.is_of(r.kind)) {
            let [a, b] = r.entities.map(|i| i as u32);
            if sets.unite(a, b) {
                found.push(Condition {
                    kind,
                    entities: r.entities,
                    rows: rows.clone(),
                });
            }
        }
        if shared == SharedProperty::Direction {
            directions = sets;
        }
    }
    let mut right_angles = BTreeSet::new();
    for r in relations
        .iter()
        .filter(|r| r.kind == RelationKind::Perpendicular)
    {
        let mut classes = r.entities.map(|i| directions.root(i as u32));
        classes.sort_unstable();
        if right_angles.insert(classes) {
            found.push(Condition {
                kind: r.kind,
                entities: r.entities,
                rows: 0..1,
            });
        }
    }
    // Equations that follow from others are left out later.
    for r in relations.iter().filter(|r| r.kind == RelationKind::Tangent) {
        found.push(Condition {
            kind: r.kind,
            entities: r.entities,
            rows: 0..Components::default().len(),
        });
    }
    found
}

/// Splits relations into those that depend on a condition, and the others.
pub(super) fn split(
    relations: Vec<Relation>,
    conditions: &[Condition],
    worst: usize,
    entities: usize,
) -> (Vec<Relation>, Vec<Relation>) {
    let condition = &conditions[worst];
    if condition.kind == RelationKind::Tangent {
        let is_it = |r: &Relation| (r.kind, r.entities) == (condition.kind, condition.entities);
        return relations.into_iter().partition(is_it);
    }
    let shared = SharedProperty::from_condition(condition).unwrap_or(SharedProperty::Direction);
    // The classes that remain without the condition.
    let mut sets = UnionFind::new(entities);
    for (k, c) in conditions.iter().enumerate() {
        if k != worst && SharedProperty::from_condition(c) == Some(shared) {
            sets.unite(c.entities[0] as u32, c.entities[1] as u32);
        }
    }
    let mut classes = |of: [usize; 2]| {
        let mut roots = of.map(|i| sets.root(i as u32));
        roots.sort_unstable();
        roots
    };
    let torn = classes(condition.entities);
    let is_right = condition.kind == RelationKind::Perpendicular;
    let goes = |r: &Relation| {
        let is_its = if is_right {
            r.kind == RelationKind::Perpendicular
        } else {
            shared.is_of(r.kind)
        };
        is_its && classes(r.entities) == torn
    };
    relations.into_iter().partition(goes)
}
