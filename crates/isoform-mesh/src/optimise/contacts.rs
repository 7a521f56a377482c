//! Borders that represent a point of contact.
//!
//! Where a boss is flush with the side of its block the face between them ends in two cusps.
//! Cutting does not resolve these: boss and side get a short common border, at both ends of which
//! three pieces meet that have only the point of contact in common. Or the face continues between
//! them, where it has no width. The border, or an edge across the face, is contracted.

use super::Optimiser;
use super::collapses::Pull;
use crate::complex::{NONE, Ring, STRAY};
use crate::features::newton::{onto_touching, unit};
use crate::features::{Corner, CornerKind};
use crate::surface::On;
use isoform_geom::{Point3, cross, norm, sub};
use std::collections::BTreeSet;

/// Maximum distance of a contact's border from the contact, in sizes.
const CONTACT_REACH_SIZES: f64 = 3.0;
/// Sines of the angle between two pieces at a contact: up to the first they touch, from the second
/// on they cross.
const CONTACT_SINES: [f64; 2] = [1e-6, 0.2];

/// A point of contact, and the pieces that touch there.
struct Contact {
    corner: Corner,
    touching: [u32; 2],
}

impl Optimiser<'_> {
    /// Contracts the borders that represent points of contact, and moves the remaining vertices
    /// there.
    pub(super) fn take_contacts(&mut self, goal: f64) {
        // Walls and sides of unit cells may touch anything.
        if self.complex.is_divided() || self.complex.torus.is_some() {
            return;
        }
        let mut made = Vec::new();
        for contact in self.contacts() {
            if self.control.is_stopped() {
                return;
            }
            if let Some(v) = self.contract_border(&contact) {
                made.push((contact.corner, Some(v)));
            }
        }
        self.take(made, goal);
    }

    /// Contracts edges across the face that ends at contacts without a vertex; returns these
    /// contacts with the remaining vertices.
    pub(super) fn contract_across(&mut self) -> Vec<(Corner, Option<u32>)> {
        let is_contact = |c: &Corner| c.kind == CornerKind::Tangent;
        if !self.surface.apexes.iter().any(is_contact) {
            return Vec::new();
        }
        let near = self.near_apexes(&self.surface.apexes);
        let known = self.surface.apexes.iter().zip(near);
        let is_free = |(c, near): &(&Corner, Vec<(f64, u32)>)| {
            is_contact(c) && near.first().is_some_and(|n| n.0 > 0.0)
        };
        let corners: Vec<Corner> = known.filter(is_free).map(|k| k.0.clone()).collect();
        let mut made = Vec::new();
        for corner in corners {
            if let Some(touching) = self.touching(&corner.pieces, corner.point)
                && let Some(v) = self.contract_edge(&corner, touching)
            {
                made.push((corner, Some(v)));
            }
        }
        made
    }

    /// Returns points of contact near vertices in which three pieces meet.
    fn contacts(&self) -> Vec<Contact> {
        let mut found: Vec<Contact> = Vec::new();
        for v in self.surface_vertices() {
            let labels = self.labels[v as usize];
            let &[a, b, c] = labels.slice() else { continue };
            for [i, j, k] in [[a, b, c], [b, c, a], [c, a, b]] {
                let Some(contact) = self.contact([i, j], k, self.point(v)) else {
                    continue;
                };
                let at = contact.corner.point;
                let is_known =
                    |f: &Contact| norm(sub(f.corner.point, at)) <= CONTACT_SINES[0] * self.size;
                if !found.iter().any(is_known) {
                    found.push(contact);
                }
            }
        }
        found
    }

    /// Returns the vertices of the surface all of whose labels are pieces.
    fn surface_vertices(&self) -> Vec<u32> {
        let is_there = |v: &u32| {
            let labels = &self.labels[*v as usize];
            self.complex.tet_of[*v as usize] != NONE
                && !labels.is_empty()
                && labels.slice().iter().all(|l| *l < STRAY)
        };
        (0..self.complex.points.len() as u32)
            .filter(is_there)
            .collect()
    }

    fn sine(&self, [a, b]: [u32; 2], p: Point3) -> f64 {
        let [n, m] = [a, b].map(|i| unit(self.surface.gradient(i, p).1));
        norm(cross(n, m))
    }

    /// Returns the two of three pieces that touch at a point where the third one crosses both.
    fn touching(&self, pieces: &[u32], p: Point3) -> Option<[u32; 2]> {
        let &[a, b, c] = pieces else { return None };
        [[a, b, c], [b, c, a], [c, a, b]]
            .into_iter()
            .find(|&[i, j, k]| {
                self.sine([i, j], p) <= CONTACT_SINES[0]
                    && self.sine([i, k], p) >= CONTACT_SINES[1]
                    && self.sine([j, k], p) >= CONTACT_SINES[1]
            })
            .map(|[i, j, _]| [i, j])
    }

    /// Returns the point near `p` where a piece touches the curve of two others.
    fn contact(&self, curve: [u32; 2], piece: u32, p: Point3) -> Option<Contact> {
        let [i, j] = curve;
        if self.sine(curve, p) < CONTACT_SINES[1]
            // At larger sines the pieces do not touch near the vertex.
            || self.sine([i, piece], p).min(self.sine([j, piece], p)) > 0.6
        {
            return None;
        }
        let reach = CONTACT_REACH_SIZES * self.size;
        let point = onto_touching(self.surface.solid, curve, piece, p, reach)?;
        let mut pieces = vec![i, j, piece];
        pieces.sort_unstable();
        let touching = self.touching(&pieces, point)?;
        let is_on = |i: &u32| self.surface.distance(*i, point) == 0.0;
        let corner = Corner {
            point,
            pieces: pieces.clone(),
            kind: CornerKind::Tangent,
        };
        let is_near = norm(sub(point, p)) <= reach;
        (is_near && pieces.iter().all(is_on)).then_some(Contact { corner, touching })
    }

    /// Returns the vertices of the surface near a point that lie on some pieces, nearest first.
    fn near(&self, at: Point3, pieces: &[u32]) -> Vec<u32> {
        let far = |v: u32| norm(sub(self.point(v), at));
        let is_on = |v: &u32| {
            let labels = &self.labels[*v as usize];
            far(*v) <= CONTACT_REACH_SIZES * self.size && pieces.iter().all(|l| labels.contains(*l))
        };
        let mut near: Vec<u32> = self.surface_vertices().into_iter().filter(is_on).collect();
        near.sort_by(|a, b| far(*a).total_cmp(&far(*b)).then(a.cmp(b)));
        near
    }

    /// Contracts the border of the touching pieces near a contact. Returns the remaining vertex.
    fn contract_border(&mut self, contact: &Contact) -> Option<u32> {
        let near = self.near(contact.corner.point, &contact.touching);
        let border = self.connected(*near.first()?, &near);
        let all = On::from_pieces(&contact.corner.pieces);
        let is_end = |v: &&u32| all.is_within(&self.labels[**v as usize]);
        // A seam along which one piece continues the other has one end here.
        let is_border = border
            .iter()
            .all(|v| self.labels[*v as usize].is_within(&all));
        let is_point = border.iter().filter(is_end).count() > 1 && is_border;
        is_point.then(|| self.contract_all(&border, all)).flatten()
    }

    /// Contracts the edge across the face between two pieces that is nearest to their contact.
    /// Returns the remaining vertex.
    fn contract_edge(&mut self, corner: &Corner, touching: [u32; 2]) -> Option<u32> {
        let third = *corner.pieces.iter().find(|i| !touching.contains(i))?;
        let [mine, theirs] = touching.map(|i| self.near(corner.point, &[i, third]));
        let far = |v: u32| norm(sub(self.point(v), corner.point));
        let pairs = mine
            .iter()
            .flat_map(|u| theirs.iter().map(move |w| [*u, *w]));
        let mut pairs: Vec<(f64, [u32; 2])> = pairs
            .filter(|[u, w]| self.complex.are_neighbours(*u, *w))
            .map(|[u, w]| (far(u) + far(w), [u, w]))
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let all = On::from_pieces(&corner.pieces);
        let mut pairs = pairs.into_iter();
        pairs.find_map(|(_, pair)| self.contract_all(&pair, all))
    }

    /// Returns the vertices of a list that edges of the surface connect to the first.
    fn connected(&self, first: u32, all: &[u32]) -> Vec<u32> {
        let mut ring = Ring::default();
        let (mut border, mut at) = (vec![first], 0);
        while let Some(&v) = border.get(at) {
            at += 1;
            for &w in all {
                if !border.contains(&w)
                    && self.complex.ring_of(v, w, &mut ring)
                    && self.complex.is_on_surface(&ring)
                {
                    border.push(w);
                }
            }
        }
        border
    }

    /// Contracts vertices, nearest to the contact first, to one, which then lies on `all`; `None`
    /// if that is not possible.
    fn contract_all(&mut self, border: &[u32], all: On) -> Option<u32> {
        let mut left: BTreeSet<u32> = border.iter().copied().collect();
        let mut ring = Ring::default();
        while left.len() > 1 {
            let pairs = border
                .iter()
                .flat_map(|w| border.iter().map(move |u| Pull { u: *u, w: *w }));
            let pulls: Vec<Pull> = pairs
                .filter(|p| p.u != p.w && left.contains(&p.u) && left.contains(&p.w))
                .collect();
            let done = pulls.into_iter().find(|pull| {
                self.complex.ring_of(pull.u, pull.w, &mut ring)
                    && self.complex.is_on_surface(&ring)
                    && self.contract(*pull, &ring)
            })?;
            left.remove(&done.u);
            self.labels[done.w as usize] = all;
            self.touched[done.w as usize] = self.clock + 1;
        }
        left.first().copied()
    }
}
