//! The walk around a base point along both sides of all of its exceptional lines.

use super::blow_up::Step;
use super::direction::Direction;
use super::marks::{Mark, Target};
use super::{Fan, Sector};
use crate::finding::Unopened;

/// A ray on the walk.
struct Station {
    /// Index of the direction, with true if the ray is backward.
    ray: (usize, bool),
    before: Neighbour,
    after: Neighbour,
}

/// The mark before or after a station.
struct Neighbour {
    at: [f64; 2],
    /// True if the seam is in the box between the mark and the station.
    is_inside: bool,
}

/// A ray or a corner on the walk.
enum Event {
    Station(Station),
    Corner(Direction),
}

/// The marks of a node, followed by those in the opposite directions: positions count them
/// counterclockwise, modulo their number.
struct Circle<'a>(&'a [Mark]);

impl<'a> Circle<'a> {
    fn len(&self) -> i64 {
        2 * self.0.len() as i64
    }
    /// Returns the mark at a position, with true if it is in the opposite direction.
    fn at(&self, position: i64) -> (&'a Mark, bool) {
        let p = position.rem_euclid(self.len()) as usize;
        let n = self.0.len();
        (&self.0[p % n], p >= n)
    }
    fn vector(&self, position: i64) -> [f64; 2] {
        let (mark, backward) = self.at(position);
        mark.direction.signed(backward)
    }
    /// Returns the mark next to a position in the sense of `turn`, 1 or −1.
    fn neighbour(&self, position: i64, turn: i64) -> Neighbour {
        let lower = if turn > 0 { position } else { position - 1 };
        Neighbour {
            at: self.vector(position + turn),
            is_inside: self.at(lower).0.is_inside,
        }
    }
    /// Returns the position of an axis, which is marked.
    fn axis(&self, v: [f64; 2]) -> i64 {
        let place = self
            .0
            .iter()
            .position(|m| m.direction.at == v.map(f64::abs));
        let place = place.expect("an exceptional line is marked") as i64;
        if v[0] + v[1] < 0.0 {
            place + self.0.len() as i64
        } else {
            place
        }
    }
}

/// A position of the walk on the circle of a node; `turn` is 1 for counterclockwise and −1 for
/// clockwise.
#[derive(Clone, Copy)]
struct Position {
    node: usize,
    at: i64,
    turn: i64,
}

/// Part of a near point's line that is traversed.
#[derive(Clone, Copy)]
enum Stretch {
    Half,
    /// The last quarter, where an exceptional line leads to the near point.
    FromMiddle,
    /// The first quarter.
    ToMiddle,
}

impl Fan {
    /// Returns the stations of the walk, each with the corners between it and the next one.
    fn stations(&self) -> Vec<(Station, Vec<Direction>)> {
        let mut stations: Vec<(Station, Vec<Direction>)> = Vec::new();
        let mut first = Vec::new();
        for event in self.walk_around() {
            match event {
                Event::Station(s) => stations.push((s, Vec::new())),
                Event::Corner(d) => stations.last_mut().map_or(&mut first, |s| &mut s.1).push(d),
            }
        }
        if let Some(last) = stations.last_mut() {
            last.1.append(&mut first);
        }
        stations
    }
    /// Computes the sectors from the marks of all nodes.
    pub(super) fn arrange(&mut self) {
        let stations = self.stations();
        let n = stations.len();
        let sector = |k: usize| {
            let ((a, corners), (b, _)) = (&stations[k], &stations[(k + 1) % n]);
            debug_assert!(corners.len() <= 1, "a ray between two corners");
            Sector {
                rays: [a.ray, b.ray],
                marks: [a.after.at, b.before.at],
                corner: corners.first().cloned(),
                inside: a.after.is_inside && b.before.is_inside,
            }
        };
        self.sectors = (0..n).map(sector).collect();
        let is_torn = |k: usize| {
            let (a, b) = (&stations[k].0, &stations[(k + 1) % n].0);
            a.after.is_inside != b.before.is_inside
        };
        if (0..n).any(is_torn) && self.problem.is_none() {
            self.problem = self.left_open(Unopened::SeamsMeetInFace);
        }
    }
    fn circle(&self, node: usize) -> Circle<'_> {
        Circle(&self.nodes[node].marks)
    }
    /// Returns the events of the walk around the base point, counterclockwise.
    fn walk_around(&self) -> Vec<Event> {
        let mut events = Vec::new();
        for at in 0..self.circle(0).len() {
            let position = Position {
                node: 0,
                at,
                turn: 1,
            };
            self.pass(position, Stretch::Half, &mut events);
        }
        events
    }
    /// Walks from a position of a near point's line to another one. Both are exceptional lines, and
    /// the walk is on one side of each.
    fn walk_line(&self, start: Position, end: i64, events: &mut Vec<Event>) {
        let Position { node, at, turn } = start;
        let length = (turn * (end - at)).rem_euclid(self.circle(node).len());
        for step in 0..=length {
            let position = Position {
                at: at + turn * step,
                ..start
            };
            let stretch = match step {
                0 => Stretch::FromMiddle,
                _ if step == length => Stretch::ToMiddle,
                _ => Stretch::Half,
            };
            self.pass(position, stretch, events);
        }
    }
    /// Visits a position; if a point is near there, walks along its line.
    fn pass(&self, position: Position, stretch: Stretch, events: &mut Vec<Event>) {
        let Position { node, at, turn } = position;
        let circle = self.circle(node);
        let (mark, backward) = circle.at(at);
        match mark.target {
            Target::Ray(direction) => events.push(Event::Station(Station {
                ray: (direction, backward),
                before: circle.neighbour(at, -turn),
                after: circle.neighbour(at, turn),
            })),
            Target::Corner => events.push(Event::Corner(mark.direction.clone())),
            Target::Near(child) => {
                let (start, end) = self.detour(child, circle.vector(at), turn, stretch);
                self.walk_line(start, end, events);
            }
        }
    }
    /// Returns the start and the end of the walk along the line of a point that is near in the
    /// direction of a vector.
    fn detour(
        &self,
        child: usize,
        [x, y]: [f64; 2],
        turn: i64,
        stretch: Stretch,
    ) -> (Position, i64) {
        let o = turn as f64;
        let (start, middle, end, sign) = match self.nodes[child].chain.last() {
            Some(Step::Across) => ([o, 0.0], [0.0, y.signum()], [-o, 0.0], y),
            _ => ([0.0, -o], [x.signum(), 0.0], [0.0, o], x),
        };
        let (start, end) = match stretch {
            Stretch::Half => (start, end),
            Stretch::FromMiddle => (middle, end),
            Stretch::ToMiddle => (start, middle),
        };
        let circle = self.circle(child);
        let position = Position {
            node: child,
            at: circle.axis(start),
            turn: if sign < 0.0 { -turn } else { turn },
        };
        (position, circle.axis(end))
    }
}
