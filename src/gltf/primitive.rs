//! One entry of a mesh's `primitives` to numbers. Knows nothing of nodes and scenes.

use super::accessor::Accessor;
use super::decode::draco;
use super::document::Document;
use super::error::{DocumentError, Problem};
use super::json;
use super::scene::{SourcePrimitive, Warning};
use super::triangles::{Topology, triangle_list};
use super::views::Views;
use crate::mesh::{Attribute, Primitive};
use serde_json::{Map, Value};

/// Extensions that give a primitive's vertices or indices another meaning: it has to stay as it is.
const OTHER_MEANINGS: [(&str, &str); 2] =
    [("EXT_mesh_polygon", "polygons"), ("KHR_gaussian_splatting", "gaussian splats")];

/// A primitive that was read.
#[derive(Debug)]
pub struct ReadPrimitive {
    /// Its triangles, or why there are none.
    pub primitive: SourcePrimitive,
    /// See [`super::scene::SourceMesh::vertex_maps`].
    pub vertex_map: Option<Vec<u32>>,
    /// What was odd.
    pub warnings: Vec<Warning>,
}

/// Reads the primitive `value`, which stands at `place`.
pub fn read(
    document: &Document,
    views: &Views<'_>,
    value: &Value,
    place: String,
) -> Result<ReadPrimitive, DocumentError> {
    let mut reader = Reader { document, views, value, place, warnings: Vec::new() };
    let (primitive, vertex_map) = match reader.read()? {
        Outcome::PassThrough(reason) => (SourcePrimitive::PassThrough { reason }, None),
        Outcome::Triangles(mut primitive) => {
            let map = drop_unused(&mut primitive);
            (SourcePrimitive::Triangles(primitive), map)
        }
    };
    Ok(ReadPrimitive { primitive, vertex_map, warnings: reader.warnings })
}

enum Outcome {
    Triangles(Primitive),
    PassThrough(String),
}

struct Reader<'a> {
    document: &'a Document,
    views: &'a Views<'a>,
    value: &'a Value,
    place: String,
    warnings: Vec<Warning>,
}

impl<'a> Reader<'a> {
    fn read(&mut self) -> Result<Outcome, DocumentError> {
        let pass = |reason: &str| Ok(Outcome::PassThrough(reason.to_owned()));
        json::object(self.value, &self.place)?;
        let topology = match json::uint(self.value, "mode", &self.place)?.unwrap_or(4) {
            0 => return pass("points"),
            1 => return pass("lines"),
            2 => return pass("a line loop"),
            3 => return pass("a line strip"),
            4 => Topology::List,
            5 => Topology::Strip,
            6 => Topology::Fan,
            other => return Err(DocumentError::invalid(&self.place, format!("unknown mode {other}"))),
        };
        for (extension, reason) in OTHER_MEANINGS {
            if json::extension(self.value, extension).is_some() {
                return pass(reason);
            }
        }
        let attributes = json::child(self.value, "attributes", &self.place)?
            .ok_or_else(|| DocumentError::new(&self.place, Problem::Missing("attributes")))?;
        let Some(position) = json::index(attributes, "POSITION", self.attributes_place())? else {
            return pass("no POSITION");
        };
        let primitive = if let Some(compressed) = json::extension(self.value, draco::EXTENSION) {
            self.read_draco(compressed, attributes)?
        } else {
            let accessor = self.accessor(position, "attributes.POSITION")?;
            if accessor.count == 0 {
                return pass("no vertices");
            }
            if !accessor.has_data() {
                return pass("POSITION without data");
            }
            match self.read_plain(attributes, &accessor, topology) {
                // Such a buffer is not wrong: the data may come by some other way. But there is nothing to simplify.
                Err(DocumentError { place, problem: Problem::NoData { buffer } }) => {
                    let text = format!("buffer {buffer} has no data, so there is nothing to make levels of");
                    self.warnings.push(Warning { place, text });
                    return pass("no data");
                }
                result => result?,
            }
        };
        if primitive.indices.is_empty() { pass("no triangles") } else { Ok(Outcome::Triangles(primitive)) }
    }

    fn attributes_place(&self) -> String {
        format!("{}.attributes", self.place)
    }

