//! OBJ in: a Wavefront file becomes a glTF document of its own, so that later stages see only one kind of scene.
//!
//! Each object or group (`o`, `g`) becomes a node with a mesh, its faces of one material a primitive. Of an MTL file
//! colour, opacity, shininess, emission and the textures of colour and bumps are carried over. Points, lines and free-form surfaces
//! are left out.

mod text;

use crate::gltf::buffers::Buffers;
use crate::gltf::dependencies::{Dependency, DependencyKind};
use crate::gltf::document::{Container, Document, DocumentError};
use crate::gltf::error::{ReadCause, ReadError};
use crate::gltf::read;
use crate::gltf::scene::{Scene, Warning};
use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What cannot stand in a relative address as it is.
const RESERVED: &AsciiSet = &CONTROLS.add(b' ').add(b'%').add(b'?').add(b'#').add(b'"').add(b'<').add(b'>').add(b':');

/// Is it an OBJ file, by its extension?
pub fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"))
}

/// Reads a scene of any kind: OBJ by its extension, else glTF.
pub fn read_any(path: &Path) -> Result<Scene, ReadError> {
    if is_obj(path) { read(path) } else { read::read(path) }
}

/// Reads an OBJ file and the MTL files it names.
pub fn read(path: &Path) -> Result<Scene, ReadError> {
    let bytes = std::fs::read(path).map_err(|e| ReadError::io(path, &e))?;
    let base = path.parent().unwrap_or(Path::new(""));
    let loaded =
        load(&bytes, base).map_err(|words| ReadError { path: path.to_owned(), cause: ReadCause::Obj(words) })?;
    let fault = |fault| ReadError::document(path, fault);
    let mut writer = Writer::new(loaded.materials, loaded.warnings);
    writer.add_models(loaded.models).map_err(fault)?;
    let (document, warnings) = writer.finish().map_err(fault)?;
    let buffers = Buffers::load(&document, base).map_err(fault)?;
    let mut scene = read::from_document(document, buffers, base).map_err(fault)?;
    scene.warnings.splice(0..0, warnings);
    scene.dependencies.extend(loaded.libraries);
    scene.dependencies.sort_unstable();
    Ok(scene)
}

/// What the parser found.
struct Loaded {
    models: Vec<tobj::Model>,
    materials: Vec<tobj::Material>,
    libraries: Vec<Dependency>,
    warnings: Vec<Warning>,
}

/// Names and remarks in other encodings than UTF-8 are common; they lose a letter and nothing else.
fn load(bytes: &[u8], base: &Path) -> Result<Loaded, String> {
    let obj = String::from_utf8_lossy(bytes);
    text::check_references(&obj).map_err(|e| e.to_string())?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let libraries: RefCell<BTreeMap<String, PathBuf>> = RefCell::default();
    let open_library = |name: &Path| {
        let written = name.to_string_lossy().into_owned();
        let path = base.join(written.replace('\\', "/"));
        let bytes = std::fs::read(&path).map_err(|_| tobj::LoadError::OpenFileFailed)?;
        libraries.borrow_mut().insert(written, path);
        let mtl = String::from_utf8_lossy(&bytes);
        match text::short_colour(&mtl) {
            None => tobj::load_mtl_buf(&mut mtl.as_bytes()),
            Some(_) => Err(tobj::LoadError::MaterialParseError),
        }
    };
    let (models, materials) =
        tobj::load_obj_buf(&mut obj.as_bytes(), &options, open_library).map_err(|e| e.to_string())?;
    let mut warnings = Vec::new();
    let materials = materials.unwrap_or_else(|error| {
        warnings.push(Warning { place: "mtllib".to_owned(), text: format!("materials are left out: {error}") });
        Vec::new()
    });
    let kind = DependencyKind::Source;
    let libraries = libraries.into_inner().into_iter().map(|(uri, path)| Dependency { uri, path, kind }).collect();
    Ok(Loaded { models, materials, libraries, warnings })
}

/// Triangles of one object and material.
#[derive(Default)]
struct Part {
    material: Option<usize>,
    positions: Vec<f32>,
    normals: Vec<f32>,
    texture_coordinates: Vec<f32>,
    colours: Vec<f32>,
    indices: Vec<u32>,
}

