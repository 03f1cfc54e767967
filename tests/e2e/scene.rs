//! Small glTF scenes made in code.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// A mesh of triangles with normals and texture coordinates.
#[derive(Clone, Debug)]
pub struct Shape {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    texcoords: Vec<[f32; 2]>,
    indices: Vec<u16>,
}

impl Shape {
    /// A square of `side × side` cells in the plane z = `bump`·sin(…): 2·side² triangles.
    pub fn grid(side: u16, bump: f32) -> Self {
        let at = |i: u16| f32::from(i) / f32::from(side);
        Self::sheet(side, side, |i, j| {
            let (u, v) = (at(i), at(j));
            ([u, v, bump * (9.0 * u).sin() * (7.0 * v).cos()], [0.0, 0.0, 1.0], [u, v])
        })
    }

    /// A sphere of radius 1 with a seam: 2·rings·segments triangles, those at the poles without area left out.
    pub fn sphere(rings: u16, segments: u16) -> Self {
        let mut shape = Self::sheet(segments, rings, |i, j| {
            let (u, v) = (f32::from(i) / f32::from(segments), f32::from(j) / f32::from(rings));
            let (longitude, latitude) = (std::f32::consts::TAU * u, std::f32::consts::PI * v);
            let round = latitude.sin();
            let normal = [round * longitude.cos(), latitude.cos(), round * longitude.sin()];
            (normal, normal, [u, v])
        });
        let last = (rings) * (segments + 1);
        // Two corners on the same pole make no triangle.
        let poles = |t: &[u16]| {
            t.iter().filter(|&&i| i <= segments).count() < 2 && t.iter().filter(|&&i| i >= last).count() < 2
        };
        shape.indices = shape.indices.chunks_exact(3).filter(|t| poles(t)).flatten().copied().collect();
        shape
    }

    fn sheet(columns: u16, rows: u16, vertex: impl Fn(u16, u16) -> ([f32; 3], [f32; 3], [f32; 2])) -> Self {
        let mut shape = Self { positions: vec![], normals: vec![], texcoords: vec![], indices: vec![] };
        for j in 0..=rows {
            for i in 0..=columns {
                let (position, normal, texcoord) = vertex(i, j);
                shape.positions.push(position);
                shape.normals.push(normal);
                shape.texcoords.push(texcoord);
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = j * (columns + 1) + i;
                let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
                shape.indices.extend([a, b, d, a, d, c]);
            }
        }
        shape
    }

    /// The same shape, moved in its own space: other bytes, another mesh.
    pub fn shifted(mut self, by: f32) -> Self {
        for position in &mut self.positions {
            position[0] += by;
        }
        self
    }

    /// The same shape in another size, turned round the z axis by quarters, and moved.
    pub fn moved(mut self, scale: f32, quarters: usize, by: [f32; 3]) -> Self {
        let turn = |mut v: [f32; 3]| {
            for _ in 0..quarters {
                v = [-v[1], v[0], v[2]];
            }
            v
        };
        for (position, normal) in self.positions.iter_mut().zip(&mut self.normals) {
            let turned = turn(*position);
            *position = [0, 1, 2].map(|k| turned[k] * scale + by[k]);
            *normal = turn(*normal);
        }
        self
    }

    /// One vertex is somewhere else.
    pub fn dented(mut self, vertex: usize, by: f32) -> Self {
        self.positions[vertex][2] += by;
        self
    }

    /// Both in one mesh, side by side.
    pub fn with(mut self, other: &Self) -> Self {
        let first = self.positions.len() as u16;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.texcoords.extend(&other.texcoords);
        self.indices.extend(other.indices.iter().map(|i| first + i));
        self
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }
}

/// A scene being made.
pub struct Scene {
    json: Value,
    bin: Vec<u8>,
}

