//! Faces: the connected pieces of entities, as CAD systems count them.

use crate::choose::least_points;
use crate::cloud::Cloud;
use crate::cost::Cost;
use crate::entity::Face;
use crate::labels::UNLABELLED;
use crate::segment::Segmentation;
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// Entity of each face, and index of the face of each point; [`UNLABELLED`] for points outside all
/// faces.
pub(crate) struct FaceLabels {
    entities: Vec<u32>,
    labels: Vec<u32>,
}

impl FaceLabels {
    /// Builds the faces from pieces of entities, given as the entity and the points of each piece.
    pub(crate) fn from_pieces(
        pieces: impl Iterator<Item = (u32, Vec<u32>)>,
        points: usize,
    ) -> Self {
        let (mut entities, mut labels) = (Vec::new(), vec![UNLABELLED; points]);
        for (entity, of) in pieces {
            let face = entities.len() as u32;
            of.iter().for_each(|i| labels[*i as usize] = face);
            entities.push(entity);
        }
        Self { entities, labels }
    }

    /// Finds the faces of a cloud: points of an entity that are connected along neighbours, at
    /// least as many as an entity of their own would need.
    pub(crate) fn of_cloud(cloud: &Cloud, found: &Segmentation, min_points: usize) -> Self {
        let members = found.members();
        let pieces = (0..).zip(&members).flat_map(|(entity, members)| {
            let kind = found.surfaces[entity as usize].kind;
            let fewest = match cloud.is_exact(found.noise) {
                true => kind.parameters(),
                false => least_points(kind, found.noise),
            };
            let mut pieces = cloud.connected(members);
            pieces.retain(|of| of.len() >= fewest.max(min_points));
            pieces.into_iter().map(move |of| (entity, of))
        });
        Self::from_pieces(pieces, cloud.points.len())
    }

    /// Assigns exact points that lie on several faces to the smallest of them, whose parameters
    /// they determine most. For noisy points the distances decide.
    pub(crate) fn settle_shared(&mut self, cloud: &Cloud, found: &mut Segmentation) {
        if !cloud.is_exact(found.noise) {
            return;
        }
        let counts = self.counts(&self.labels);
        let reach = Cost::with_noise(found.noise).reach();
        let smallest = |i: u32| {
            let own = self.labels[i as usize];
            let lies_on = |face: &u32| {
                let surface = &found.surfaces[self.entities[*face as usize] as usize];
                surface.distance(cloud.points[i as usize]).abs() <= reach
            };
            let near = cloud.near(i).iter().map(|j| self.labels[*j as usize]);
            let others = near.filter(|face| *face != UNLABELLED && *face != own && lies_on(face));
            let size = |face: &u32| (counts[*face as usize], *face);
            let faces = others.chain((own != UNLABELLED).then_some(own));
            faces.min_by_key(size).unwrap_or(UNLABELLED)
        };
        let smallest: Vec<u32> = (0..self.labels.len() as u32).map(smallest).collect();
        let left = self.counts(&smallest);
        for (i, face) in smallest.into_iter().enumerate() {
            let own = self.labels[i];
            // A face all of whose points also lie on others keeps them.
            if face != own && (own == UNLABELLED || 2 * left[own as usize] > counts[own as usize]) {
                self.labels[i] = face;
                found.labels[i] = self.entities[face as usize];
            }
        }
    }

    /// Returns the number of points of each face.
    fn counts(&self, labels: &[u32]) -> Vec<usize> {
        let mut counts = vec![0; self.entities.len()];
        let known = labels.iter().filter(|face| **face != UNLABELLED);
        known.for_each(|face| counts[*face as usize] += 1);
        counts
    }

    /// Returns the faces of the points `index`, ordered by `rank` of their entities and then by
    /// size, the largest first, the face of each of these points, and the points or facets of each
    /// face. `pairs` of neighbouring points or facets define which faces are adjacent.
    pub(crate) fn report(
        &self,
        rank: impl Fn(u32) -> Option<u32>,
        index: impl Iterator<Item = u32>,
        pairs: impl Iterator<Item = (u32, u32)>,
    ) -> (Vec<Face>, Vec<Option<u32>>, Vec<Vec<u32>>) {
        let of = |i: u32| self.labels.get(i as usize).copied().unwrap_or(UNLABELLED);
        let labels: Vec<u32> = index.map(of).collect();
        let counts = self.counts(&labels);
        let mut order: Vec<(u32, Reverse<usize>, usize)> = (0..counts.len())
            .filter_map(|face| Some((rank(self.entities[face])?, Reverse(counts[face]), face)))
            .collect();
        order.sort_unstable();
        let mut new = vec![None; counts.len()];
        for (at, (_, _, old)) in order.iter().enumerate() {
            new[*old] = Some(at as u32);
        }
        let renamed = |face: u32| new.get(face as usize).copied().flatten();
        let mut beside = vec![BTreeSet::new(); order.len()];
        for (a, b) in pairs {
            let pair = (renamed(of(a)), renamed(of(b)));
            if let (Some(a), Some(b)) = pair
                && a != b
            {
                beside[a as usize].insert(b as usize);
                beside[b as usize].insert(a as usize);
            }
        }
        let faces = order.iter().zip(beside).map(|(of, beside)| Face {
            entity: of.0 as usize,
            points: of.1.0,
            beside: beside.into_iter().collect(),
            border: Vec::new(),
        });
        let mut members = vec![Vec::new(); order.len()];
        for (i, old) in (0..).zip(&self.labels) {
            if let Some(face) = renamed(*old) {
                members[face as usize].push(i);
            }
        }
        let labels = labels.into_iter().map(renamed).collect();
        (faces.collect(), labels, members)
    }
}
