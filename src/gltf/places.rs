//! Where the nodes of a document show its meshes: transforms of nodes, of the instances of a batch, and of joints.
//!
//! Skins stand as their joints' nodes do, animations do not run. What is no transform changes nothing.

use super::accessor::Accessor;
use super::buffers::Buffers;
use super::document::{Document, DocumentError};
use super::instancing::INSTANCING;
use super::json;
use super::similarity;
use super::views::Views;
use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;

/// A node's own transform.
pub fn local(node: &Value) -> DMat4 {
    fn numbers<const N: usize>(node: &Value, key: &str) -> Option<[f64; N]> {
        let items = node.get(key)?.as_array()?;
        let values: Vec<f64> = items.iter().filter_map(Value::as_f64).collect();
        values.try_into().ok()
    }
    if let Some(matrix) = numbers::<16>(node, "matrix") {
        return DMat4::from_cols_array(&matrix);
    }
    let shift = numbers::<3>(node, "translation").map_or(DVec3::ZERO, DVec3::from_array);
    let turn = numbers::<4>(node, "rotation").map_or(DQuat::IDENTITY, |q| similarity::rotation(DQuat::from_array(q)));
    let scale = numbers::<3>(node, "scale").map_or(DVec3::ONE, DVec3::from_array);
    DMat4::from_scale_rotation_translation(scale, turn, shift)
}

/// The indices in `value[key]`; what is no index is left out.
pub fn list(value: &Value, key: &str) -> Vec<usize> {
    let items = value.get(key).and_then(Value::as_array);
    items.into_iter().flatten().filter_map(|i| Some(json::integer(i)? as usize)).collect()
}

/// Where the instances of node `number` stand in its space: at its origin, unless `EXT_mesh_gpu_instancing` says otherwise.
pub fn instances(document: &Document, views: &Views<'_>, number: usize) -> Result<Vec<DMat4>, DocumentError> {
    let node = document.array("nodes")?.get(number).unwrap_or(&Value::Null);
    let Some(extension) = json::extension(node, INSTANCING) else { return Ok(vec![DMat4::IDENTITY]) };
    let place = format!("nodes[{number}].extensions.{INSTANCING}.attributes");
    let attributes = extension.get("attributes").unwrap_or(&Value::Null);
    let read = |name: &str, components: usize| -> Result<Option<Vec<f64>>, DocumentError> {
        let Some(accessor) = json::index(attributes, name, &place)? else { return Ok(None) };
        let numbers = Accessor::parse(document, accessor, &place)?.numbers(views, None)?;
        if numbers.components != components {
            return Err(DocumentError::invalid(&place, format!("`{name}` must have {components} components")));
        }
        Ok(Some(numbers.values.into_iter().map(f64::from).collect()))
    };
    let (shifts, turns, scales) = (read("TRANSLATION", 3)?, read("ROTATION", 4)?, read("SCALE", 3)?);
    let counts = [(&shifts, 3), (&turns, 4), (&scales, 3)];
    // Where the attributes disagree, what all of them can serve is drawn.
    let count = counts.iter().filter_map(|(v, n)| Some(v.as_ref()?.len() / n)).min();
    let Some(count) = count else { return Ok(vec![DMat4::IDENTITY]) };
    let at = |values: &Option<Vec<f64>>, i: usize, default: DVec3| {
        values.as_ref().map_or(default, |v| DVec3::from_slice(&v[i * 3..]))
    };
    let instance = |i: usize| {
        let turn = turns.as_ref().map_or(DQuat::IDENTITY, |v| similarity::rotation(DQuat::from_slice(&v[i * 4..])));
        DMat4::from_scale_rotation_translation(at(&scales, i, DVec3::ONE), turn, at(&shifts, i, DVec3::ZERO))
    };
    Ok((0..count).map(instance).collect())
}

