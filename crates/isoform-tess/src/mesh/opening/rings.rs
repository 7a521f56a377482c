//! Vertices on larger and larger rectangles around base points.

use super::Openings;
use super::site::Site;
use crate::mesh::geometry::distance;
use crate::surface::Point3;
use std::collections::BTreeMap;

impl Openings<'_> {
    /// Vertices on larger and larger rectangles around base points, in all their directions: the
    /// map turns along the seam as fast as ever on small circles, and triangles that lead straight
    /// from there to far vertices would be too thin. With the places to which edges lead from them:
    /// those next to them on their own ring and on the one before, along the rays. Nearest ones are
    /// beside the rays on a long rectangle.
    pub(in crate::mesh) fn rings_around(&self, q: usize) -> Vec<([f64; 2], Vec<[f64; 2]>)> {
        let mut found = Vec::new();
        let here: Vec<&Site> = self
            .sites
            .range((q, 0, 0)..(q + 1, 0, 0))
            .map(|s| s.1)
            .collect();
        for site in &here {
            let fan = &self.fans[site.fan];
            let apart = |other: &&&Site| {
                (other.at[0] - site.at[0])
                    .abs()
                    .max((other.at[1] - site.at[1]).abs())
            };
            let nearest = here
                .iter()
                .filter(|s| s.at != site.at)
                .map(|s| apart(&s))
                .fold(1.0, f64::min);
            let mut last: BTreeMap<usize, Point3> = BTreeMap::new();
            // By sectors, those of the ring before; none on the rectangle itself.
            let mut inner: Option<BTreeMap<usize, [f64; 2]>> = None;
            let mut scale = 1.0;
            // Every other ring lies between the directions: vertices on one line would leave no
            // room for flips.
            let mut is_between = false;
            while scale * site.height < 0.4 * nearest {
                let mut ring = Vec::new();
                for (s, sector) in fan.sectors.iter().enumerate() {
                    let before = &fan.sectors[(s + fan.sectors.len() - 1) % fan.sectors.len()];
                    let (k, backward) = sector.rays[0];
                    let d = &fan.directions[k];
                    if !sector.inside
                        || !is_between
                            && (!before.inside || !d.factors.is_empty() || fan.is_side(d))
                    {
                        continue;
                    }
                    let (d, backward) = if is_between {
                        fan.between(sector, 0)
                    } else {
                        (d.clone(), backward)
                    };
                    let at = match d.node {
                        0 => self
                            .straight(q, site, &d, backward)
                            .map(|at| [0, 1].map(|i| site.at[i] + scale * (at[i] - site.at[i]))),
                        _ => self
                            .reach(q, site, &d, backward)
                            .and_then(|r| fan.on_ray(q, &d, backward, scale * r)),
                    };
                    let Some(at) = at else { continue };
                    if at[0] > 0.0 && at[1] > 0.0 && at[0] + at[1] < 1.0 {
                        ring.push((s, at, self.atlas.charts[q].at(at)));
                    }
                }
                // A ring as near to the last one as its vertices are to each other, in space, makes
                // triangles that are round; nearer ones do not.
                let median = |mut x: Vec<f64>| {
                    x.sort_by(f64::total_cmp);
                    x.get(x.len() / 2).copied()
                };
                let along = median(ring.windows(2).map(|w| distance(w[0].2, w[1].2)).collect());
                let across = median(
                    ring.iter()
                        .filter_map(|(ray, _, p)| Some(distance(*last.get(ray)?, *p)))
                        .collect(),
                );
                if scale == 1.0
                    || across
                        .zip(along)
                        .is_none_or(|(across, along)| across > along)
                {
                    last = ring.iter().map(|(ray, _, p)| (*ray, *p)).collect();
                    if scale > 1.0 {
                        let here: BTreeMap<usize, [f64; 2]> =
                            ring.iter().map(|x| (x.0, x.1)).collect();
                        let n = fan.sectors.len();
                        for (s, at, _) in ring {
                            // Rays of infinitely near points.
                            let is_bent = fan.sectors[s]
                                .rays
                                .iter()
                                .any(|r| fan.directions[r.0].node > 0);
                            // Between its rays, or from the sector before to its own.
                            let beside = if is_between {
                                [s, (s + 1) % n]
                            } else {
                                [(s + n - 1) % n, s]
                            };
                            let legs = match &inner {
                                _ if is_bent => Vec::new(),
                                Some(inner) => beside
                                    .iter()
                                    .filter_map(|s| inner.get(s))
                                    .copied()
                                    .collect(),
                                None => self
                                    .sector_ends(q, site, fan, &fan.sectors[s])
                                    .map_or_else(Vec::new, |ends| ends.to_vec()),
                            };
                            let along = here.get(&((s + n - 1) % n)).copied().filter(|_| !is_bent);
                            found.push((at, legs.into_iter().chain(along).collect()));
                        }
                        inner = Some(here);
                    }
                    is_between = !is_between;
                }
                scale *= 1.5;
            }
        }
        found
    }
}
