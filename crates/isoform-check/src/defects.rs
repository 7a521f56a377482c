//! Defects: their number by kind, and the places of the first or worst of them.

use isoform_geom::Point3;

/// Location of a defect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Place {
    /// Point at or near the defect.
    pub at: Point3,
    /// Nodes of the defective vertex, edge, face or element.
    pub nodes: Vec<u32>,
    /// Elements involved: triangles or tetrahedra, depending on the kind of defect.
    pub elements: Vec<u32>,
    /// Measured value; 0 for kinds without one.
    pub value: f64,
}

/// All defects of one kind: their number and the places of the first (or worst) of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    /// Number of defects.
    pub count: usize,
    /// Places of the first defects in the order of the mesh, at most
    /// [`Options::places`](super::Options::places).
    pub places: Vec<Place>,
}

impl Defects {
    /// Returns true if the list of defects is empty.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
    /// Counts a defect, and keeps its place if fewer than `room` are kept.
    pub(super) fn add(&mut self, room: usize, place: impl FnOnce() -> Place) {
        self.count += 1;
        if self.places.len() < room {
            self.places.push(place());
        }
    }
    /// Appends the defects of a later part of the mesh.
    pub(super) fn append(&mut self, room: usize, later: Self) {
        self.count += later.count;
        let free = room.saturating_sub(self.places.len());
        self.places.extend(later.places.into_iter().take(free));
    }
}

/// The `room` items with the lowest values; the earlier item precedes among equal values.
#[derive(Clone, Debug, Default)]
pub(super) struct Lowest {
    /// Value and index of each item, in ascending order.
    pub(super) items: Vec<(f64, u32)>,
}

impl Lowest {
    /// Inserts an item at its position in the order. NaN counts as the lowest value.
    pub(super) fn add(&mut self, room: usize, value: f64, index: u32) {
        let value = if value.is_nan() {
            f64::NEG_INFINITY
        } else {
            value
        };
        if self.items.len() == room && self.items.last().is_none_or(|last| value >= last.0) {
            return;
        }
        let at = self.items.partition_point(|item| item.0 <= value);
        self.items.insert(at, (value, index));
        self.items.truncate(room);
    }
    /// Adds the items of a later part of the mesh.
    pub(super) fn append(&mut self, room: usize, later: Self) {
        for (value, index) in later.items {
            self.add(room, value, index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_go_on_when_places_are_full() {
        let mut a = Defects::default();
        for i in 0..5 {
            a.add(2, || Place {
                value: f64::from(i),
                ..Place::default()
            });
        }
        let mut b = Defects::default();
        b.add(2, Place::default);
        b.append(2, a);
        assert_eq!((b.count, b.places.len(), b.places[1].value), (6, 2, 0.0));
    }

    #[test]
    fn lowest_are_kept_in_order() {
        let mut low = Lowest::default();
        for (i, v) in [3.0, 1.0, 2.0, 1.0, 0.5, f64::NAN].into_iter().enumerate() {
            low.add(3, v, i as u32);
        }
        assert_eq!(low.items, [(f64::NEG_INFINITY, 5), (0.5, 4), (1.0, 1)]);
        let mut none = Lowest::default();
        none.add(0, 1.0, 0);
        assert!(none.items.is_empty());
    }
}
