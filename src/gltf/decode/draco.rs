//! `KHR_draco_mesh_compression`: one compressed mesh to indices and attributes.
//!
//! Files lie about what is inside: counts and bounds of accessors are often those from before compression. So the
//! decoder is trusted for counts, and the accessors only for the storage formats. Knows nothing of accessors itself.

use crate::gltf::error::{DocumentError, Problem};
use crate::mesh::{ComponentType, Format};
use draco_core::{DataType, DecodeLimits, DecoderBuffer, MeshDecoder, PointAttribute};

/// The glTF extension.
pub const EXTENSION: &str = "KHR_draco_mesh_compression";

/// What a stream may grow to in memory, per byte: the densest real meshes stay far below a tenth of it.
const LARGEST_GAIN: u64 = 4096;
/// Streams of a few bytes may stand for constant attributes of any length; up to this size they are believed.
const ALWAYS_ALLOWED: u64 = 16 << 20;

/// A decoded mesh.
pub struct Decoded {
    mesh: draco_core::Mesh,
}

/// Decodes the stream; `place` is that of the primitive.
pub fn decode(stream: &[u8], place: &str) -> Result<Decoded, DocumentError> {
    let bytes = (stream.len() as u64).saturating_mul(LARGEST_GAIN).max(ALWAYS_ALLOWED);
    let limits =
        DecodeLimits::default().with_max_decoded_bytes(bytes).with_max_points(bytes / 4).with_max_faces(bytes / 12);
    let mut buffer = DecoderBuffer::new(stream).with_limits(limits);
    let mut mesh = draco_core::Mesh::new();
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| failure(place, e.to_string()))?;
    Ok(Decoded { mesh })
}

fn failure(place: &str, reason: String) -> DocumentError {
    DocumentError::new(place, Problem::Decode { extension: EXTENSION, reason })
}

impl Decoded {
    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.mesh.num_points()
    }

    /// Triangle list.
    pub fn indices(&self) -> Vec<u32> {
        self.mesh.faces().iter().flatten().map(|point| point.0).collect()
    }

    /// The attribute of that unique id: components per vertex, and the values as they would be read from an accessor
    /// of that format.
    pub fn attribute(&self, id: u64, format: Format, place: &str) -> Result<(usize, Vec<f32>), DocumentError> {
        let found = u32::try_from(id).ok().and_then(|id| self.mesh.attribute_by_unique_id(id));
        let attribute = found.ok_or_else(|| failure(place, format!("the stream has no attribute {id}")))?;
        let components = usize::from(attribute.num_components());
        let mut values = attribute.read_f32s(self.vertices(), components);
        if let Some(largest) = divisor(attribute, format) {
            for value in &mut values {
                *value = (*value / largest).max(-1.0);
            }
        }
        Ok((components, values))
    }
}

/// What stands for one. Integers are normalised as the accessor says; where it wants floats, as the stream says.
fn divisor(attribute: &PointAttribute, format: Format) -> Option<f32> {
    let stored = attribute.data_type();
    let normalized = match format.component {
        ComponentType::F32 => attribute.normalized(),
        _ => format.normalized,
    };
    if !normalized {
        return None;
    }
    match stored {
        DataType::Int8 => Some(127.0),
        DataType::Uint8 => Some(255.0),
        DataType::Int16 => Some(32767.0),
        DataType::Uint16 => Some(65535.0),
        DataType::Int32 => Some(i32::MAX as f32),
        DataType::Uint32 => Some(u32::MAX as f32),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use draco_core::{EncoderBuffer, EncoderOptions, FaceIndex, GeometryAttributeType, MeshEncoder, PointIndex};

    /// ```text
    /// 2---3
    /// | \ |
    /// 0---1
    /// ```
    fn encoded_square() -> Vec<u8> {
        let mut mesh = draco_core::Mesh::new();
        let mut position = PointAttribute::new();
        position.init(GeometryAttributeType::Position, 3, DataType::Float32, false, 4);
        for (i, corner) in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]].iter().enumerate() {
            position.buffer_mut().write(i * 12, bytemuck::cast_slice(corner));
        }
        let mut colour = PointAttribute::new();
        colour.init(GeometryAttributeType::Color, 4, DataType::Uint8, true, 4);
        for i in 0..4u8 {
            colour.buffer_mut().write(usize::from(i) * 4, &[i * 85, 0, 0, 255]);
        }
        mesh.add_attribute(position);
        mesh.add_attribute(colour);
        mesh.set_num_faces(2);
        mesh.set_face(FaceIndex(0), [PointIndex(0), PointIndex(1), PointIndex(2)]);
        mesh.set_face(FaceIndex(1), [PointIndex(1), PointIndex(3), PointIndex(2)]);
        mesh.set_num_points(4);
        let mut encoder = MeshEncoder::new();
        encoder.set_mesh(mesh);
        let mut out = EncoderBuffer::new();
        encoder.encode(&EncoderOptions::new(), &mut out).unwrap();
        out.data().to_vec()
    }

    #[test]
    fn a_square_comes_back() {
        let decoded = decode(&encoded_square(), "here").unwrap();
        assert_eq!((decoded.vertices(), decoded.indices().len()), (4, 6));
        let (components, positions) = decoded.attribute(0, Format::F32, "here").unwrap();
        assert_eq!((components, positions.len()), (3, 12));
        let bytes = Format { component: ComponentType::U8, normalized: true };
        let (_, colours) = decoded.attribute(1, bytes, "here").unwrap();
        for (position, colour) in positions.chunks(3).zip(colours.chunks(4)) {
            let corner = position[0].round() + 2.0 * position[1].round();
            assert!((colour[0] - corner / 3.0).abs() < 1e-6 && colour[3] == 1.0);
        }
        let raw = Format { component: ComponentType::U8, normalized: false };
        assert!(decoded.attribute(1, raw, "here").unwrap().1.contains(&170.0));
        let words = decoded.attribute(7, Format::F32, "here").unwrap_err().to_string();
        assert_eq!(words, "here: cannot decode KHR_draco_mesh_compression: the stream has no attribute 7");
    }

    #[test]
    fn damaged_streams_are_errors() {
        let whole = encoded_square();
        for end in 0..whole.len() {
            if let Ok(decoded) = decode(&whole[..end], "here") {
                assert!(decoded.vertices() <= 4, "cut at {end}");
            }
        }
        assert!(decode(b"", "here").is_err());
        assert!(decode(b"DRACO\x02\x02\x01\x01\x00\x00\xff\xff\xff\xff\x7f", "here").is_err());
    }
}
