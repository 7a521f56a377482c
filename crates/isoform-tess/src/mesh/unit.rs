//! Parts of the surface in the unit triangles: refined in parallel, and joined to one surface.

use super::filling::{Strip, fill};
use super::glued::Glued;
use super::in_chart::InChart;
use super::matching::InsertionPlace;
use super::names::{Name, Node, Ray};
use super::plane::{Measure, Plane, RefinementDefects};
use super::surface_builder::{NewTriangle, SurfaceBuilder};
use super::{MAX_BISECTIONS, MAX_OPEN_TRIANGLES};
use crate::finding::{Finding, Phase};
use crate::surface::{Surface, VertexKind};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use std::collections::BTreeMap;

/// The part of the region in a unit triangle.
pub(super) struct Unit {
    pub(super) quadrant: usize,
    pub(super) plane: Plane,
    /// Triangles with a base point as the first corner, which are replaced by strips.
    pub(super) at_apex: Vec<[u32; 3]>,
    /// Fans of base points, by vertex.
    pub(super) apexes: BTreeMap<usize, usize>,
    /// Rays of the corners of the rectangles around base points, by vertex and fan.
    pub(super) rays: BTreeMap<(usize, usize), Ray>,
    pub(super) findings: Vec<Finding>,
}

impl SurfaceBuilder<'_> {
    /// Returns the place of a node of a unit triangle.
    fn node_vertex(&mut self, measure: &InChart<'_, '_>, k: u32, node: &Node) -> u32 {
        let full = |name| match name {
            Name::Inner => (Name::Inner, measure.q, k as usize),
            name => (name, 0, 0),
        };
        let [place, vertex] = self.glued.names(measure.q, node);
        let gluing = self.gluing();
        self.vertex(full(place), full(vertex), || {
            let kind = match vertex {
                Name::Image(_) => VertexKind::Contracted,
                _ if node.faces > 0 => VertexKind::Box,
                Name::Double(k) if gluing.is_double(k) => VertexKind::Double,
                _ if node.borders > 0 => VertexKind::Border,
                _ => VertexKind::Ordinary,
            };
            (measure.image(node), node.faces, kind)
        })
    }

    /// Adds the vertices and triangles of a unit triangle.
    fn add(&mut self, unit: &Unit) {
        let (q, plane) = (unit.quadrant, &unit.plane);
        let measure = InChart {
            glued: self.glued,
            q,
        };
        self.surface.findings.extend(unit.findings.iter().cloned());
        let mut made: Vec<NewTriangle> = Vec::new();
        for t in &plane.triangles {
            let nodes = t.map(|v| &plane.nodes[v as usize]);
            made.push(NewTriangle {
                vertices: [0, 1, 2].map(|i| self.node_vertex(&measure, t[i], nodes[i])),
                corners: nodes.map(|n| n.at),
                borders: nodes.map(|n| n.borders),
            });
        }
        let strips = unit.at_apex.iter();
        let strips = strips.filter_map(|&t| self.strip(unit, &measure, t));
        let strips: Vec<Result<Strip, Finding>> = strips.collect();
        for strip in strips {
            match strip {
                Ok(strip) => made.extend(fill(q, &strip, self)),
                Err(finding) => self.surface.findings.push(finding),
            }
        }
        for triangle in made {
            self.push(q, triangle);
        }
    }
    /// Adds a triangle of a unit triangle to the surface.
    fn push(&mut self, q: usize, triangle: NewTriangle) {
        self.surface.borders.push(triangle.borders);
        self.surface.triangles.push(triangle.vertices);
        self.surface.charts.push(q as u8);
        self.surface.corners.push(triangle.corners);
    }

    /// Returns the strip that replaces a triangle at a base point, with the vertices on the
    /// rectangle: `None` if the base point was not opened, and a finding if a corner is on no ray.
    fn strip(
        &mut self,
        unit: &Unit,
        measure: &InChart<'_, '_>,
        [p, a, b]: [u32; 3],
    ) -> Option<Result<Strip, Finding>> {
        let &fan = unit.apexes.get(&(p as usize))?;
        let nodes = &unit.plane.nodes;
        let mut vertex = |v: u32| {
            let node = &nodes[v as usize];
            (self.node_vertex(measure, v, node), node.at)
        };
        let way = unit
            .plane
            .way([a, b])
            .into_iter()
            .map(&mut vertex)
            .collect();
        let ends = [a, b].map(&mut vertex);
        let ray = |v: u32| unit.rays.get(&(v as usize, fan)).copied();
        let strip = ray(a).zip(ray(b)).map(|(a, b)| Strip {
            fan,
            apex: nodes[p as usize].at,
            rays: [a, b],
            ends,
            way,
        });
        Some(strip.ok_or(Finding::StripsLeftOut))
    }
}