/// One matrix for each joint of a skin: from the mesh's space to the world.
pub fn joints(document: &Document, views: &Views<'_>, skin: usize) -> Result<Vec<DMat4>, DocumentError> {
    let nodes = document.array("nodes")?;
    let Some(value) = document.array("skins")?.get(skin) else { return Ok(Vec::new()) };
    let parents = parents(nodes);
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

fn parents(nodes: &[Value]) -> Vec<Option<usize>> {
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in list(node, "children") {
            if let Some(parent) = parents.get_mut(child) {
                *parent = Some(i);
            }
        }
    }
    parents
}

/// Calls `visit` with a mesh and a transform to the world, for every node of the document that shows it, whether or not a scene
/// shows the node, and for every instance of a batch. A skinned mesh is where each of its joints would put it.
pub fn visit(document: &Document, buffers: &Buffers, mut visit: impl FnMut(usize, DMat4)) -> Result<(), DocumentError> {
    let views = Views::new(document, buffers)?;
    let nodes = document.array("nodes")?;
    let roots = parents(nodes).into_iter().enumerate().filter(|(_, parent)| parent.is_none());
    let mut open: Vec<(usize, DMat4)> = roots.map(|(root, _)| (root, DMat4::IDENTITY)).collect();
    while let Some((number, above)) = open.pop() {
        let node = &nodes[number];
        let transform = above * local(node);
        let place = || format!("nodes[{number}]");
        if let Some(mesh) = json::index(node, "mesh", place())? {
            if let Some(skin) = json::index(node, "skin", place())? {
                // Its node's transform does not count.
                for joint in joints(document, &views, skin)? {
                    visit(mesh, joint);
                }
            } else {
                for instance in instances(document, &views, number)? {
                    visit(mesh, transform * instance);
                }
            }
        }
        let children = list(node, "children").into_iter().filter(|child| *child < nodes.len());
        open.extend(children.map(|child| (child, transform)));
    }
    Ok(())
}

/// The largest factor by which a transform stretches an axis of what it moves.
pub fn scale(transform: &DMat4) -> f64 {
    [0, 1, 2].map(|i| transform.col(i).truncate().length()).into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::fixture;
    use serde_json::json;

    #[test]
    fn parents_batches_and_joints_place_meshes() {
        let mut document = fixture::square();
        document.json["nodes"] = json!([
            { "scale": [2, 2, 2], "children": [1] },
            { "mesh": 0, "translation": [1, 0, 0], "scale": [1, 3, 1] },
            // At the corners of the square.
            { "mesh": 0, "translation": [0, 0, 7], "extensions": { INSTANCING: { "attributes": { "TRANSLATION": 0 } } } },
            // Where its joint is, not where its node is.
            { "mesh": 0, "skin": 0, "translation": [9, 9, 9] },
            { "scale": [5, 5, 5], "translation": [0, 8, 0] },
        ]);
        document.json["skins"] = json!([{ "joints": [4] }]);
        let buffers = Buffers::load(&document, std::path::Path::new("")).unwrap();
        let mut seen: Vec<(f64, [f64; 3])> = Vec::new();
        visit(&document, &buffers, |mesh, transform| {
            assert_eq!(mesh, 0);
            seen.push((scale(&transform), transform.col(3).truncate().to_array()));
        })
        .unwrap();
        seen.sort_by(|a, b| a.1.partial_cmp(&b.1).unwrap());
        let batch = |x: f64, y: f64| (1.0, [x, y, 7.0]);
        let expected = [
            batch(0.0, 0.0),
            batch(0.0, 1.0),
            (5.0, [0.0, 8.0, 0.0]),
            batch(1.0, 0.0),
            batch(1.0, 1.0),
            (6.0, [2.0, 0.0, 0.0]),
        ];
        assert_eq!(seen, expected);
    }

    #[test]
    fn a_matrix_wins_and_what_is_no_transform_changes_nothing() {
        let mut matrix = DMat4::from_scale(DVec3::splat(4.0)).to_cols_array();
        matrix[12] = 3.0;
        let node = json!({ "matrix": matrix, "scale": [9, 9, 9] });
        assert_eq!(local(&node), DMat4::from_cols_array(&matrix));
        assert_eq!(local(&json!({ "scale": [1, 2], "rotation": [0, 0, 0, 0] })), DMat4::IDENTITY);
    }
}
