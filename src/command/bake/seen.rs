//! How large each mesh of a scene is, or appears from where the scene is seen.

use glam::DVec3;

use crate::appearance::views::fibonacci;
use crate::config::ViewSettings;
use crate::gltf::document::DocumentError;
use crate::gltf::places;
use crate::gltf::scene::Scene;
use crate::mesh::layout::frame;

/// Cameras that stand for one distance.
const AROUND: usize = 32;

/// By mesh, the largest scale that it is shown at; 1 where no node shows it. With views: the same as it appears, scale divided by
/// distance, its quadratic mean over the cameras: areas on pictures go with the square. A camera inside a mesh's sphere sees it
/// as from the sphere's surface.
pub fn scales(scene: &Scene, settings: &ViewSettings) -> Result<Vec<f64>, DocumentError> {
    let spheres: Vec<(DVec3, f64)> = (scene.meshes.iter())
        .map(|mesh| frame(mesh.triangle_primitives().map(|(_, primitive)| primitive)))
        .map(|(middle, radius)| (DVec3::from(middle), radius))
        .collect();
    let cameras = cameras(scene, &spheres, settings)?;
    // By mesh and camera.
    let columns = cameras.len().max(1);
    let mut largest = vec![0.0_f64; spheres.len() * columns];
    places::visit(&scene.document, &scene.buffers, |mesh, transform| {
        let Some(&(middle, radius)) = spheres.get(mesh) else { return };
        let scale = places::scale(&transform);
        let middle = transform.transform_point3(middle);
        for column in 0..columns {
            let seen = cameras.get(column).map_or(scale, |camera| scale / middle.distance(*camera).max(radius * scale));
            let largest = &mut largest[mesh * columns + column];
            if seen.is_finite() && *largest < seen {
                *largest = seen;
            }
        }
    })?;
    let mean = |seen: &[f64]| (seen.iter().map(|seen| seen * seen).sum::<f64>() / columns as f64).sqrt();
    let scale = |seen: &[f64]| if columns == 1 { seen[0] } else { mean(seen) };
    Ok(largest.chunks(columns).map(scale).map(|scale| if scale == 0.0 { 1.0 } else { scale }).collect())
}

/// Where the scene is seen from, in its space; nowhere if the settings do not say.
fn cameras(scene: &Scene, spheres: &[(DVec3, f64)], settings: &ViewSettings) -> Result<Vec<DVec3>, DocumentError> {
    let mut cameras: Vec<DVec3> = settings.cameras.iter().map(|&place| DVec3::from_array(place)).collect();
    if settings.distances.is_empty() {
        return Ok(cameras);
    }
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    places::visit(&scene.document, &scene.buffers, |mesh, transform| {
        let Some(&(middle, radius)) = spheres.get(mesh).filter(|(_, radius)| 0.0 < *radius) else { return };
        let middle = transform.transform_point3(middle);
        let reach = DVec3::splat(radius * places::scale(&transform));
        if middle.is_finite() && reach.is_finite() {
            low = low.min(middle - reach);
            high = high.max(middle + reach);
        }
    })?;
    let middle = if low.x <= high.x { (low + high) * 0.5 } else { DVec3::ZERO };
    let directions = fibonacci(AROUND);
    let around = |&distance: &f64| directions.iter().map(move |direction| middle + *direction * distance);
    cameras.extend(settings.distances.iter().flat_map(around));
    Ok(cameras)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::{Container, Document};
    use crate::gltf::read::read_bytes;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Two meshes of radius 1 round their origins, on the given nodes.
    fn scene(nodes: &Value) -> Scene {
        let corners: [[f32; 3]; 3] = [[-0.8, -0.6, 0.0], [0.8, -0.6, 0.0], [0.0, 0.6, 0.0]];
        let bytes: Vec<u8> = corners.iter().flatten().flat_map(|f| f.to_le_bytes()).collect();
        let mut document = Document::new(Container::Glb, "test");
        let mesh = json!({ "primitives": [{ "attributes": { "POSITION": 0 } }] });
        document.json = json!({
            "asset": { "version": "2.0" },
            "scenes": [{ "nodes": (0..nodes.as_array().unwrap().len()).collect::<Vec<_>>() }],
            "nodes": nodes,
            "meshes": [mesh, mesh],
            "accessors": [{
                "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-0.8, -0.6, 0], "max": [0.8, 0.6, 0],
            }],
            "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
            "buffers": [{ "byteLength": bytes.len() }],
        });
        document.bin = Some(std::sync::Arc::from(bytes));
        read_bytes(&document.to_glb_bytes().unwrap(), Path::new("")).unwrap()
    }

    fn views(cameras: &[[f64; 3]], distances: &[f64]) -> ViewSettings {
        ViewSettings { cameras: cameras.to_vec(), distances: distances.to_vec() }
    }

    fn near(found: &[f64], expected: [f64; 2]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {expected:?}");
    }

    #[test]
    fn without_views_the_largest_scale_counts() {
        let scene = scene(&json!([{ "mesh": 0, "scale": [2, 1, 1], "translation": [10, 0, 0] }, { "mesh": 0 }]));
        near(&scales(&scene, &ViewSettings::default()).unwrap(), [2.0, 1.0]);
    }

    #[test]
    fn cameras_make_near_things_large() {
        let nodes = json!([
            { "mesh": 0, "scale": [2, 2, 2], "translation": [10, 0, 0] },
            { "mesh": 0 },
            { "mesh": 1, "scale": [0.5, 0.5, 0.5], "translation": [0, 0, 5] },
        ]);
        let scene = scene(&nodes);
        // The nearer node appears larger than the one of twice the size: 1/5 and 2/√125. The camera is inside the other mesh.
        near(&scales(&scene, &views(&[[0.0, 0.0, 5.0]], &[])).unwrap(), [0.2, 1.0]);
        // Each camera counts: √((0.2² + 1²) / 2), since the large node is within a radius of the second one.
        let two = scales(&scene, &views(&[[0.0, 0.0, 5.0], [10.0, 0.0, 1.0]], &[])).unwrap();
        near(&two, [(1.04f64 / 2.0).sqrt(), f64::midpoint(1.0, 0.25 / 116.0).sqrt()]);
    }

    #[test]
    fn distances_are_cameras_all_round_the_middle() {
        let alone = scene(&json!([{ "mesh": 0, "translation": [10, 0, 0] }]));
        near(&scales(&alone, &views(&[], &[4.0])).unwrap(), [0.25, 1.0]);
        near(&scales(&alone, &views(&[], &[4.0, 2.0])).unwrap(), [f64::midpoint(0.0625, 0.25).sqrt(), 1.0]);
        // What is in the middle is seen from 8 everywhere; what lies aside is nearer to some cameras, and appears larger.
        let row = scene(
            &json!([{ "mesh": 0 }, { "mesh": 1, "translation": [-6, 0, 0] }, { "mesh": 1, "translation": [6, 0, 0] }]),
        );
        let seen = scales(&row, &views(&[], &[8.0])).unwrap();
        assert!((seen[0] - 0.125).abs() < 1e-6 && 0.125 < seen[1] && seen[1] < 0.5, "{seen:?}");
    }
}
