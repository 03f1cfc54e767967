//! Skinned meshes at rest: vertices moved by the joints' nodes as the file leaves them. Animations do not run.

use super::drawable::Part;
use crate::mesh::Primitive;
use glam::{DMat3, DMat4, DVec3};

/// A primitive in the pose of `joints`.
pub fn pose(primitive: &Primitive, joints: &[DMat4], material: usize) -> Part {
    let mut moved = primitive.clone();
    let matrices: Vec<Option<DMat4>> = (0..primitive.count).map(|v| blend(primitive, joints, v)).collect();
    for attribute in &mut moved.attributes {
        let components = attribute.components;
        let rows = attribute.values.chunks_exact_mut(components).zip(&matrices);
        let rows = rows.filter_map(|(row, matrix)| Some((row, matrix.as_ref()?)));
        let put = |row: &mut [f32], v: DVec3| row[..3].copy_from_slice(&v.as_vec3().to_array());
        let get = |row: &[f32]| DVec3::new(f64::from(row[0]), f64::from(row[1]), f64::from(row[2]));
        match (attribute.name.as_str(), components) {
            ("POSITION", 3) => rows.for_each(|(row, m)| put(row, m.transform_point3(get(row)))),
            ("NORMAL", 3) => rows.for_each(|(row, m)| {
                let linear = DMat3::from_mat4(*m);
                let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
                let sign = if x.cross(y).dot(z) < 0.0 { -1.0 } else { 1.0 };
                let n = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * get(row) * sign;
                put(row, n.normalize_or_zero());
            }),
            ("TANGENT", 4) => rows.for_each(|(row, m)| put(row, m.transform_vector3(get(row)).normalize_or_zero())),
            _ => {}
        }
    }
    Part::new(&moved, material)
}

/// The matrix of one vertex; `None` if no joint moves it.
fn blend(primitive: &Primitive, joints: &[DMat4], vertex: usize) -> Option<DMat4> {
    let mut sum = DMat4::ZERO;
    let mut total = 0.0;
    for set in 0..2 {
        let rows = ["JOINTS", "WEIGHTS"].map(|name| {
            let attribute = primitive.attribute(&format!("{name}_{set}")).filter(|a| a.components == 4)?;
            attribute.values.get(vertex * 4..vertex * 4 + 4)
        });
        let [Some(indices), Some(weights)] = rows else { break };
        for (index, weight) in indices.iter().zip(weights) {
            if let Some(joint) = joints.get(*index as usize).filter(|_| *weight > 0.0) {
                sum += *joint * f64::from(*weight);
                total += f64::from(*weight);
            }
        }
    }
    (total > 0.0).then(|| sum * (1.0 / total))
}
