//! The regions of a solid while it is meshed: what is to be found of each, and what is wrong with
//! it.

use crate::divided::{Region, RegionSolid};
use crate::error::{Warning, WarningKind};
use crate::features::{Corner, Features};
use crate::points::unique;
use isoform_geom::{Mesh, Solid};

/// What the region is called of what lies in none that is asked for.
pub const REST: &str = "rest";

/// The regions that a solid is divided into, the rest behind those asked for; none of one that is
/// not divided.
pub(crate) struct Regions<'a> {
    solids: Vec<RegionSolid<'a>>,
    names: Vec<&'a str>,
    /// The curves and corners of each.
    pub(crate) features: Vec<Features>,
}

/// A region with what is made of it.
pub(crate) struct Part<'m> {
    /// Its number among those asked for, and the rest.
    pub(crate) region: usize,
    /// Its own mesh.
    pub(crate) mesh: Mesh,
    /// What it should be.
    pub(crate) solid: &'m dyn Solid,
    pub(crate) features: &'m Features,
}

impl<'a> Regions<'a> {
    /// The regions of a solid, with the features that `find` finds of each.
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

    /// Tips of cones on the walls, each once, with the pieces that the whole has.
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

    /// The regions that have tetrahedra.
    pub(crate) fn of<'m>(&'m self, mesh: &'m Mesh) -> impl Iterator<Item = Part<'m>> {
        mesh.regions.iter().zip(0..).filter_map(|(name, number)| {
            let k = self.names.iter().position(|other| other == name)?;
            Some(Part {
                region: k,
                mesh: mesh.region(number),
                solid: &self.solids[k],
                features: &self.features[k],
            })
        })
    }

    /// Gives the regions of a mesh their names, and a warning for each without tetrahedra; of the
    /// rest there may be nothing.
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
