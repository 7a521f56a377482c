//! Regions of a solid during meshing: their solids, names and features.

use crate::divided::{Region, RegionSolid};
use crate::error::{Warning, WarningKind};
use crate::features::{Corner, Features};
use crate::names::REST;
use crate::points::unique;
use isoform_geom::{Mesh, Solid};

/// Regions into which a solid is divided, the remainder last; empty if it is not divided.
pub(crate) struct Regions<'a> {
    solids: Vec<RegionSolid<'a>>,
    names: Vec<&'a str>,
    /// Curves and corners of each region.
    pub(crate) features: Vec<Features>,
}

/// A region with its mesh.
pub(crate) struct RegionMesh<'m> {
    /// Index of the region; the remainder is last.
    pub(crate) region: usize,
    /// Mesh of the region alone.
    pub(crate) mesh: Mesh,
    /// Solid that the mesh approximates.
    pub(crate) solid: &'m dyn Solid,
    pub(crate) features: &'m Features,
}

impl<'a> Regions<'a> {
    /// Creates the regions of a solid, with the features that `find` returns for each.
    pub(crate) fn new(
        whole: &'a dyn Solid,
        regions: &[Region<'a>],
        find: impl Fn(&dyn Solid) -> Features,
    ) -> Self {
        let count = if regions.is_empty() {
            0
        } else {
            regions.len() + 1
        };
        let solids = (0..count).map(|k| RegionSolid::new(whole, regions, k));
        let solids: Vec<RegionSolid<'a>> = solids.collect();
        let names = regions.iter().map(|region| region.name).chain([REST]);
        Self {
            names: names.take(count).collect(),
            features: solids.iter().map(|solid| find(solid)).collect(),
            solids,
        }
    }

    /// Returns the tips of cones on the walls, each once, with the piece indices of the whole.
    pub(crate) fn apexes(&self) -> Vec<Corner> {
        let mut apexes: Vec<Corner> = Vec::new();
        for (solid, features) in self.solids.iter().zip(&self.features) {
            for mut apex in features.apexes() {
                let own = apex.pieces.iter().map(|&piece| solid.undivided(piece));
                apex.pieces = unique(own.collect());
                if apexes.iter().all(|other| other.point != apex.point) {
                    apexes.push(apex);
                }
            }
        }
        apexes
    }

    /// Iterates over the regions that have tetrahedra.
    pub(crate) fn parts_of<'m>(&'m self, mesh: &'m Mesh) -> impl Iterator<Item = RegionMesh<'m>> {
        mesh.regions.iter().zip(0..).filter_map(|(name, number)| {
            let k = self.names.iter().position(|other| other == name)?;
            Some(RegionMesh {
                region: k,
                mesh: mesh.region(number),
                solid: &self.solids[k],
                features: &self.features[k],
            })
        })
    }

    /// Names the regions of a mesh, and warns of each without tetrahedra; the remainder may be
    /// empty.
    pub(crate) fn name(&self, mesh: &mut Mesh) -> Vec<Warning> {
        if self.names.is_empty() {
            return Vec::new();
        }
        let there = unique(mesh.tet_regions.clone());
        let name = |&k: &u32| self.names[k as usize].to_owned();
        mesh.regions = there.iter().map(name).collect();
        for region in &mut mesh.tet_regions {
            *region = there.partition_point(|k| k < region) as u32;
        }
        let asked = &self.names[..self.names.len() - 1];
        let empty = asked.iter().zip(0..).filter(|(_, k)| !there.contains(k));
        let warning =
            |(name, _): (&&str, u32)| Warning::of_all(WarningKind::EmptyRegion((*name).to_owned()));
        empty.map(warning).collect()
    }
}
