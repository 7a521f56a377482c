//! What the mesher is asked to make.

use crate::error::MeshError;
use crate::features::START;
use crate::memory;
use isoform_geom::{Aabb, KdTree, Point3};
use std::sync::Arc;

/// Bytes that a tetrahedron near the surface takes by estimate, with all that is known of it.
pub(crate) const BYTES: u64 = 400;
/// Bytes that the mesher may use unless told otherwise, if the machine has as many.
const MEMORY: u64 = 16 << 30;
/// Most layers of wedges: boundary layers have a few dozen at most.
const MOST_LAYERS: usize = 100;
/// Weight of a sine of an obtuse angle in the measure that is optimised, see
/// [`OBTUSE_WEIGHT`](isoform_check::quality::OBTUSE_WEIGHT).
const OBTUSE: f64 = isoform_check::quality::OBTUSE_WEIGHT;

/// What to make.
#[derive(Clone, Debug)]
pub struct Options {
    /// Edge length wanted, the largest one where sizes vary.
    pub size: f64,
    /// Smaller edges where a face would leave the surface by more than this (chordal error, model
    /// units).
    pub grade: Option<f64>,
    /// Smaller edges where this says so, by place.
    pub sizes: Option<Sizes>,
    /// 1 for straight edges, 2 for nodes in their middles, on the true surface.
    pub order: u32,
    /// Only the surface.
    pub surface_only: bool,
    /// The box to mesh in: what sticks out is cut off, the cuts are parts named `cap.x_min` and so
    /// on. The solid's own box if not given.
    pub region: Option<Aabb>,
    /// The axes along which the box is a unit cell: the mesh of its upper side is that of its lower
    /// side, node for node. The function must say so, too; it counts in the box alone.
    pub periodic: [bool; 3],
    /// Layers of wedges along parts of the surface.
    pub layers: Option<Layers>,
    /// The box in which the solid is looked for first where there is no `region`: about where it is,
    /// if that is known.
    pub start: Aabb,
    /// Tetrahedra are optimised until their angles lie within these bounds (degrees), or nothing
    /// helps any more.
    pub angles: [f64; 2],
    /// Maximum number of further meshes, with shorter edges where one is wrong: most rounded boxes
    /// whose seams are about a size apart are mended by the first, 30 blended balls by the fourth.
    pub rounds: usize,
    /// Bytes that the mesher may use at most, by its own estimate. The 16 GiB by default are no
    /// more than the machine has; what is asked for is tried, and refused where the machine surely
    /// has not enough.
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
            memory: MEMORY,
        }
    }
}

impl Options {
    /// Whether every number has a meaning.
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

    /// Whether `needed` bytes are allowed.
    pub(crate) fn check_memory(&self, needed: u64) -> Result<(), MeshError> {
        let allowed = match self.memory {
            MEMORY => MEMORY.min(memory::of_machine()),
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

    /// Tetrahedra that the memory allows.
    pub(crate) fn most_tetrahedra(&self) -> usize {
        (self.memory / BYTES) as usize
    }

    /// The measure of a tetrahedron whose angles just lie within the bounds.
    pub(crate) fn goal(&self) -> f64 {
        self.angles[0]
            .to_radians()
            .sin()
            .max(OBTUSE * self.angles[1].to_radians().sin())
    }
}

/// Layers of wedges (prisms) inside of the solid, along parts of its surface: a boundary layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Names of the parts, or patterns of them: `*` stands for any characters. A part whose name
    /// fits one of them has layers.
    pub parts: Vec<String>,
    /// Thickness of the layer on the surface, in model units.
    pub first: f64,
    /// How many times as thick as the layer before each one is.
    pub growth: f64,
    /// How many layers there are.
    pub count: usize,
}

impl Layers {
    /// Thickness of all layers, and of as many as there are below each of them: from 0 on.
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

    /// Thickness of all layers.
    pub fn thickness(&self) -> f64 {
        self.heights().pop().unwrap_or(0.0)
    }

    /// Whether every number has a meaning, also beside the other options.
    fn check(&self, options: &Options) -> Result<(), MeshError> {
        positive("layers' first thickness", self.first)?;
        positive("layers' growth", self.growth)?;
        if !(1..=MOST_LAYERS).contains(&self.count) {
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

/// Edge lengths wanted by place, in model units. What is not positive or no number counts as no
/// wish.
#[derive(Clone)]
pub struct Sizes(pub Arc<dyn Fn(Point3) -> f64 + Send + Sync>);

impl std::fmt::Debug for Sizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sizes")
    }
}

impl Sizes {
    /// From samples: the size of the nearest one, growing with the distance to it by no more than
    /// `growth` per length. Without samples there is no wish anywhere.
    ///
    /// ```
    /// use isoform_mesh::Sizes;
    ///
    /// let sizes = Sizes::nearest(&[([0.0; 3], 0.1), ([10.0, 0.0, 0.0], 1.0)], 0.5);
    /// assert_eq!((sizes.0)([0.0; 3]), 0.1);
    /// // Two units beside the first sample: 0.1 + 0.5 · 2.
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

    /// The edge length wanted at a point, infinite without a wish.
    pub(crate) fn at(&self, p: Point3) -> f64 {
        let s = (self.0)(p);
        if s > 0.0 { s } else { f64::INFINITY }
    }
}
