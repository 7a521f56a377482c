//! Critical values: the u over which curves turn, cross, or meet a side.

use super::curve::{Curve, over_u};
use super::{ArrangementError, V};
use crate::precision::{DOUBLED, refine_until};
use crate::resultant::{ResultantError, resultant};
use crate::roots::{RealRoot, real_roots};
use crate::upoly::UPoly;
use dashu_ratio::RBig;
use isoform_control::Control;

/// Event at a critical value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    /// A curve has a vertical tangent or a singular point, goes to infinity, or meets the side v =
    /// 0 or u + v = 1.
    Alone(usize),
    /// Two curves meet, or go to infinity together.
    Pair(usize, usize),
    /// An end of the range, or a vertical line.
    Other,
}

/// Critical value, with the events there.
pub(super) struct Critical {
    pub(super) u: RealRoot,
    events: Vec<Event>,
}

impl Critical {
    /// Returns true if something happens to a curve there, other than a simple crossing of the line
    /// over u.
    pub(super) fn is_special(&self, curve: usize) -> bool {
        self.events.iter().any(|e| match *e {
            Event::Alone(k) => k == curve,
            Event::Pair(j, k) => j == curve || k == curve,
            Event::Other => false,
        })
    }
    pub(super) fn has(&self, event: Event) -> bool {
        self.events.contains(&event)
    }
}

/// Returns the critical values in \[0, 1\], ascending, with 0 and 1.
pub(super) fn critical_values(
    curves: &[Curve],
    control: &Control<'_>,
) -> Result<Vec<Critical>, ArrangementError> {
    let mut base = EventBase::default();
    for (p, event) in projection(curves, control)? {
        if control.is_stopped() {
            return Err(ResultantError::Stopped.into());
        }
        base.add(&p, event);
    }
    Ok(base.roots(control)?)
}

/// Returns polynomials in u whose roots are the critical values, with their events: the projection
/// of the cylindrical decomposition.
fn projection(
    curves: &[Curve],
    control: &Control<'_>,
) -> Result<Vec<(UPoly, Event)>, ArrangementError> {
    let mut found: Vec<(UPoly, Event)> = vec![
        (UPoly::from_i64(&[0, 1]), Event::Other),
        (UPoly::from_i64(&[-1, 1]), Event::Other),
    ];
    for (k, c) in curves.iter().enumerate() {
        found.push((c.vertical.clone(), Event::Other));
        found.push((c.on_lower.clone(), Event::Alone(k)));
        found.push((c.on_upper.clone(), Event::Alone(k)));
        let Some(fibres) = &c.fibres else {
            continue;
        };
        found.push((fibres.leading().clone(), Event::Alone(k)));
        if let Some(chain) = fibres.subresultants() {
            found.push((chain.resultant.clone(), Event::Alone(k)));
        }
        let others = curves[..k].iter().enumerate();
        for (j, other) in others.filter(|(_, o)| o.fibres.is_some()) {
            let r = over_u(&resultant(&other.rest, &c.rest, V, control)?);
            if r.is_zero() {
                return Err(ArrangementError::CommonComponent(j, k));
            }
            found.push((r, Event::Pair(j, k)));
        }
    }
    Ok(found)
}

/// Squarefree polynomials without common roots, with the events at the roots of each: all roots are
/// distinct, and signs at them are cheap.
#[derive(Default)]
struct EventBase(Vec<(UPoly, Vec<Event>)>);

impl EventBase {
    /// Splits every polynomial into the part with roots of p and the part without.
    fn add(&mut self, p: &UPoly, event: Event) {
        // Sides, vertical lines and multiple factors were split off, so that events are isolated.
        assert!(!p.is_zero(), "critical values of a curve are finitely many");
        if p.degree() == 0 {
            return;
        }
        let mut rest = p.squarefree_part();
        let mut next = Vec::new();
        for (b, events) in std::mem::take(&mut self.0) {
            let common = (rest.degree() > 0).then(|| b.gcd(&rest));
            let Some(g) = common.filter(|g| g.degree() > 0) else {
                next.push((b, events));
                continue;
            };
            let without = b.div_exact(&g).expect("a common divisor divides");
            rest = rest.div_exact(&g).expect("a common divisor divides");
            let both = events.iter().copied().chain([event]).collect();
            let parts = [(without, events), (g, both)];
            next.extend(parts.into_iter().filter(|p| p.0.degree() > 0));
        }
        if rest.degree() > 0 {
            next.push((rest, vec![event]));
        }
        self.0 = next;
    }

    /// Returns the roots in \[0, 1\], ascending, their intervals disjoint.
    fn roots(&self, control: &Control<'_>) -> Result<Vec<Critical>, ResultantError> {
        let mut roots: Vec<Critical> = Vec::new();
        for (p, events) in &self.0 {
            let inside = real_roots(p).into_iter().filter(is_in_unit);
            roots.extend(inside.map(|u| Critical {
                u,
                events: events.clone(),
            }));
        }
        // The roots are distinct: refining them until their intervals are disjoint avoids a test
        // for equality.
        refine_until(24, DOUBLED, control, |bits| {
            roots.iter_mut().for_each(|r| r.u.refine(bits));
            roots.sort_by(|a, b| a.u.interval().0.cmp(&b.u.interval().0));
            let mut pairs = roots.windows(2);
            let apart = pairs.all(|w| w[0].u.interval().1 < w[1].u.interval().0);
            Ok::<_, ResultantError>(apart.then_some(()))
        })?;
        Ok(roots)
    }
}

/// Returns true if a number is in \[0, 1\].
fn is_in_unit(r: &RealRoot) -> bool {
    r.cmp_rational(&RBig::ZERO).is_ge() && r.cmp_rational(&RBig::ONE).is_le()
}
