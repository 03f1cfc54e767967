//! Writes glTF 2.0: collects nodes, meshes, materials and pictures, then gives `.glb` or `.gltf` with its files.
//! Knows nothing of what the scenes show.

use crate::raster::Coat;
use crate::surface::Surface;
use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// A document in the making.
#[derive(Default)]
pub struct Document {
    lists: Map<String, Value>,
    extensions: Map<String, Value>,
    pictures: Vec<Picture>,
    bin: Vec<u8>,
}

struct Picture {
    name: String,
    mime: &'static str,
    bytes: Vec<u8>,
}

/// Texture indices of a [`Coat`].
#[derive(Clone, Copy)]
pub struct CoatTextures {
    /// Base colour.
    pub color: usize,
    /// Normals.
    pub normal: usize,
    /// Roughness and metal.
    pub rough: usize,
}

/// What a deforming primitive has besides its surface; each list is as long as the surface has vertices, or empty.
#[derive(Default)]
pub struct Deform {
    /// Joints of the skin, four for each vertex.
    pub joints: Vec<[u8; 4]>,
    /// Their weights, in 1/255; each four sum to 255.
    pub weights: Vec<[u8; 4]>,
    /// Shifts of positions and normals, for each morph target.
    pub targets: Vec<Vec<[DVec3; 2]>>,
}

/// Where a node stands in its parent.
pub struct Pose {
    /// Metres.
    pub at: DVec3,
    /// Unit quaternion.
    pub turn: DQuat,
    /// Per axis.
    pub scale: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self { at: DVec3::ZERO, turn: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

/// A number of the JSON part: six decimals are enough for a scene made by hand.
fn tidy(value: f64) -> Value {
    let rounded = (value * 1e6).round() / 1e6;
    json!(if rounded == 0.0 { 0.0 } else { rounded })
}

/// Three numbers of the JSON part.
pub fn triple(v: DVec3) -> Value {
    json!([tidy(v.x), tidy(v.y), tidy(v.z)])
}

impl Document {
    /// Appends to one of the top-level arrays and returns the index.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        let items =
            self.lists.entry(list).or_insert_with(|| json!([])).as_array_mut().expect("only arrays are entered");
        items.push(item);
        items.len() - 1
    }

    /// A texture with a picture of its own; the first bytes tell PNG from JPEG.
    pub fn picture(&mut self, name: &str, bytes: Vec<u8>) -> usize {
        if self.pictures.is_empty() {
            self.push("samplers", json!({ "magFilter": 9729, "minFilter": 9987 }));
        }
        let mime = if bytes.starts_with(b"\x89PNG") { "image/png" } else { "image/jpeg" };
        self.pictures.push(Picture { name: name.to_owned(), mime, bytes });
        self.push("textures", json!({ "name": name, "sampler": 0, "source": self.pictures.len() - 1 }))
    }

    /// The three textures of a coat.
    pub fn coat(&mut self, name: &str, coat: &Coat) -> CoatTextures {
        CoatTextures {
            color: self.picture(&format!("{name} color"), coat.color.jpeg(84)),
            normal: self.picture(&format!("{name} normal"), coat.normal.jpeg(82)),
            rough: self.picture(&format!("{name} roughness"), coat.rough.jpeg(78)),
        }
    }

    /// A material that shows all three textures of a coat.
    pub fn coated(&mut self, name: &str, textures: CoatTextures) -> usize {
        self.push(
            "materials",
            json!({
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorTexture": { "index": textures.color },
                    "metallicRoughnessTexture": { "index": textures.rough },
                },
                "normalTexture": { "index": textures.normal },
            }),
        )
    }

