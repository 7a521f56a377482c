//! Neighbours on one sheet, determined by the places of the parameters.
//!
//! An edge between two places has at most two triangles, no matter which other sheets pass through
//! it in space. Triangles whose edges have different places but equal vertices are neighbours if
//! just two of them remain: across the border of a fundamental domain.

use super::surface_builder::SurfaceBuilder;
use super::triangles::leave_out;
use crate::finding::Finding;
use crate::surface::Surface;
use crate::winding::{CutCurve, Neighbours, Relative, sorted};
use std::collections::BTreeMap;

/// A triangle at an edge, with true if it traverses the edge from the smaller vertex to the larger.
type Use = (u32, bool);

impl SurfaceBuilder<'_> {
    /// Returns the surface with wound triangles, and one vertex for all places that share it.
    pub(super) fn wound(mut self) -> Surface {
        let (neighbours, unknown) = self.neighbours();
        let relative = Relative::new(self.surface.triangles.len(), neighbours);
        self.surface.wind(&relative);
        let mut surface = self.surface;
        if unknown > 0 {
            surface.findings.push(Finding::NeighboursUnknown(unknown));
        }
        let first = |v: u32| self.first[v as usize];
        for v in surface.triangles.iter_mut().flatten() {
            *v = first(*v);
        }
        surface.winding.renumber(|v| Some(first(v)));
        let gone: Vec<bool> = (0..).zip(&self.first).map(|(k, f)| k != *f).collect();
        leave_out(&mut surface, &gone);
        surface
    }

    /// Returns the neighbours, and the number of edges at which it is not decided which triangles
    /// are neighbours.
    fn neighbours(&self) -> (Vec<Neighbours>, usize) {
        let mut neighbours = Vec::new();
        // Triangles without a neighbour at their places, by the edges in space.
        let mut left: BTreeMap<[u32; 2], Vec<Use>> = BTreeMap::new();
        for (edge, uses) in self.uses() {
            let on_vertices = edge.map(|v| self.first[v as usize]);
            let is_turned = on_vertices[0] > on_vertices[1];
            match uses[..] {
                [a, b] => neighbours.push(Neighbours {
                    along: self.curve(edge, [a.0, b.0]),
                    edge,
                    of: [a.0, b.0],
                    same_way: a.1 == b.1,
                }),
                _ => {
                    let turned = uses.iter().map(|&(k, there)| (k, there ^ is_turned));
                    left.entry(sorted(on_vertices)).or_default().extend(turned);
                }
            }
        }
        let mut unknown = 0;
        for (edge, uses) in left {
            match uses[..] {
                [a, b] => neighbours.push(Neighbours {
                    along: CutCurve::FundamentalDomain,
                    edge,
                    of: [a.0, b.0],
                    same_way: a.1 == b.1,
                }),
                [] | [_] => {}
                _ => unknown += 1,
            }
        }
        (neighbours, unknown)
    }
    /// Returns the edges between places with their triangles, without collapsed triangles.
    fn uses(&self) -> BTreeMap<[u32; 2], Vec<Use>> {
        let mut uses = self.surface.uses();
        let is_open = |&(k, _): &Use| {
            let [a, b, c] = self.surface.triangles[k as usize];
            a != b && b != c && c != a
        };
        uses.values_mut().for_each(|list| list.retain(is_open));
        uses
    }
    /// Returns the curve to which an edge between places of two triangles belongs.
    fn curve(&self, edge: [u32; 2], of: [u32; 2]) -> CutCurve {
        let [a, b] = of.map(|k| self.surface.charts[k as usize]);
        if edge.iter().all(|&v| self.on_seam[v as usize]) {
            CutCurve::Seam
        } else if (a + 2) % 4 == b {
            // Opposite unit triangles share only infinite parameters.
            CutCurve::Infinite
        } else {
            CutCurve::Finite
        }
    }
}
