//! Whole documents of a few vertices, written by hand.

use super::*;
use crate::gltf::document::Container;
use crate::gltf::scene::SourcePrimitive;
use crate::mesh::Primitive;
use serde_json::{Value, json};
use std::sync::Arc;

/// A GLB under construction: each call of `floats` or `shorts` adds an accessor and answers its index.
struct Builder {
    document: Document,
    bin: Vec<u8>,
}

impl Builder {
    fn new() -> Self {
        Self { document: Document::new(Container::Glb, "test"), bin: Vec::new() }
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        self.bin.extend_from_slice(bytes);
        let view = self.document.push("bufferViews", view).unwrap();
        let accessor = json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        self.document.push("accessors", accessor).unwrap()
    }

    fn floats(&mut self, kind: &str, width: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    fn shorts(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    /// Four corners of a unit square.
    fn square(&mut self) -> usize {
        self.floats("VEC3", 3, &[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.])
    }

    fn read(mut self, primitive: Value) -> Result<Scene, String> {
        self.document.push("meshes", json!({ "name": "m", "primitives": [primitive] })).unwrap();
        self.read_all()
    }

    fn read_all(mut self) -> Result<Scene, String> {
        self.document.json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        self.document.bin = Some(Arc::from(self.bin));
        let bytes = self.document.to_glb_bytes().unwrap();
        read_bytes(&bytes, Path::new("")).map_err(|e| e.to_string())
    }
}

fn triangles(scene: &Scene) -> &Primitive {
    match &scene.meshes[0].primitives[0] {
        SourcePrimitive::Triangles(primitive) => primitive,
        SourcePrimitive::PassThrough { reason } => panic!("passed through: {reason}"),
    }
}

fn reason(scene: &Scene) -> &str {
    match &scene.meshes[0].primitives[0] {
        SourcePrimitive::Triangles(_) => "triangles",
        SourcePrimitive::PassThrough { reason } => reason,
    }
}

fn warnings(scene: &Scene) -> Vec<String> {
    scene.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect()
}

#[test]
fn attributes_are_sorted_and_lists_strips_and_fans_become_triangles() {
    type Case = (u32, Option<&'static [u16]>, &'static [u32]);
    let cases: [Case; 5] = [
        (4, Some(&[0, 1, 2, 2, 1, 3]), &[0, 1, 2, 2, 1, 3]),
        (5, None, &[0, 1, 2, 1, 3, 2]),
        (5, Some(&[3, 2, 1, 0]), &[3, 2, 1, 2, 0, 1]),
        (6, None, &[1, 2, 0, 2, 3, 0]),
        (4, None, &[0, 1, 2]),
    ];
    for (mode, indices, expected) in cases {
        let mut builder = Builder::new();
        let (position, uv) = (builder.square(), builder.floats("VEC2", 2, &[0.; 8]));
        let mut primitive = json!({ "mode": mode, "attributes": { "TEXCOORD_0": uv, "POSITION": position, "_A": uv } });
        if let Some(indices) = indices {
            primitive["indices"] = json!(builder.shorts(indices));
        }
        let scene = builder.read(primitive).unwrap();
        let read = triangles(&scene);
        assert_eq!(read.indices, expected, "mode {mode}");
        assert_eq!(
            read.attributes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(),
            ["POSITION", "TEXCOORD_0", "_A"]
        );
        assert_eq!((read.count, read.positions()[3]), (4, [1., 1., 0.]));
        let leftover = usize::from(mode == 4 && indices.is_none());
        assert_eq!(scene.warnings.len(), leftover, "{:?}", scene.warnings);
    }
}

#[test]
fn morph_targets() {
    let mut builder = Builder::new();
    let (position, moved) = (builder.square(), builder.floats("VEC3", 3, &[0.5; 12]));
    let still = json!({ "componentType": 5126, "type": "VEC3", "count": 4 });
    let still = builder.document.push("accessors", still).unwrap();
    let targets = json!([{ "POSITION": moved, "NORMAL": moved }, { "POSITION": still }, {}]);
    let indices = builder.shorts(&[0, 1, 2, 2, 1, 3]);
    let attributes = json!({ "POSITION": position });
    let scene = builder.read(json!({ "attributes": attributes, "indices": indices, "targets": targets })).unwrap();
    let read = triangles(&scene);
    assert_eq!(read.targets.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 0]);
    assert_eq!(read.targets[0][0].values, [0.5; 12]);
    assert_eq!(read.targets[1][0].values, [0.0; 12]);
    let words = "meshes[0].primitives[0].targets[0]: `NORMAL` displaces an attribute that the primitive does not have";
    assert_eq!(warnings(&scene), [words]);
}

#[test]
fn contradictions_are_named_with_their_place() {
    let with = |change: &dyn Fn(&mut Builder, usize) -> Value| {
        let mut builder = Builder::new();
        let position = builder.square();
        let primitive = change(&mut builder, position);
        builder.read(primitive).map(|_| ()).unwrap_err()
    };
    let short = with(&|b, p| json!({ "attributes": { "POSITION": p, "NORMAL": b.floats("VEC3", 3, &[0.; 9]) } }));
    assert_eq!(short, "meshes[0].primitives[0].attributes.NORMAL: accessor 1 has 3 elements for 4 vertices");
    let outside = with(&|b, p| json!({ "attributes": { "POSITION": p }, "indices": b.shorts(&[0, 1, 4]) }));
    assert_eq!(outside, "meshes[0].primitives[0].indices: index 4 is out of range (4 vertices)");
    let restart = with(&|b, p| json!({ "attributes": { "POSITION": p }, "indices": b.shorts(&[0, 1, 2, 65535]) }));
    let words = "meshes[0].primitives[0].indices: index 65535 restarts the primitive, which glTF does not allow";
    assert_eq!(restart, words);
    let flat = with(&|b, _| json!({ "attributes": { "POSITION": b.floats("VEC2", 2, &[0.; 8]) } }));
    assert_eq!(flat, "meshes[0].primitives[0].attributes.POSITION: a position has three components, not 2");
    let mode = with(&|_, p| json!({ "attributes": { "POSITION": p }, "mode": 7 }));
    assert_eq!(mode, "meshes[0].primitives[0]: unknown mode 7");
    assert_eq!(with(&|_, _| json!({})), "meshes[0].primitives[0]: `attributes` is missing");
    let infinite = with(
        &|b, _| json!({ "attributes": { "POSITION": b.floats("VEC3", 3, &[0., 0., 0., 1., f32::NEG_INFINITY, 0., 0., 0., 1.]) } }),
    );
    assert_eq!(infinite, "meshes[0].primitives[0].attributes.POSITION: element 1 is not finite (-inf)");
    // Neither the accessor alone nor one that follows its count may ask for what no bytes justify.
    let huge = with(&|b, p| {
        b.document.json["accessors"][p]["count"] = json!(1_000_000_000_000_u64);
        let empty = json!({ "componentType": 5126, "type": "VEC4", "count": 1_000_000_000_000_u64 });
        let colour = b.document.push("accessors", empty).unwrap();
        json!({ "attributes": { "POSITION": p, "COLOR_0": colour } })
    });
    assert!(huge.starts_with("accessors[0]: 1000000000000 elements from byte 0 needs 12000000000000 bytes"), "{huge}");
}

#[test]
fn odd_values_outside_positions_count_as_zero() {
    let mut builder = Builder::new();
    let mut values = [1.0f32; 12];
    (values[4], values[11]) = (f32::NAN, f32::INFINITY);
    let attributes = json!({ "POSITION": builder.square(), "NORMAL": builder.floats("VEC3", 3, &values) });
    let indices = builder.shorts(&[0, 1, 2, 2, 2, 3, 2, 1, 3]);
    let scene = builder.read(json!({ "attributes": attributes, "indices": indices })).unwrap();
    let normals = &triangles(&scene).attributes[0].values;
    assert_eq!((normals[3], normals[4], normals[11]), (1.0, 0.0, 0.0));
    assert_eq!(
        warnings(&scene),
        [
            "meshes[0].primitives[0].attributes.NORMAL: 2 values are not finite and count as zero in levels",
            "meshes[0].primitives[0]: 1 triangles use a vertex twice and are left out of the levels",
        ]
    );
}

#[test]
fn what_is_no_triangle_passes_through() {
    let passed = |change: &dyn Fn(&mut Builder, usize) -> Value| {
        let mut builder = Builder::new();
        let position = builder.square();
        let primitive = change(&mut builder, position);
        reason(&builder.read(primitive).unwrap()).to_owned()
    };
    for (mode, words) in [(0, "points"), (1, "lines"), (2, "a line loop"), (3, "a line strip")] {
        assert_eq!(passed(&|_, p| json!({ "attributes": { "POSITION": p }, "mode": mode })), words);
    }
    assert_eq!(passed(&|_, p| json!({ "attributes": { "NORMAL": p } })), "no POSITION");
    assert_eq!(passed(&|b, p| json!({ "attributes": { "POSITION": p }, "indices": b.shorts(&[]) })), "no triangles");
    let polygons = passed(&|_, p| json!({ "attributes": { "POSITION": p }, "extensions": { "EXT_mesh_polygon": {} } }));
    assert_eq!(polygons, "polygons");
    let zeros = passed(&|b, p| {
        b.document.json["accessors"][p].as_object_mut().unwrap().remove("bufferView");
        json!({ "attributes": { "POSITION": p } })
    });
    assert_eq!(zeros, "POSITION without data");
    let none = passed(&|b, p| {
        b.document.json["accessors"][p]["count"] = json!(0);
        json!({ "attributes": { "POSITION": p } })
    });
    assert_eq!(none, "no vertices");
}

#[test]
fn a_buffer_without_data_is_no_fault_in_itself() {
    let mut document = Document::new(Container::Gltf, "test");
    document.json["buffers"] = json!([{ "byteLength": 36 }]);
    document.json["bufferViews"] = json!([{ "buffer": 0, "byteLength": 36 }]);
    document.json["accessors"] = json!([{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 }]);
    document.json["meshes"] = json!([{ "primitives": [{ "attributes": { "POSITION": 0 } }] }]);
    let scene = read_bytes(&document.to_gltf_bytes(), Path::new("")).unwrap();
    assert_eq!(reason(&scene), "no data");
    assert_eq!(warnings(&scene), ["bufferViews[0]: buffer 0 has no data, so there is nothing to make levels of"]);
    let glb = document.to_glb_bytes().unwrap();
    let words = read_bytes(&glb, Path::new("")).unwrap_err().to_string();
    assert_eq!(words, "buffers[0]: damaged GLB: there is no BIN chunk for this buffer");
}

#[test]
fn few_used_vertices_of_many_are_kept_alone() {
    let mut builder = Builder::new();
    let positions: Vec<f32> = (0..300u16).map(f32::from).collect();
    let position = builder.floats("VEC3", 3, &positions);
    let indices = builder.shorts(&[90, 20, 50]);
    let target = json!([{ "POSITION": position }]);
    let scene =
        builder.read(json!({ "attributes": { "POSITION": position }, "indices": indices, "targets": target })).unwrap();
    let read = triangles(&scene);
    assert_eq!((read.count, read.indices.as_slice()), (3, &[2u32, 0, 1][..]));
    assert_eq!(read.positions()[1], [150., 151., 152.]);
    assert_eq!(read.targets[0][0].values[..3], [60., 61., 62.]);
    assert_eq!(scene.meshes[0].vertex_maps[&0], [20, 50, 90]);
    assert_eq!(*scene.meshes[0].source_indices(0, &read.indices), [90, 20, 50]);
}

#[test]
fn missing_images_and_unknown_requirements_are_warnings() {
    let mut builder = Builder::new();
    builder.document.json["images"] = json!([{ "uri": "no.png" }, { "uri": "http://x/y.png" }, { "uri": "data:,x" }]);
    builder.document.json["extensionsRequired"] = json!(["KHR_materials_unlit", "VENDOR_x"]);
    let scene = builder.read_all().unwrap();
    assert_eq!(
        warnings(&scene),
        [
            "extensionsRequired: `VENDOR_x` is required but unknown here: its parts stay as they are",
            "images[0]: there is no file `no.png`",
            "images[1]: uri `http://x/y.png` is not relative to the scene",
        ]
    );
    assert_eq!(scene.dependencies.len(), 1);
}

#[test]
fn errors_name_the_file_and_come_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let absent = read(&path).unwrap_err();
    assert_eq!(absent.to_string(), format!("failed to read `{}`: there is no such file", path.display()));
    std::fs::write(&path, r#"{"asset":{"version":"1.0"}}"#).unwrap();
    let old = read(&path).unwrap_err();
    assert!(old.to_string().ends_with("a.gltf`: asset: glTF version `1.0` is not supported (known: 2.0)"), "{old}");
    assert_eq!(old.hint(), Some("convert the file to glTF 2.0 first"));
}

/// The same square compressed by both codecs, under accessors that lie about it.
#[test]
fn compressed_squares() {
    let corners: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.]];
    let mut builder = Builder::new();
    let vertices = meshopt::encode_vertex_buffer(&corners).unwrap();
    let indices = meshopt::encode_index_buffer(&[0, 1, 2, 2, 1, 3], 4).unwrap();
    let position = builder.accessor(&vertices, 5126, "VEC3", 4);
    let order = builder.accessor(&indices, 5123, "SCALAR", 6);
    for (view, length, stride, count, mode) in
        [(0, vertices.len(), 12, 4, "ATTRIBUTES"), (1, indices.len(), 2, 6, "TRIANGLES")]
    {
        let offset = builder.document.json["bufferViews"][view]["byteOffset"].clone();
        let stream = json!({
            "buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": stride, "count": count, "mode": mode,
        });
        builder.document.json["bufferViews"][view]["extensions"] = json!({ "EXT_meshopt_compression": stream });
    }
    let scene = builder.read(json!({ "attributes": { "POSITION": position }, "indices": order })).unwrap();
    assert_eq!(triangles(&scene).positions(), corners);
    assert_eq!(triangles(&scene).triangles(), 2);

    let mut builder = Builder::new();
    let stream = draco_square(&corners);
    let compressed = builder.accessor(&stream, 5121, "SCALAR", stream.len());
    let liar = json!({ "componentType": 5126, "type": "VEC3", "count": 1_000_000_000_000_u64 });
    let liar = builder.document.push("accessors", liar).unwrap();
    let extension = json!({ "bufferView": compressed, "attributes": { "POSITION": 0 } });
    let scene = builder
        .read(json!({
            "attributes": { "POSITION": liar },
            "indices": liar,
            "extensions": { "KHR_draco_mesh_compression": extension },
        }))
        .unwrap();
    let mut read = triangles(&scene).positions().to_vec();
    read.sort_by(|a, b| a.partial_cmp(b).unwrap());
    for (found, wanted) in read.iter().zip([[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [1., 1., 0.]]) {
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-3), "{read:?}");
    }
    assert_eq!(triangles(&scene).triangles(), 2);
}

fn draco_square(corners: &[[f32; 3]; 4]) -> Vec<u8> {
    use draco_core::{DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, MeshEncoder, PointAttribute};
    let mut mesh = draco_core::Mesh::new();
    let mut position = PointAttribute::new();
    position.init(GeometryAttributeType::Position, 3, DataType::Float32, false, 4);
    position.buffer_mut().write(0, bytemuck::cast_slice(corners));
    mesh.add_attribute(position);
    mesh.set_num_faces(2);
    mesh.set_face_from_indices(0, [0, 1, 2]);
    mesh.set_face_from_indices(1, [2, 1, 3]);
    mesh.set_num_points(4);
    let mut encoder = MeshEncoder::new();
    encoder.set_mesh(mesh);
    let mut out = EncoderBuffer::new();
    encoder.encode(&EncoderOptions::new(), &mut out).unwrap();
    out.data().to_vec()
}