impl Scene {
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0", "generator": "lodbake tests" },
            "scene": 0,
            "scenes": [{ "nodes": [] }],
            "nodes": [], "meshes": [], "accessors": [], "bufferViews": [],
            "materials": [{ "name": "first" }, { "name": "second" }],
        });
        Self { json, bin: Vec::new() }
    }

    /// One mesh, one node.
    pub fn of(shape: &Shape) -> Self {
        let mut scene = Self::new();
        let mesh = scene.mesh("shape", shape);
        scene.node("node", mesh, [0.0; 3]);
        scene
    }

    /// Appends a mesh with its own copy of the shape's bytes; answers its index.
    pub fn mesh(&mut self, name: &str, shape: &Shape) -> usize {
        self.mesh_with_material(name, shape, 0)
    }

    /// As [`Self::mesh`], with the material 0 or 1.
    pub fn mesh_with_material(&mut self, name: &str, shape: &Shape, material: usize) -> usize {
        let count = shape.positions.len();
        let position = self.accessor(bytemuck::cast_slice(&shape.positions), count, "VEC3", 5126);
        let normal = self.accessor(bytemuck::cast_slice(&shape.normals), count, "VEC3", 5126);
        let texcoord = self.accessor(bytemuck::cast_slice(&shape.texcoords), count, "VEC2", 5126);
        let indices = self.accessor(bytemuck::cast_slice(&shape.indices), shape.indices.len(), "SCALAR", 5123);
        let bound = |pick: fn(f32, f32) -> f32| {
            (0..3).map(|k| shape.positions.iter().map(|p| p[k]).reduce(pick)).collect::<Option<Vec<f32>>>()
        };
        self.json["accessors"][position]["min"] = json!(bound(f32::min));
        self.json["accessors"][position]["max"] = json!(bound(f32::max));
        self.push(
            "meshes",
            json!({ "name": name, "primitives": [{
                "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord },
                "indices": indices, "material": material,
            }]}),
        )
    }

    /// Puts points at the corners of a mesh before its triangles, with the other material.
    pub fn add_points(&mut self, mesh: usize) {
        let primitives = self.json["meshes"][mesh]["primitives"].as_array_mut().expect("it is an array");
        let position = primitives[0]["attributes"]["POSITION"].clone();
        primitives.insert(0, json!({ "mode": 0, "attributes": { "POSITION": position }, "material": 1 }));
    }

    /// Appends a node of the scene; answers its index.
    pub fn node(&mut self, name: &str, mesh: usize, translation: [f32; 3]) -> usize {
        let node = self.push("nodes", json!({ "name": name, "mesh": mesh, "translation": translation }));
        self.json["scenes"][0]["nodes"].as_array_mut().expect("it is an array").push(node.into());
        node
    }

    /// Appends a node of the scene without a name; answers its index.
    pub fn nameless(&mut self, mesh: usize, translation: [f32; 3]) -> usize {
        let node = self.node("", mesh, translation);
        self.json["nodes"][node].as_object_mut().expect("it is an object").shift_remove("name");
        node
    }

    /// Gives a node a member.
    pub fn set(&mut self, node: usize, key: &str, value: Value) {
        self.json["nodes"][node][key] = value;
    }

    fn accessor(&mut self, bytes: &[u8], count: usize, kind: &str, component: u32) -> usize {
        let view = self.push(
            "bufferViews",
            json!({
                "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len(),
            }),
        );
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }

    fn push(&mut self, array: &str, value: Value) -> usize {
        let array = self.json[array].as_array_mut().expect("it is an array");
        array.push(value);
        array.len() - 1
    }

    /// One binary file.
    pub fn glb(&self) -> Vec<u8> {
        let text = pad(self.with_buffer(None).to_string().into_bytes(), b' ');
        let bin = pad(self.bin.clone(), 0);
        let mut bytes = Vec::from(*b"glTF");
        bytes.extend(2u32.to_le_bytes());
        bytes.extend((12 + 8 + text.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bin)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }

    /// One text file with the buffer as a data URI.
    pub fn gltf(&self) -> Vec<u8> {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.bin));
        self.with_buffer(Some(&uri)).to_string().into_bytes()
    }

    /// A text file, and the buffer that it names `uri`.
    pub fn gltf_beside(&self, uri: &str) -> (Vec<u8>, Vec<u8>) {
        (self.with_buffer(Some(uri)).to_string().into_bytes(), self.bin.clone())
    }

    fn with_buffer(&self, uri: Option<&str>) -> Value {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        if let Some(uri) = uri {
            json["buffers"][0]["uri"] = uri.into();
        }
        json
    }
}

fn pad(mut bytes: Vec<u8>, with: u8) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(4), with);
    bytes
}
