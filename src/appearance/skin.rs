//! Skinned meshes at rest: vertices moved by the joints' nodes as the file leaves them. Animations do not run.

use super::assemble::{list, local};
use super::drawable::Part;
use crate::gltf::accessor::Accessor;
use crate::gltf::document::{Document, DocumentError};
use crate::gltf::json;
use crate::gltf::views::Views;
use crate::mesh::Primitive;
use glam::{DMat3, DMat4, DVec3};

/// One matrix for each joint of a skin: from the mesh's space to the world.
pub fn joints(document: &Document, views: &Views<'_>, skin: usize) -> Result<Vec<DMat4>, DocumentError> {
    let nodes = document.array("nodes")?;
    let Some(value) = document.array("skins")?.get(skin) else { return Ok(Vec::new()) };
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in list(node, "children") {
            if let Some(parent) = parents.get_mut(child) {
                *parent = Some(i);
            }
        }
    }
    let world = |mut node: usize| {
        let mut matrix = local(&nodes[node]);
        // Nodes are a forest, as was checked on reading: this ends.
        while let Some(parent) = parents[node] {
            matrix = local(&nodes[parent]) * matrix;
            node = parent;
        }
        matrix
    };
    let place = format!("skins[{skin}]");
    let inverse = match json::index(value, "inverseBindMatrices", &place)? {
        None => Vec::new(),
        Some(index) => {
            let numbers = Accessor::parse(document, index, &place)?.numbers(views, None)?;
            if numbers.components != 16 {
                return Err(DocumentError::invalid(&place, "`inverseBindMatrices` must be of type `MAT4`"));
            }
            numbers.values
        }
    };
    let bind = |i: usize| {
        let matrix = inverse.get(i * 16..i * 16 + 16);
        matrix.map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&std::array::from_fn(|k| f64::from(m[k]))))
    };
    let joints = list(value, "joints").into_iter().filter(|node| *node < nodes.len()).enumerate();
    Ok(joints.map(|(i, node)| world(node) * bind(i)).collect())
}

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