impl Part {
    /// The parser repeats vertices for each change of material, so parts can simply be put one after another.
    fn append(&mut self, mesh: tobj::Mesh) {
        let first = (self.positions.len() / 3) as u32;
        self.positions.extend(mesh.positions);
        self.normals.extend(mesh.normals);
        self.texture_coordinates.extend(mesh.texcoords);
        self.colours.extend(mesh.vertex_color);
        self.indices.extend(mesh.indices.iter().map(|i| i + first));
    }
}

/// Builds the document.
struct Writer {
    document: Document,
    bin: Vec<u8>,
    materials: Vec<tobj::Material>,
    /// glTF index of each material that is used.
    written: BTreeMap<usize, usize>,
    /// glTF texture of each image address.
    textures: BTreeMap<String, usize>,
    warnings: Vec<Warning>,
}

impl Writer {
    fn new(materials: Vec<tobj::Material>, warnings: Vec<Warning>) -> Self {
        let document = Document::new(Container::Glb, concat!("lodbake ", env!("CARGO_PKG_VERSION")));
        Self { document, bin: Vec::new(), materials, written: BTreeMap::new(), textures: BTreeMap::new(), warnings }
    }

    /// The parser starts a new model at every change of material; those of one name in a row are one object.
    fn add_models(&mut self, models: Vec<tobj::Model>) -> Result<(), DocumentError> {
        let mut models = models.into_iter().filter(|m| !m.mesh.indices.is_empty()).peekable();
        let mut roots = Vec::new();
        while let Some(model) = models.next() {
            let name = model.name;
            let mut parts: Vec<Part> = Vec::new();
            let mut add = |mesh: tobj::Mesh| {
                let known = parts.iter().position(|part| part.material == mesh.material_id);
                let at = known.unwrap_or_else(|| {
                    parts.push(Part { material: mesh.material_id, ..Part::default() });
                    parts.len() - 1
                });
                parts[at].append(mesh);
            };
            add(model.mesh);
            while let Some(next) = models.next_if(|next| next.name == name) {
                add(next.mesh);
            }
            let primitives = parts.into_iter().map(|part| self.add_part(part, &name));
            let primitives: Vec<Value> = primitives.collect::<Result<_, _>>()?;
            let mesh = self.document.push("meshes", json!({ "name": name, "primitives": primitives }))?;
            roots.push(self.document.push("nodes", json!({ "name": name, "mesh": mesh }))?);
        }
        let scene = if roots.is_empty() { json!({}) } else { json!({ "nodes": roots }) };
        self.document.json["scene"] = json!(self.document.push("scenes", scene)?);
        Ok(())
    }

    fn add_part(&mut self, part: Part, name: &str) -> Result<Value, DocumentError> {
        let count = part.positions.len() / 3;
        let mut texture_coordinates = part.texture_coordinates;
        // OBJ counts from the lower edge of the picture, glTF from the upper one.
        for pair in texture_coordinates.as_chunks_mut::<2>().0 {
            pair[1] = 1.0 - pair[1];
        }
        let all = [
            ("POSITION", 3, part.positions),
            ("NORMAL", 3, part.normals),
            ("TEXCOORD_0", 2, texture_coordinates),
            ("COLOR_0", 3, part.colours),
        ];
        let mut attributes = serde_json::Map::new();
        for (semantic, width, values) in all {
            if values.len() == count * width {
                attributes.insert(semantic.to_owned(), json!(self.add_floats(semantic, width, &values)?));
            } else if !values.is_empty() {
                let text = format!("`{semantic}` is left out: only some of the vertices have it");
                self.warnings.push(Warning { place: format!("object `{name}`"), text });
            }
        }
        let indices = self.add_indices(&part.indices, count)?;
        let mut primitive = json!({ "attributes": attributes, "indices": indices });
        if let Some(material) = part.material {
            primitive["material"] = json!(self.add_material(material)?);
        }
        Ok(primitive)
    }

