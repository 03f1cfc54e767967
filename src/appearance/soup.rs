//! Drawables as triangles in one space, for measures that see no pixels.

use super::drawable::Drawable;
use crate::compare::Soup;
use glam::{DVec3, Vec2};

/// All triangles of all instances, world space, with the texture coordinates of their base colour (or of the first set,
/// where the base colour has no texture).
pub fn soup(drawable: &Drawable) -> Soup {
    let mut soup = Soup::default();
    for instance in &drawable.instances {
        let part = &drawable.parts[instance.part];
        let material = &drawable.looks.materials[part.material];
        let set = material.base_texture.map_or(0, |texture| texture.set);
        let uvs = part.uvs.get(set).filter(|uvs| !uvs.is_empty());
        let place = |i: u32| instance.transform.transform_point3(part.positions[i as usize].as_dvec3());
        let uv = |uvs: &Vec<Vec2>, i: u32| uvs[i as usize].as_dvec2().to_array();
        for t in part.indices.chunks_exact(3) {
            soup.corners.push([t[0], t[1], t[2]].map(|i| DVec3::to_array(&place(i))));
            soup.uvs.push(uvs.map(|uvs| [t[0], t[1], t[2]].map(|i| uv(uvs, i))));
            soup.materials.push(part.material as u32);
        }
    }
    soup
}
