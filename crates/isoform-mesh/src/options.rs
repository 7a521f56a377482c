//! Options of the mesher.

use crate::error::MeshError;
use crate::features::START;
use crate::memory;
use isoform_geom::{Aabb, KdTree, Point3};
use std::sync::Arc;

/// Estimated number of bytes per tetrahedron near the surface, with all its data.
pub(crate) const BYTES_PER_TETRAHEDRON: u64 = 400;
/// Default maximum memory of the mesher, in bytes; less if the machine has less.
const DEFAULT_MEMORY_BYTES: u64 = 16 << 30;

/// Options of [`mesh`](crate::mesh).
#[derive(Clone, Debug)]
pub struct Options {
    /// Target edge length; the largest one where sizes vary.
    pub size: f64,
    /// Maximum chordal error, in model units: edges are shorter where a face would leave the
    /// surface by more.
    pub grade: Option<f64>,
    /// Edge lengths by position; edges are shorter where they are smaller than `size`.
    pub sizes: Option<Sizes>,
    /// Order of the elements: 1 for straight edges, 2 for mid nodes, on the true surface.
    pub order: u32,
    /// True if only the surface is meshed.
    pub surface_only: bool,
    /// Box to mesh in: the solid is cut off at its sides, and the cuts are parts named `cap.x_min`
    /// and so on. Default: the solid's own box.
    pub region: Option<Aabb>,
    /// Axes along which the box is a unit cell: the mesh of its upper side equals that of its lower
    /// side, node for node. The function must be periodic, too; only its values in the box count.
    pub periodic: [bool; 3],
    /// Layers of wedges along parts of the surface.
    pub layers: Option<Layers>,
    /// Box in which the search for the solid starts without a `region`: its approximate position,
    /// if that is known.
    pub start: Aabb,
    /// Bounds on the angles of tetrahedra (degrees): optimisation ends when all angles are within,
    /// or nothing helps any more.
    pub angles: [f64; 2],
    /// Maximum number of further meshes, with shorter edges where one has defects: most rounded
    /// boxes whose seams are about a size apart are mended by the first, 30 blended balls by the
    /// fourth.
    pub rounds: usize,
    /// Maximum memory in bytes, by the mesher's own estimate. The default of 16 GiB is reduced to
    /// the memory of the machine; other values are tried, and refused where the machine surely has
    /// less.
    pub memory: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            size: 0.1,
            grade: None,
            sizes: None,
            order: 1,
            surface_only: false,
            region: None,
            periodic: [false; 3],
            layers: None,
            start: START,
            angles: [21.0, 149.0],
            rounds: 4,
            memory: DEFAULT_MEMORY_BYTES,
        }
    }
}

impl Options {
    /// Checks that every number is valid.
    pub(crate) fn check(&self) -> Result<(), MeshError> {
        positive("size", self.size)?;
        if let Some(grade) = self.grade {
            positive("grade", grade)?;
        }
        if let Some(layers) = &self.layers {
            layers.check(self)?;
        }
        if self.region.is_none() && self.periodic.contains(&true) {
            return Err(MeshError::NoBox);
        }
        if !(1..=2).contains(&self.order) {
            return Err(MeshError::Option {
                name: "order",
                wanted: "1 or 2",
                value: f64::from(self.order),
            });
        }
        Ok(())
    }

    /// Checks that `needed` bytes are allowed.
    pub(crate) fn check_memory(&self, needed: u64) -> Result<(), MeshError> {
        let allowed = match self.memory {
            DEFAULT_MEMORY_BYTES => DEFAULT_MEMORY_BYTES.min(memory::of_machine()),
            asked => asked,
        };
        if needed > allowed {
            return Err(MeshError::Memory {
                size: self.size,
                needed: needed >> 20,
                allowed: allowed >> 20,
            });
        }
        Ok(())
    }

    /// Returns the number of tetrahedra that the memory allows.
    pub(crate) fn most_tetrahedra(&self) -> usize {
        (self.memory / BYTES_PER_TETRAHEDRON) as usize
    }