    fn add_view(&mut self, bytes: &[u8], target: u32) -> Result<usize, DocumentError> {
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target });
        self.document.push("bufferViews", view)
    }

    fn add_floats(&mut self, semantic: &str, width: usize, values: &[f32]) -> Result<usize, DocumentError> {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.add_view(&bytes, 34962)?;
        let kind = if width == 2 { "VEC2" } else { "VEC3" };
        let count = values.len() / width;
        let mut accessor = json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind });
        if semantic == "POSITION" {
            let bound = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..3).map(|k| values.iter().skip(k).step_by(3).fold(start, |a, &b| pick(a, b))).collect()
            };
            accessor["min"] = json!(bound(f32::INFINITY, f32::min));
            accessor["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        }
        self.document.push("accessors", accessor)
    }

    fn add_indices(&mut self, indices: &[u32], vertices: usize) -> Result<usize, DocumentError> {
        // 65535 is not allowed as an index.
        let narrow = vertices <= 65535;
        let bytes: Vec<u8> = if narrow {
            indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            indices.iter().flat_map(|i| i.to_le_bytes()).collect()
        };
        let view = self.add_view(&bytes, 34963)?;
        let component = if narrow { 5123 } else { 5125 };
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR" });
        self.document.push("accessors", accessor)
    }

    fn add_material(&mut self, index: usize) -> Result<usize, DocumentError> {
        if let Some(&known) = self.written.get(&index) {
            return Ok(known);
        }
        let source = self.materials[index].clone();
        let colour_texture = self.add_texture(source.diffuse_texture.as_deref())?;
        let mut colour = source.diffuse.unwrap_or([1.0; 3]);
        if colour_texture.is_some() && colour == [0.0; 3] {
            // Some exporters write black beside a texture; multiplied, nothing would be left of it.
            colour = [1.0; 3];
        }
        let opacity = source.dissolve.unwrap_or(1.0).clamp(0.0, 1.0);
        let [red, green, blue] = colour.map(|c| c.clamp(0.0, 1.0));
        // The usual match of a Blinn-Phong exponent and a roughness.
        let roughness = source.shininess.map_or(1.0, |exponent| (2.0 / (exponent.max(0.0) + 2.0)).sqrt());
        let mut surface = json!({
            "baseColorFactor": [red, green, blue, opacity],
            "metallicFactor": 0,
            "roughnessFactor": roughness,
        });
        if let Some(texture) = colour_texture {
            surface["baseColorTexture"] = json!({ "index": texture });
        }
        let mut material = json!({ "name": source.name, "pbrMetallicRoughness": surface });
        if opacity < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        if let Some(emissive) = source.emissive.filter(|e| *e != [0.0; 3]) {
            material["emissiveFactor"] = json!(emissive.map(|c| c.clamp(0.0, 1.0)));
        }
        if let Some(texture) = self.add_texture(source.normal_texture.as_deref())? {
            material["normalTexture"] = json!({ "index": texture });
        }
        let written = self.document.push("materials", material)?;
        self.written.insert(index, written);
        Ok(written)
    }

    /// A texture statement may begin with options; the file is its last word then.
    fn add_texture(&mut self, statement: Option<&str>) -> Result<Option<usize>, DocumentError> {
        let statement = statement.unwrap_or_default().trim();
        let name =
            if statement.starts_with('-') { statement.rsplit(' ').next().unwrap_or_default() } else { statement };
        if name.is_empty() {
            return Ok(None);
        }
        let name = name.replace('\\', "/");
        if name.starts_with('/') || name.get(1..2) == Some(":") {
            let text = format!("texture `{name}` is left out: its path is not relative");
            self.warnings.push(Warning { place: "mtllib".to_owned(), text });
            return Ok(None);
        }
        let uri = utf8_percent_encode(&name, RESERVED).to_string();
        if let Some(&known) = self.textures.get(&uri) {
            return Ok(Some(known));
        }
        let image = self.document.push("images", json!({ "uri": uri }))?;
        let texture = self.document.push("textures", json!({ "source": image }))?;
        self.textures.insert(uri, texture);
        Ok(Some(texture))
    }

    fn finish(mut self) -> Result<(Document, Vec<Warning>), DocumentError> {
        if !self.bin.is_empty() {
            self.document.push("buffers", json!({ "byteLength": self.bin.len() }))?;
            self.document.bin = Some(Arc::from(self.bin));
        }
        Ok((self.document, self.warnings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::scene::SourcePrimitive;

    const SQUARES: &str = "\
mtllib paint.mtl absent.mtl
o floor
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 0.25
vn 0 0 1
usemtl red
f 1/1/1 2/2/1 3/3/1
usemtl wood
f 1/1/1 3/3/1 4/4/1
usemtl red
f 2/2/1 3/3/1 4/4/1
o wall
f 1 2 3 4
";
    const PAINT: &str = "\
newmtl red
Kd 1 0 0
d 0.5
Ns 6
newmtl wood
Kd 0 0 0
map_Kd -s 2 2 2 textures\\wood.png
newmtl unused
Kd 1 1 1
";

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    #[test]
    fn objects_materials_and_attributes() {
        let obj = SQUARES.replace(" absent.mtl", "");
        let folder = folder(&[("a.obj", &obj), ("paint.mtl", PAINT)]);
        let scene = read(&folder.path().join("a.obj")).unwrap();
        let names: Vec<_> = scene.meshes.iter().map(|m| m.name.as_deref().unwrap()).collect();
        assert_eq!(names, ["floor", "wall"]);
        assert_eq!(scene.meshes.iter().map(|m| m.primitives.len()).collect::<Vec<_>>(), [2, 1]);
        assert_eq!(scene.meshes.iter().map(crate::gltf::scene::SourceMesh::triangles).collect::<Vec<_>>(), [3, 2]);
        let SourcePrimitive::Triangles(wood) = &scene.meshes[0].primitives[1] else { panic!("no triangles") };
        let attributes: Vec<_> = wood.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(attributes, ["NORMAL", "POSITION", "TEXCOORD_0"]);
        assert_eq!(wood.attribute("TEXCOORD_0").unwrap().values, [0.0, 1.0, 1.0, 0.0, 0.0, 0.75]);
        let materials = &scene.document.json["materials"];
        assert_eq!(materials.as_array().unwrap().len(), 2);
        assert_eq!(materials[0]["pbrMetallicRoughness"]["baseColorFactor"], json!([1.0, 0.0, 0.0, 0.5]));
        assert_eq!(materials[0]["pbrMetallicRoughness"]["roughnessFactor"], json!(0.5));
        assert_eq!(materials[0]["alphaMode"], "BLEND");
        assert_eq!(materials[1]["pbrMetallicRoughness"]["baseColorTexture"]["index"], 0);
        assert_eq!(materials[1]["pbrMetallicRoughness"]["baseColorFactor"][0], 1.0);
        assert_eq!(scene.document.json["images"][0]["uri"], "textures/wood.png");
        let kinds: Vec<_> = scene.dependencies.iter().map(|d| (d.uri.as_str(), d.kind)).collect();
        assert_eq!(kinds, [("paint.mtl", DependencyKind::Source), ("textures/wood.png", DependencyKind::Image)]);
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        // What was built is a whole document: it reads back from its bytes.
        let bytes = scene.document.to_glb_bytes().unwrap();
        let again = crate::gltf::read::read_bytes(&bytes, folder.path()).unwrap();
        assert_eq!(again.meshes, scene.meshes);
    }

    #[test]
    fn missing_materials_are_a_warning_and_broken_faces_an_error() {
        let folder = folder(&[("a.obj", SQUARES), ("b.obj", "v 0 0 0\nf 1 2 3\n"), ("c.obj", "# empty\n")]);
        let scene = read(&folder.path().join("a.obj")).unwrap();
        assert_eq!(scene.warnings[0].text, "materials are left out: open file failed");
        assert_eq!(scene.meshes.len(), 2);
        let broken = read(&folder.path().join("b.obj")).unwrap_err();
        assert!(broken.to_string().ends_with("`: line 2: vertex 3 is out of range (there are 1)"), "{broken}");
        assert!(read(&folder.path().join("c.obj")).unwrap().meshes.is_empty());
        assert!(read(&folder.path().join("d.obj")).unwrap_err().to_string().ends_with("`: there is no such file"));
    }

    #[test]
    fn damaged_files_never_panic() {
        let folder = folder(&[("paint.mtl", PAINT)]);
        let base = folder.path();
        let path = base.join("a.obj");
        let words = ["-1", "0", "99999999999999999999", "1e999", "nan", "/", "//", "\\", "-", "f", "v", "o", "\n", "é"];
        let mut state = 1u64;
        let mut below = |limit: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % limit
        };
        let mut read_well = 0;
        for _ in 0..600 {
            let mut text = SQUARES.as_bytes().to_vec();
            for _ in 0..=below(3) {
                let at = below(text.len());
                text.splice(at..at + below(2), words[below(words.len())].bytes());
            }
            std::fs::write(&path, text).unwrap();
            read_well += usize::from(read(&path).is_ok());
        }
        assert!((1..600).contains(&read_well), "{read_well}");
    }
}