    /// A material of one sRGB colour, multiplied by vertex colours where there are any.
    pub fn plain(&mut self, name: &str, color: DVec3, metal: f64, rough: f64) -> usize {
        let c = crate::surface::linear(color.to_array());
        self.push(
            "materials",
            json!({
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [tidy(c.x), tidy(c.y), tidy(c.z), 1.0],
                    "metallicFactor": metal,
                    "roughnessFactor": rough,
                },
            }),
        )
    }

    /// A material of one picture, not a metal.
    pub fn textured(&mut self, name: &str, texture: usize, rough: f64) -> usize {
        self.push(
            "materials",
            json!({
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorTexture": { "index": texture }, "metallicFactor": 0.0, "roughnessFactor": rough,
                },
            }),
        )
    }

    /// The material, to add to what the constructors above set.
    pub fn material(&mut self, index: usize) -> &mut Value {
        &mut self.lists["materials"][index]
    }

    /// Names an extension as used and puts its part into the document, if it has one.
    pub fn extension(&mut self, name: &str, part: Value) {
        self.extensions.insert(name.to_owned(), part);
    }

    /// A primitive. Surfaces are written as floats, colours as normalised bytes, indices as small as they fit.
    pub fn part(&mut self, surface: &Surface, material: usize) -> Value {
        self.deforming_part(surface, material, &Deform::default())
    }

    /// A primitive with joints, weights and morph targets.
    pub fn deforming_part(&mut self, surface: &Surface, material: usize, deform: &Deform) -> Value {
        assert_eq!(surface.normals.len(), surface.positions.len(), "shade first");
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), json!(self.vectors(&surface.positions, true)));
        attributes.insert("NORMAL".into(), json!(self.vectors(&surface.normals, false)));
        if !surface.tangents.is_empty() {
            let values: Vec<f32> = surface.tangents.iter().flat_map(|t| t.as_vec4().to_array()).collect();
            attributes.insert("TANGENT".into(), json!(self.floats("VEC4", &values)));
        }
        if !surface.uvs.is_empty() {
            let values: Vec<f32> = surface.uvs.iter().flat_map(|t| t.as_vec2().to_array()).collect();
            attributes.insert("TEXCOORD_0".into(), json!(self.floats("VEC2", &values)));
        }
        if !surface.colors.is_empty() {
            let byte = |c: f64| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
            let bytes: Vec<u8> = surface.colors.iter().flat_map(|c| [byte(c.x), byte(c.y), byte(c.z), 255]).collect();
            attributes.insert("COLOR_0".into(), json!(self.bytes("VEC4", &bytes, true)));
        }
        if !deform.joints.is_empty() {
            attributes.insert("JOINTS_0".into(), json!(self.bytes("VEC4", deform.joints.as_flattened(), false)));
            attributes.insert("WEIGHTS_0".into(), json!(self.bytes("VEC4", deform.weights.as_flattened(), true)));
        }
        let mut part = json!({ "attributes": attributes, "indices": self.indices(surface), "material": material });
        if !deform.targets.is_empty() {
            part["targets"] = deform.targets.iter().map(|target| self.target(target)).collect();
        }
        part
    }

    fn target(&mut self, target: &[[DVec3; 2]]) -> Value {
        let (positions, normals): (Vec<DVec3>, Vec<DVec3>) = target.iter().map(|[p, n]| (*p, *n)).unzip();
        json!({ "POSITION": self.sparse(&positions, true), "NORMAL": self.sparse(&normals, false) })
    }

    /// An accessor that is zero but for a few vertices: sparse, without a buffer view of its own.
    fn sparse(&mut self, vectors: &[DVec3], bounds: bool) -> usize {
        let values: Vec<f32> = vectors.iter().flat_map(|v| v.as_vec3().to_array()).collect();
        let mut kept: Vec<usize> = (0..vectors.len()).filter(|i| vectors[*i].length_squared() > 1e-12).collect();
        if kept.is_empty() {
            // A sparse accessor must name one element at least.
            kept.push(0);
        }
        let indices: Vec<u16> = kept.iter().map(|i| *i as u16).collect();
        let changed: Vec<f32> = kept.iter().flat_map(|i| values[i * 3..i * 3 + 3].to_vec()).collect();
        let indices = self.view(bytemuck::cast_slice(&indices), None);
        let changed = self.view(bytemuck::cast_slice(&changed), None);
        let accessor = self.push(
            "accessors",
            json!({
                "componentType": 5126, "count": vectors.len(), "type": "VEC3",
                "sparse": {
                    "count": kept.len(),
                    "indices": { "bufferView": indices, "componentType": 5123 },
                    "values": { "bufferView": changed },
                },
            }),
        );
        if bounds {
            self.bound(accessor, 3, &values);
        }
        accessor
    }

    /// A node; `what` holds `mesh`, `children`, `camera` and the like.
    pub fn node(&mut self, name: &str, pose: &Pose, what: Value) -> usize {
        let mut node = json!({ "name": name });
        let fields = node.as_object_mut().expect("written as an object above");
        if pose.at != DVec3::ZERO {
            fields.insert("translation".into(), triple(pose.at));
        }
        if pose.turn != DQuat::IDENTITY {
            let q = pose.turn.normalize();
            fields.insert("rotation".into(), json!([q.x, q.y, q.z, q.w].map(tidy)));
        }
        if pose.scale != DVec3::ONE {
            fields.insert("scale".into(), triple(pose.scale));
        }
        if let Value::Object(what) = what {
            fields.extend(what);
        }
        self.push("nodes", node)
    }

    fn vectors(&mut self, vectors: &[DVec3], bounds: bool) -> usize {
        let values: Vec<f32> = vectors.iter().flat_map(|v| v.as_vec3().to_array()).collect();
        let accessor = self.floats("VEC3", &values);
        if bounds {
            self.bound(accessor, 3, &values);
        }
        accessor
    }

    /// Adds `min` and `max` to an accessor.
    fn bound(&mut self, accessor: usize, components: usize, values: &[f32]) {
        let edge = |better: fn(f32, f32) -> f32| -> Vec<f64> {
            (0..components)
                .map(|c| values.iter().skip(c).step_by(components).copied().reduce(better).map_or(0.0, f64::from))
                .collect()
        };
        let (low, high) = (edge(f32::min), edge(f32::max));
        self.lists["accessors"][accessor]["min"] = json!(low);
        self.lists["accessors"][accessor]["max"] = json!(high);
    }

    /// An accessor of floats for vertices.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let view = self.view(bytemuck::cast_slice(values), Some(34962));
        self.accessor(view, 5126, kind, values.len())
    }

    /// An accessor of floats for an animation or a skin: not bound to the vertex stage.
    pub fn curve(&mut self, kind: &str, values: &[f32]) -> usize {
        let view = self.view(bytemuck::cast_slice(values), None);
        let accessor = self.accessor(view, 5126, kind, values.len());
        if kind == "SCALAR" {
            self.bound(accessor, 1, values);
        }
        accessor
    }

    fn bytes(&mut self, kind: &str, values: &[u8], normalized: bool) -> usize {
        let view = self.view(values, Some(34962));
        let accessor = self.accessor(view, 5121, kind, values.len());
        if normalized {
            self.lists["accessors"][accessor]["normalized"] = json!(true);
        }
        accessor
    }

    fn indices(&mut self, surface: &Surface) -> usize {
        let flat = surface.triangles.as_flattened();
        if surface.positions.len() < 65535 {
            let short: Vec<u16> = flat.iter().map(|i| *i as u16).collect();
            let view = self.view(bytemuck::cast_slice(&short), Some(34963));
            self.accessor(view, 5123, "SCALAR", short.len())
        } else {
            let view = self.view(bytemuck::cast_slice(flat), Some(34963));
            self.accessor(view, 5125, "SCALAR", flat.len())
        }
    }

    fn accessor(&mut self, view: usize, component: u32, kind: &str, values: usize) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let item = json!({
            "bufferView": view, "componentType": component, "count": values / components, "type": kind,
        });
        self.push("accessors", item)
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    /// The document's JSON, with the top-level members in the order of the specification's table.
    fn json(&mut self, buffer: &Value) -> Value {
        let mut root = json!({ "asset": { "version": "2.0", "generator": "lodbake make_scenes" }, "scene": 0 });
        if !self.extensions.is_empty() {
            root["extensionsUsed"] = self.extensions.keys().cloned().collect();
            let parts: Map<String, Value> = self
                .extensions
                .iter()
                .filter(|(_, part)| !part.is_null())
                .map(|(k, v)| (k.clone(), v.clone()))
                .collect();
            if !parts.is_empty() {
                root["extensions"] = Value::Object(parts);
            }
        }
        for list in [
            "scenes",
            "nodes",
            "cameras",
            "skins",
            "animations",
            "meshes",
            "materials",
            "textures",
            "images",
            "samplers",
            "accessors",
            "bufferViews",
        ] {
            if let Some(items) = self.lists.remove(list) {
                root[list] = items;
            }
        }
        root["buffers"] = json!([buffer]);
        root
    }

    /// One binary file with everything in it.
    pub fn glb(mut self) -> Vec<u8> {
        for picture in std::mem::take(&mut self.pictures) {
            let view = self.view(&picture.bytes, None);
            self.push("images", json!({ "name": picture.name, "mimeType": picture.mime, "bufferView": view }));
        }
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let buffer = json!({ "byteLength": self.bin.len() });
        let mut text = self.json(&buffer).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bin.len();
        let mut file = b"glTF\x02\0\0\0".to_vec();
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bin)] {
            if file.len() == 8 {
                file.extend((length as u32).to_le_bytes());
            }
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    /// `NAME.gltf` with its buffer and pictures beside it; their URIs are percent-encoded.
    pub fn gltf(mut self, name: &str) -> Vec<(String, Vec<u8>)> {
        let uri =
            |file: &str| percent_encoding::utf8_percent_encode(file, percent_encoding::NON_ALPHANUMERIC).to_string();
        let readable = |file: &str| uri(file).replace("%2E", ".").replace("%2D", "-").replace("%5F", "_");
        let mut files = Vec::new();
        for picture in std::mem::take(&mut self.pictures) {
            let file = format!("{}.{}", picture.name, if picture.mime == "image/png" { "png" } else { "jpg" });
            self.push("images", json!({ "name": picture.name, "uri": readable(&file) }));
            files.push((file, picture.bytes));
        }
        let bin = format!("{name}.bin");
        let buffer = json!({ "uri": readable(&bin), "byteLength": self.bin.len() });
        let text = serde_json::to_string_pretty(&self.json(&buffer)).expect("a value is always JSON");
        files.push((bin, self.bin));
        files.push((format!("{name}.gltf"), (text + "\n").into_bytes()));
        files
    }
}