    /// Returns the measure of a tetrahedron whose angles just lie within the bounds.
    pub(crate) fn goal(&self) -> f64 {
        self.angles[0]
            .to_radians()
            .sin()
            .max(isoform_check::quality::OBTUSE_WEIGHT * self.angles[1].to_radians().sin())
    }
}

/// Layers of wedges (prisms) inside of the solid, along parts of its surface: a boundary layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Names of the parts, or patterns with `*` for any characters. Every part whose name matches
    /// one of them has layers.
    pub parts: Vec<String>,
    /// Thickness of the layer on the surface, in model units.
    pub first: f64,
    /// Ratio of the thickness of each layer to that of the layer before it.
    pub growth: f64,
    /// Number of layers.
    pub count: usize,
}

impl Layers {
    /// Returns the total thickness of the first k layers, for k from 0 to the number of layers.
    ///
    /// ```
    /// use isoform_mesh::Layers;
    ///
    /// let layers = Layers { parts: vec!["wall".into()], first: 1.0, growth: 2.0, count: 3 };
    /// assert_eq!(layers.heights(), [0.0, 1.0, 3.0, 7.0]);
    /// ```
    pub fn heights(&self) -> Vec<f64> {
        let mut heights = vec![0.0];
        let (mut height, mut thickness) = (0.0, self.first);
        for _ in 0..self.count {
            height += thickness;
            thickness *= self.growth;
            heights.push(height);
        }
        heights
    }

    /// Returns the total thickness of the layers.
    pub fn thickness(&self) -> f64 {
        self.heights().pop().unwrap_or(0.0)
    }

    /// Checks that every number is valid, also in combination with the other options.
    fn check(&self, options: &Options) -> Result<(), MeshError> {
        positive("layers' first thickness", self.first)?;
        positive("layers' growth", self.growth)?;
        // Boundary layers have a few dozen at most.
        if !(1..=100).contains(&self.count) {
            return Err(MeshError::Option {
                name: "number of layers",
                wanted: "between 1 and 100",
                value: self.count as f64,
            });
        }
        positive("layers' thickness", self.thickness())?;
        let what = match options {
            o if o.surface_only => "with the surface alone",
            o if o.order != 1 => "with a second order",
            o if o.periodic.contains(&true) => "in unit cells",
            _ => return Ok(()),
        };
        Err(MeshError::NoLayers { what })
    }
}

fn positive(name: &'static str, value: f64) -> Result<(), MeshError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(MeshError::Option {
            name,
            wanted: "a positive number",
            value,
        })
    }
}

/// Edge lengths by position, in model units. Values that are not positive numbers impose no limit.
#[derive(Clone)]
pub struct Sizes(pub Arc<dyn Fn(Point3) -> f64 + Send + Sync>);

impl std::fmt::Debug for Sizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sizes")
    }
}

impl Sizes {
    /// Creates sizes from samples: the size of the nearest one, plus `growth` times the distance
    /// from it. Without samples lengths are unlimited.
    ///
    /// ```
    /// use isoform_mesh::Sizes;
    ///
    /// let sizes = Sizes::nearest(&[([0.0; 3], 0.1), ([10.0, 0.0, 0.0], 1.0)], 0.5);
    /// assert_eq!((sizes.0)([0.0; 3]), 0.1);
    /// // Two units away from the first sample: 0.1 + 0.5 · 2.
    /// assert_eq!((sizes.0)([0.0, 2.0, 0.0]), 1.1);
    /// assert_eq!((sizes.0)([10.0, 0.0, 0.0]), 1.0);
    /// ```
    pub fn nearest(samples: &[(Point3, f64)], growth: f64) -> Self {
        let tree = KdTree::new(&samples.iter().map(|s| s.0).collect::<Vec<_>>());
        let sizes: Vec<f64> = samples.iter().map(|s| s.1).collect();
        Self(Arc::new(move |p| {
            tree.nearest(p)
                .map_or(f64::INFINITY, |(i, d)| sizes[i] + growth * d.sqrt())
        }))
    }

    /// Returns the edge length at a point; infinite without a limit.
    pub(crate) fn at(&self, p: Point3) -> f64 {
        let s = (self.0)(p);
        if s > 0.0 { s } else { f64::INFINITY }
    }
}