/// Returns the findings for the remaining defects of a refinement.
fn complaints(ended: RefinementDefects) -> impl Iterator<Item = Finding> {
    let all = [
        (ended.unsound, Finding::SignUnproved),
        (ended.clashes, Finding::EdgesClash),
        (ended.coarse, Finding::TooCoarse),
        (
            usize::from(ended.is_stopped),
            Finding::Stopped(Phase::Clashes),
        ),
    ];
    all.into_iter().filter(|c| c.0 > 0).map(|c| c.1)
}

/// The refined unit triangles.
pub(super) struct Refined {
    units: Vec<Unit>,
}

impl Refined {
    /// Refines unit triangles and inserts further vertices.
    pub(super) fn new(glued: &Glued<'_>, mut units: Vec<Unit>, further: &[InsertionPlace]) -> Self {
        glued.refine(&mut units);
        glued.put(further, &mut units);
        Self { units }
    }
    /// Joins the unit triangles to one surface.
    pub(super) fn joined(&self, glued: &Glued<'_>) -> Surface {
        let mut joined = SurfaceBuilder::new(glued);
        for unit in &self.units {
            joined.add(unit);
        }
        joined.wound()
    }
}

impl Glued<'_> {
    /// Refines unit triangles in parallel, with a common limit on their triangles.
    fn refine(&self, units: &mut [Unit]) {
        let most = if self.openings.halvings < MAX_BISECTIONS {
            self.atlas.options.triangles.min(MAX_OPEN_TRIANGLES)
        } else {
            self.atlas.options.triangles
        };
        let measure = |q: usize| InChart { glued: self, q };
        units.par_iter_mut().for_each(|u| {
            let control = self.atlas.control;
            u.plane.begin(most / 4, &measure(u.quadrant), control)
        });
        // The triangles that other unit triangles do not need go to those that need more.
        let (needy, done): (Vec<_>, Vec<_>) =
            (0..units.len()).partition(|&k| units[k].plane.is_waiting());
        for group in [done, needy] {
            let made: usize = units.iter().map(|u| u.plane.triangles.len()).sum();
            let room = most.saturating_sub(made) / group.len().max(1);
            units
                .par_iter_mut()
                .enumerate()
                .filter(|(k, _)| group.contains(k))
                .for_each(|(_, u)| {
                    let most = u.plane.triangles.len() + room;
                    let (measure, control) = (measure(u.quadrant), self.atlas.control);
                    let ended = u.plane.refine(most, &measure, control);
                    u.findings.extend(complaints(ended));
                });
        }
    }

    /// Inserts further vertices into unit triangles.
    fn put(&self, places: &[InsertionPlace], units: &mut [Unit]) {
        let most = self.atlas.options.triangles;
        units.par_iter_mut().for_each(|u| {
            let q = u.quadrant;
            let measure = InChart { glued: self, q };
            let here: Vec<InsertionPlace> =
                places.iter().filter(|p| p.quadrant == q).copied().collect();
            if !here.is_empty() {
                let ended = u.plane.insert(&here, most, &measure, self.atlas.control);
                u.findings.extend(complaints(ended));
            }
        });
    }
}