    fn warn(&mut self, part: &str, text: String) {
        let place = if part.is_empty() { self.place.clone() } else { format!("{}.{part}", self.place) };
        self.warnings.push(Warning { place, text });
    }

    fn accessor(&self, index: usize, part: &str) -> Result<Accessor<'a>, DocumentError> {
        Accessor::parse(self.document, index, &format!("{}.{part}", self.place))
    }

    fn read_plain(
        &mut self,
        attributes: &Value,
        position: &Accessor<'_>,
        topology: Topology,
    ) -> Result<Primitive, DocumentError> {
        // POSITION alone has to justify the number of vertices; the rest must agree with it.
        position.verify(self.views)?;
        let count = position.count as usize;
        let attributes = self.read_attributes(attributes, "attributes", count, None)?;
        let targets = self.read_targets(&attributes, count)?;
        let indices = match json::index(self.value, "indices", &self.place)? {
            Some(index) => {
                let accessor = self.accessor(index, "indices")?;
                let indices = accessor.indices(self.views)?;
                let restart = 1u64 << (8 * accessor.layout.component.size());
                self.check_indices(&indices, count, (restart - 1) as u32)?;
                indices
            }
            None => (0..u32::try_from(count).unwrap_or(u32::MAX)).collect(),
        };
        let list = triangle_list(indices, topology);
        if list.degenerate > 0 {
            self.warn("", format!("{} triangles use a vertex twice and are left out of the levels", list.degenerate));
        }
        if list.leftover > 0 {
            self.warn("", format!("the last {} indices make no triangle", list.leftover));
        }
        Ok(Primitive { count, attributes, targets, indices: list.indices })
    }

    /// The largest number of the index type means "start again" to graphics processors; the format forbids it.
    fn check_indices(&mut self, indices: &[u32], vertices: usize, restart: u32) -> Result<(), DocumentError> {
        let place = format!("{}.indices", self.place);
        let largest = indices.iter().copied().max().unwrap_or(0);
        if largest as usize >= vertices && !indices.is_empty() {
            let index = indices.iter().copied().find(|&i| i as usize >= vertices).unwrap_or(largest);
            if index == restart {
                let words = format!("index {index} restarts the primitive, which glTF does not allow");
                return Err(DocumentError::invalid(place, words));
            }
            return Err(DocumentError::new(place, Problem::Index { index, vertices }));
        }
        if largest == restart {
            self.warn("indices", format!("index {restart} is the restart value of its type; some viewers skip it"));
        }
        Ok(())
    }

    fn read_draco(&mut self, compressed: &'a Value, attributes: &Value) -> Result<Primitive, DocumentError> {
        let place = format!("{}.extensions.{}", self.place, draco::EXTENSION);
        let view = json::index(compressed, "bufferView", &place)?
            .ok_or_else(|| DocumentError::new(&place, Problem::Missing("bufferView")))?;
        let ids = json::child(compressed, "attributes", &place)?
            .ok_or_else(|| DocumentError::new(&place, Problem::Missing("attributes")))?;
        let decoded = draco::decode(self.views.get(view, &place)?.bytes, &place)?;
        let count = decoded.vertices();
        let attributes = self.read_attributes(attributes, "attributes", count, Some((&decoded, ids)))?;
        let targets = self.read_targets(&attributes, count)?;
        let indices = decoded.indices();
        if let Some(&index) = indices.iter().find(|&&i| i as usize >= count) {
            return Err(DocumentError::new(place, Problem::Index { index, vertices: count }));
        }
        // The stream holds a list even where `mode` says strip.
        let list = triangle_list(indices, Topology::List);
        if list.degenerate > 0 {
            self.warn("", format!("{} triangles use a vertex twice and are left out of the levels", list.degenerate));
        }
        Ok(Primitive { count, attributes, targets, indices: list.indices })
    }

    /// Attributes sorted by name, from the compressed mesh where that has them.
    fn read_attributes(
        &mut self,
        object: &Value,
        part: &str,
        count: usize,
        compressed: Option<(&draco::Decoded, &Value)>,
    ) -> Result<Vec<Attribute>, DocumentError> {
        let place = format!("{}.{part}", self.place);
        let mut names: Vec<&String> = json::object(object, &place)?.keys().collect();
        names.sort_unstable();
        let mut attributes = Vec::with_capacity(names.len());
        for name in names {
            let index = json::index(object, name, &place)?.expect("the key was just listed");
            let accessor = self.accessor(index, &format!("{part}.{name}"))?;
            let place = format!("{place}.{name}");
            let id = match compressed {
                Some((decoded, ids)) => json::uint(ids, name, &place)?.map(|id| (decoded, id)),
                None => None,
            };
            let format = accessor.format();
            let (components, values) = if let Some((decoded, id)) = id {
                decoded.attribute(id, format, &place)?
            } else {
                if accessor.count != count as u64 {
                    let words = format!("accessor {index} has {} elements for {count} vertices", accessor.count);
                    return Err(DocumentError::invalid(place, words));
                }
                let numbers = accessor.numbers(self.views, Some(count))?;
                (numbers.components, numbers.values)
            };
            if name == "POSITION" && components != 3 {
                return Err(DocumentError::invalid(
                    place,
                    format!("a position has three components, not {components}"),
                ));
            }
            let mut attribute = Attribute { name: name.clone(), components, format, values };
            self.check_finite(&mut attribute, &place)?;
            attributes.push(attribute);
        }
        Ok(attributes)
    }

    /// Positions must be numbers. Elsewhere NaN and infinity occur in real files (tangents of slivers), so levels get
    /// zero in their place.
    fn check_finite(&mut self, attribute: &mut Attribute, place: &str) -> Result<(), DocumentError> {
        // Infinity and NaN have all exponent bits set; without early exit this runs at the speed of memory.
        let bad = attribute.values.iter().filter(|v| !v.is_finite()).count();
        if bad == 0 {
            return Ok(());
        }
        let first = attribute.values.iter().position(|v| !v.is_finite()).unwrap_or(0);
        if attribute.name == "POSITION" {
            let value = attribute.values[first].to_string();
            let element = first / attribute.components.max(1);
            return Err(DocumentError::new(place, Problem::NotFinite { element, value }));
        }
        attribute.values.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        let place = place.to_owned();
        self.warnings.push(Warning { place, text: format!("{bad} values are not finite and count as zero in levels") });
        Ok(())
    }

    /// Morph targets. One that displaces what the primitive does not have is left out, as viewers do.
    fn read_targets(&mut self, base: &[Attribute], count: usize) -> Result<Vec<Vec<Attribute>>, DocumentError> {
        let mut targets = Vec::new();
        for (i, target) in json::array(self.value, "targets", &self.place)?.iter().enumerate() {
            let part = format!("targets[{i}]");
            let entries = json::object(target, format_args!("{}.{part}", self.place))?;
            let (known, unknown): (Map<_, _>, Map<_, _>) =
                entries.clone().into_iter().partition(|(name, _)| base.iter().any(|a| a.name == *name));
            for (name, _) in unknown {
                self.warn(&part, format!("`{name}` displaces an attribute that the primitive does not have"));
            }
            targets.push(self.read_attributes(&Value::Object(known), &part, count, None)?);
        }
        Ok(targets)
    }
}

/// Some files put all vertices into one accessor and share it among many primitives: keeping all of them in each
/// would make memory grow with the product. If triangles use fewer than half of the vertices, only the used ones
/// stay, in their order; the answer tells which vertex of the source each of them was.
fn drop_unused(primitive: &mut Primitive) -> Option<Vec<u32>> {
    let mut used = vec![false; primitive.count];
    primitive.indices.iter().for_each(|&i| used[i as usize] = true);
    let kept: Vec<u32> = (0..).zip(&used).filter_map(|(i, &used)| used.then_some(i)).collect();
    if kept.len() * 2 >= primitive.count {
        return None;
    }
    let mut place = vec![0u32; primitive.count];
    for (new, &old) in (0..).zip(&kept) {
        place[old as usize] = new;
    }
    primitive.indices.iter_mut().for_each(|i| *i = place[*i as usize]);
    for attribute in primitive.attributes.iter_mut().chain(primitive.targets.iter_mut().flatten()) {
        let width = attribute.components;
        let rows = kept.iter().flat_map(|&old| &attribute.values[old as usize * width..][..width]);
        attribute.values = rows.copied().collect();
    }
    primitive.count = kept.len();
    Some(kept)
}
