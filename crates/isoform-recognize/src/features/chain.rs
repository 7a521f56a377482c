//! Chains of hollow bands about one axis: holes with their counterbores and countersinks.

use super::band::Band;
use super::{Feature, FeatureKind, Widening};
use isoform_geom::{dot, sub};
use std::collections::BTreeSet;

/// Hollow bands about one axis, one after the other.
pub(super) struct Chain<'a> {
    /// Bands in their order along the axis of the first one that was given.
    bands: Vec<&'a Band>,
    /// True for bands whose axis is opposite.
    is_reversed: Vec<bool>,
    /// Index of the narrowest cylinder.
    narrow: usize,
}

impl<'a> Chain<'a> {
    /// Orders bands along their axis; `None` if none of them is a cylinder.
    pub(super) fn new(mut bands: Vec<&'a Band>) -> Option<Self> {
        let axis = bands[0].axis;
        let place = |b: &Band| dot(b.at(b.middle()), axis);
        bands.sort_by(|a, b| place(a).total_cmp(&place(b)));
        let cylinders = (0..bands.len()).filter(|k| bands[*k].half_angle == 0.0);
        let radius = |k: &usize| bands[*k].radius_at(0.0);
        let narrow = cylinders.min_by(|a, b| radius(a).total_cmp(&radius(b)))?;
        let is_reversed = bands.iter().map(|b| dot(b.axis, axis) < 0.0).collect();
        Some(Self {
            bands,
            is_reversed,
            narrow,
        })
    }

    /// Returns the first or the last band, and which of its ends is that of the chain.
    fn outer(&self, is_last: bool) -> (&'a Band, usize) {
        let k = if is_last { self.bands.len() - 1 } else { 0 };
        (self.bands[k], usize::from(is_last != self.is_reversed[k]))
    }

    /// Returns true if an end has a floor, or a tip as a drill leaves it.
    fn is_closed(&self, is_last: bool) -> bool {
        let (band, end) = self.outer(is_last);
        band.ends[end].is_closed || band.narrows(end)
    }

    /// Returns the hole; `None` if both ends are closed. The mouth of one that goes through is the
    /// wider end.
    pub(super) fn hole(&self) -> Option<Feature> {
        let closed = [false, true].map(|is_last| self.is_closed(is_last));
        let last = self.bands.len() - 1;
        let is_mouth_last = match closed {
            [true, true] => return None,
            [true, false] => true,
            [false, true] => false,
            [false, false] => self.narrow == 0 || self.narrow < last,
        };
        let is_through = closed == [false, false];
        let (first, end) = self.outer(is_mouth_last);
        let (floor, at_floor) = self.outer(!is_mouth_last);
        let point = first.at(first.ends[end].height);
        let direction = first.inward(end);
        // Tips are not counted.
        let bottom = if is_through {
            floor
        } else {
            self.bands[self.narrow]
        };
        let depths = bottom
            .ends
            .map(|e| dot(sub(bottom.at(e.height), point), direction));
        let mut faces: BTreeSet<usize> = self.bands.iter().map(|b| b.face).collect();
        if !is_through {
            faces.extend(floor.ends[at_floor].plane);
        }
        let widenings = (0..=last).filter_map(|k| self.widening(k, closed, is_mouth_last));
        let mut widenings: Vec<Widening> = widenings.collect();
        if is_mouth_last {
            widenings.reverse();
        }
        Some(Feature {
            kind: FeatureKind::Hole {
                radius: self.bands[self.narrow].radius_at(0.0),
                is_through,
                widenings,
            },
            faces,
            point,
            direction,
            depth: depths[0].max(depths[1]),
        })
    }

    /// Returns a band as a wider part of the hole; `None` for the narrowest one, and for tips.
    fn widening(&self, k: usize, closed: [bool; 2], is_mouth_last: bool) -> Option<Widening> {
        if k == self.narrow {
            return None;
        }
        let is_after = k > self.narrow;
        let next = self.bands[if is_after { k - 1 } else { k + 1 }];
        let own = self.bands[k];
        let radii = own.ends.map(|e| own.radius_at(e.height));
        let radius = radii[0].max(radii[1]);
        let is_cone = own.half_angle != 0.0;
        // A cone ends where the next cylinder begins, not in a plane.
        let depth = match is_cone && next.half_angle == 0.0 {
            true => (radius - next.radius_at(0.0)) / own.half_angle.tan().abs(),
            false => own.length(),
        };
        let is_wider = radius > self.bands[self.narrow].radius_at(0.0);
        (is_wider && !closed[usize::from(is_after)]).then_some(Widening {
            radius,
            depth,
            half_angle: is_cone.then_some(own.half_angle.abs()),
            is_at_mouth: is_after == is_mouth_last,
        })
    }
}
