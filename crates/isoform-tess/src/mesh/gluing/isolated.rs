//! Joining of isolated real points of singular curves, and of images of contracted curves: those
//! with one image become one vertex.

use super::{Gluing, SAME_IMAGE_DISTANCE};
use crate::mesh::geometry::distance;
use crate::mesh::names::{ClassId, Name, key, name_of};
use crate::mesh::opening::Openings;
use crate::mesh::places::{distance2, in_plane, place_on};
use crate::mesh::sides::{Sides, add_place};
use crate::surface::Point3;

/// An isolated parameter in a unit triangle.
struct Isolated {
    q: usize,
    at: [f64; 2],
    image: Point3,
    name: Name,
}

impl Openings<'_> {
    /// Assigns classes to isolated parameters with one image, and to curves that meet contracted
    /// ones.
    pub(super) fn join_isolated(
        &self,
        gluing: &mut Gluing,
        isolated: &[[f64; 3]],
        sides: &mut Sides,
    ) {
        let points = self.isolated(isolated);
        for point in &points {
            let Some(shared) = self.shared_name(point, &points, gluing) else {
                continue;
            };
            if let Name::Side(side, sign, bits) = point.name {
                add_place(sides, (side, sign), f64::from_bits(bits));
            }
            let class = key(point.name, point.q, point.at);
            gluing.classes.insert(class, shared);
            if point.name == Name::Inner {
                gluing.points.push((point.q, point.at));
            }
        }
        self.join_contracted(gluing);
    }

    /// Returns the isolated parameters in every unit triangle that contains them, if they are in
    /// the domain and their images in the box. Base points have no image.
    fn isolated(&self, parameters: &[[f64; 3]]) -> Vec<Isolated> {
        let domain = self.atlas.region.domain.as_ref();
        let point = |p: [f64; 3], q: usize| {
            let at = place_on(q, p)?;
            let image = self.atlas.charts[q].at(at);
            let is_outside = domain.is_some_and(|d| d.is_outside(in_plane(q, at)));
            let is_in_box = image.iter().all(|x| x.abs() <= self.atlas.half_width);
            let name = name_of(q, p, at);
            (!is_outside && is_in_box).then_some(Isolated { q, at, image, name })
        };
        let everywhere = parameters.iter().flat_map(|&p| (0..4).map(move |q| (p, q)));
        everywhere.filter_map(|(p, q)| point(p, q)).collect()
    }

    /// Returns the name of the vertex that an isolated parameter shares with a contracted curve,
    /// the double curve or other isolated parameters; `None` if it shares none.
    fn shared_name(
        &self,
        point: &Isolated,
        points: &[Isolated],
        gluing: &mut Gluing,
    ) -> Option<Name> {
        let is_near =
            |p: &Point3| distance(*p, point.image) < SAME_IMAGE_DISTANCE * self.atlas.half_width;
        let contracted = self.curves.images().find(|x| is_near(&x.1));
        let double = || gluing.images.iter().position(is_near);
        let known = contracted
            .map(|x| Name::Image(x.0))
            .or_else(|| double().map(|k| Name::Double(ClassId(k))));
        // Nearer places of one unit triangle are one parameter.
        let is_other = |o: &Isolated| o.q != point.q || distance2(o.at, point.at) > 1e-12;
        let mut near = points.iter().filter(|o| is_near(&o.image));
        let has_others = near.any(is_other);
        known.or_else(|| {
            has_others.then(|| {
                let parameter = in_plane(point.q, point.at);
                Name::Double(gluing.add_class(point.image, parameter))
            })
        })
    }

    /// Joins the double curve to contracted curves that it passes through. Contracted curves with
    /// one image are a single vertex already.
    fn join_contracted(&self, gluing: &mut Gluing) {
        for (k, p) in self.curves.images() {
            let (images, parameters) = (&gluing.images, &gluing.parameters);
            let is_met = |ClassId(c): ClassId| {
                distance(images[c], p) < SAME_IMAGE_DISTANCE * self.atlas.half_width
                    && (self.curves.glued || self.curves.leads_to(k, parameters[c]))
            };
            for name in gluing.classes.values_mut() {
                if matches!(name, Name::Double(c) if is_met(*c)) {
                    *name = Name::Image(k);
                }
            }
        }
    }
}
