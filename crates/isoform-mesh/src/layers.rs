//! Layers of wedges along parts of the surface.
//!
//! The *core*, the solid without its layers, is meshed as any solid: where pieces have layers it
//! ends one thickness before them. The triangles of the core on these pieces are then brought
//! outward onto the pieces themselves, and the gap is filled with wedges between each triangle and
//! its image: no tetrahedron is squeezed, and edges and corners of the core become those of the
//! solid. Where a piece with layers meets one without, the *columns* of nodes stand on the latter,
//! and their sides are quadrilaterals of it.

mod core;
mod grow;

pub(crate) use self::core::Core;
pub(crate) use grow::grow;

use crate::error::MeshError;
use crate::options::Layers;
use isoform_geom::Solid;

/// Which of a solid's pieces have layers, of those that are `parts` of its surface.
///
/// # Errors
/// [`MeshError::NoPart`] if a name fits none.
pub(crate) fn layered(
    solid: &dyn Solid,
    parts: &[String],
    layers: &Layers,
) -> Result<Vec<bool>, MeshError> {
    let names = solid.names();
    let mut found = vec![false; names.len()];
    for pattern in &layers.parts {
        let fitting = |name: &String| fits(pattern, name) && parts.contains(name);
        let pieces: Vec<usize> = (0..names.len()).filter(|&i| fitting(&names[i])).collect();
        if pieces.is_empty() {
            return Err(MeshError::NoPart {
                pattern: pattern.clone(),
                parts: parts.to_vec(),
            });
        }
        for piece in pieces {
            found[piece] = true;
        }
    }
    Ok(found)
}

/// Whether a name fits a pattern, in which `*` stands for any characters.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else {
        return false;
    };
    let mut last = None;
    for part in parts {
        if let Some(middle) = last.replace(part) {
            match rest.find(middle) {
                Some(at) => rest = &rest[at + middle.len()..],
                None => return false,
            }
        }
    }
    last.map_or(rest.is_empty(), |end| rest.ends_with(end))
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn stars_stand_for_any_characters() {
        for (pattern, name) in [
            ("wall", "wall"),
            ("*", ""),
            ("*", "wall"),
            ("wall*", "wall"),
            ("wall*", "wall.2"),
            ("*wall", "outer wall"),
            ("*a*a", "aa"),
            ("b*r*e", "bore"),
            ("hf*.x_*", "hfBlock.x_min"),
        ] {
            assert!(fits(pattern, name), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("wall", "wall.2"),
            ("", "wall"),
            ("wall*", "a wall"),
            ("*wall", "wall.2"),
            ("*a*a", "a"),
            ("ab*ba", "aba"),
        ] {
            assert!(!fits(pattern, name), "{pattern} {name}");
        }
    }
}
