//! Ties from contacts: a ball or a tube is one radius off the planes that it touches.
//!
//! A centre is tied to one plane when it gets its parameter. Further planes that it touches give
//! further equations between parameters, each of which eliminates one parameter.

use super::dimensions::{
    CoordinateTerm, Dimensions, LinearForm, MAX_TIED_DIFFERENCE, TemplateParameter, sum,
};
use crate::noise::CHANCE_DEVIATIONS;

/// Names of parameters that a designer states first: the extents of the part.
const EXTENTS: [&str; 3] = ["length", "width", "height"];

impl Dimensions<'_> {
    /// Ties parameters by all contacts of planes with balls and tubes that hold within the
    /// deviations and are not implied yet.
    pub(super) fn settle_contacts(&mut self) {
        for entity in 0..self.entities.len() {
            for system in 0..self.frame.systems.len() {
                for axis in 0..3 {
                    self.settle(entity, [system, axis]);
                }
            }
        }
    }

    /// Ties parameters by the contacts of an entity along an axis.
    fn settle(&mut self, entity: usize, way: [usize; 2]) {
        let Some(center) = self.known_term(entity, way) else {
            return;
        };
        let Some(radius) = self.radius_of[self.radii[entity]] else {
            return;
        };
        for touch in self.touched(entity, way) {
            let Some(plane) = self.plane_term(touch.plane) else {
                continue;
            };
            let off = sum(&[
                (1.0, self.linear(center)),
                (-1.0, self.linear(plane)),
                (-touch.side, self.linear(CoordinateTerm::Of(radius))),
            ]);
            let value: f64 = off
                .iter()
                .map(|(k, by)| by * self.parameters[*k].start)
                .sum();
            if value.abs()
                <= (CHANCE_DEVIATIONS * touch.sd).min(MAX_TIED_DIFFERENCE * self.diagonal)
            {
                self.eliminate(&off);
            }
        }
    }

    /// Eliminates from a linear form that must vanish the parameter that a designer would state
    /// last.
    fn eliminate(&mut self, form: &LinearForm) {
        let is_open = |p: &TemplateParameter| !p.is_fixed && !EXTENTS.contains(&p.name.as_str());
        let open = form.iter().filter(|(k, _)| is_open(&self.parameters[*k]));
        let Some(&(last, factor)) = open.max_by_key(|(k, _)| *k) else {
            return;
        };
        let others = form.iter().filter(|(k, _)| *k != last);
        let tie: LinearForm = others.map(|(k, by)| (*k, -by / factor)).collect();
        for parameter in &mut self.parameters {
            if let Some(old) = &parameter.tie
                && let Some((_, by)) = old.iter().find(|(k, _)| *k == last)
            {
                let rest = old.iter().copied().filter(|(k, _)| *k != last).collect();
                parameter.tie = Some(sum(&[(1.0, rest), (*by, tie.clone())]));
            }
        }
        let parameter = &mut self.parameters[last];
        parameter.tie = Some(tie);
        if parameter.about.is_empty() {
            parameter.about = "where it touches".to_owned();
        }
    }
}
