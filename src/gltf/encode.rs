//! Decoded attribute values back into the storage format of their source: quantisation, column padding, strides, and
//! what glTF asks of the values themselves (unit normals, whole weights).
//!
//! Knows nothing of JSON or buffers. Rounding is to nearest, halves away from zero, as the specification's equations
//! for normalised integers have it; what does not fit is clamped.

use crate::mesh::{Attribute, ComponentType, Format};
use std::borrow::Cow;

/// How the elements of one accessor lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    component: ComponentType,
    columns: usize,
    rows: usize,
    /// Matrix columns begin at multiples of four bytes (glTF 2.0, 3.6.2.4).
    column_bytes: usize,
}

impl Layout {
    /// `kind` is the accessor's `type`; an unknown one is told from the number of components.
    pub(super) fn new(kind: &str, components: usize, component: ComponentType) -> Self {
        let (columns, rows) = match (kind, components) {
            ("MAT2", 4) => (2, 2),
            (_, 9) => (3, 3),
            (_, 16) => (4, 4),
            _ => (1, components),
        };
        let packed = rows * component.size();
        let column_bytes = if columns > 1 { packed.next_multiple_of(4) } else { packed };
        Self { component, columns, rows, column_bytes }
    }

    /// The accessor's `type`.
    pub(super) fn kind(&self) -> &'static str {
        match (self.columns, self.rows) {
            (1, 1) => "SCALAR",
            (1, 2) => "VEC2",
            (1, 3) => "VEC3",
            (1, _) => "VEC4",
            (2, _) => "MAT2",
            (3, _) => "MAT3",
            (_, _) => "MAT4",
        }
    }

    /// Bytes from one vertex to the next: elements of vertex attributes begin at multiples of four bytes.
    pub(super) fn stride(&self) -> usize {
        (self.columns * self.column_bytes).next_multiple_of(4)
    }

    fn components(&self) -> usize {
        self.columns * self.rows
    }
}

/// One encoded vertex attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Encoded {
    /// `count × stride` bytes.
    pub(super) bytes: Vec<u8>,
    /// Per component, as stored (integers are not normalised): what `accessor.min` and `max` have to say.
    pub(super) min: Vec<f64>,
    pub(super) max: Vec<f64>,
}

/// Encodes `values` (vertex after vertex). The caller has made sure that they are finite and whole vertices.
pub(super) fn encode(values: &[f32], layout: Layout, format: Format) -> Encoded {
    let components = layout.components();
    let mut encoded = Encoded {
        bytes: Vec::with_capacity(values.len() / components * layout.stride()),
        min: vec![f64::INFINITY; components],
        max: vec![f64::NEG_INFINITY; components],
    };
    for vertex in values.chunks_exact(components) {
        let start = encoded.bytes.len();
        for (i, &value) in vertex.iter().enumerate() {
            if i % layout.rows == 0 {
                encoded.bytes.resize(start + i / layout.rows * layout.column_bytes, 0);
            }
            let stored = push(&mut encoded.bytes, value, format);
            encoded.min[i] = encoded.min[i].min(stored);
            encoded.max[i] = encoded.max[i].max(stored);
        }
        encoded.bytes.resize(start + layout.stride(), 0);
    }
    encoded
}

/// The largest normalised integer: it stands for 1.
pub(super) fn unit(component: ComponentType) -> f64 {
    match component {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32767.0,
        ComponentType::U16 => 65535.0,
        ComponentType::U32 => 4294967295.0,
        ComponentType::F32 => 1.0,
    }
}

fn push(bytes: &mut Vec<u8>, value: f32, format: Format) -> f64 {
    let scale = if format.normalized { unit(format.component) } else { 1.0 };
    let scaled = (f64::from(value) * scale).round();
    // −128 would be decoded like −127 and is never written for normalised values.
    let lowest = |min: f64| if format.normalized { -scale } else { min };
    match format.component {
        ComponentType::I8 => {
            let stored = scaled.clamp(lowest(-128.0), 127.0) as i8;
            bytes.extend(stored.to_le_bytes());
            f64::from(stored)
        }
        ComponentType::U8 => {
            let stored = scaled as u8;
            bytes.push(stored);
            f64::from(stored)
        }
        ComponentType::I16 => {
            let stored = scaled.clamp(lowest(-32768.0), 32767.0) as i16;
            bytes.extend(stored.to_le_bytes());
            f64::from(stored)
        }
        ComponentType::U16 => {
            let stored = scaled as u16;
            bytes.extend(stored.to_le_bytes());
            f64::from(stored)
        }
        ComponentType::U32 => {
            let stored = scaled as u32;
            bytes.extend(stored.to_le_bytes());
            f64::from(stored)
        }
        ComponentType::F32 => {
            bytes.extend(value.to_le_bytes());
            f64::from(value)
        }
    }
}

/// The values as glTF wants them, in the order of `attributes`: normals and tangents of unit length, weights that sum
/// to one. Values that are right already keep their bits.
pub(super) fn settle(attributes: &[Attribute]) -> Vec<Cow<'_, [f32]>> {
    let mut settled: Vec<Cow<'_, [f32]>> = attributes.iter().map(settle_alone).collect();
    let weights: Vec<usize> = (0..attributes.len()).filter(|&i| attributes[i].name.starts_with("WEIGHTS_")).collect();
    settle_weights(attributes, &weights, &mut settled);
    settled
}

fn settle_alone(attribute: &Attribute) -> Cow<'_, [f32]> {
    let vector = matches!((attribute.name.as_str(), attribute.components), ("NORMAL", 3) | ("TANGENT", 4));
    if !vector || attribute.values.chunks_exact(attribute.components).all(|v| is_settled_vector(v, attribute.format)) {
        return Cow::Borrowed(&attribute.values);
    }
    let mut values = attribute.values.clone();
    for vector in values.chunks_exact_mut(attribute.components) {
        if !is_settled_vector(vector, attribute.format) {
            settle_vector(vector);
        }
    }
    Cow::Owned(values)
}

fn length(vector: &[f32]) -> f64 {
    vector[..3].iter().map(|&c| f64::from(c) * f64::from(c)).sum::<f64>().sqrt()
}

/// A grid of step 1/s holds unit vectors only to within √3/(2s); finer corrections would move vertices that came
/// straight from the source.
fn is_settled_vector(vector: &[f32], format: Format) -> bool {
    let tolerance = if format.component == ComponentType::F32 { 1e-5 } else { 1.5 / unit(format.component) };
    let unit_length = (length(vector) - 1.0).abs() <= tolerance;
    unit_length && vector.get(3).is_none_or(|w| w.abs() == 1.0)
}

/// A vector of length zero has no direction to keep and stays; a tangent's fourth component is a sign.
fn settle_vector(vector: &mut [f32]) {
    let length = length(vector);
    if length > 0.0 && length.is_finite() {
        for component in &mut vector[..3] {
            *component = (f64::from(*component) / length) as f32;
        }
    }
    if let Some(sign) = vector.get_mut(3) {
        *sign = if *sign < 0.0 { -1.0 } else { 1.0 };
    }
}

/// All sets `WEIGHTS_0`, `WEIGHTS_1`, … of a vertex together sum to one.
fn settle_weights(attributes: &[Attribute], sets: &[usize], settled: &mut [Cow<'_, [f32]>]) {
    let Some(&first) = sets.first() else { return };
    let format = attributes[first].format;
    let alike = |&i: &usize| attributes[i].format == format && attributes[i].values.len().is_multiple_of(4);
    let count = attributes[first].values.len() / 4;
    if !sets.iter().all(|i| alike(i) && attributes[*i].values.len() == count * 4) {
        return; // sets of several formats: no common grid; each is rounded by itself
    }
    let whole = format.normalized.then(|| unit(format.component));
    for vertex in 0..count {
        let at = vertex * 4..vertex * 4 + 4;
        let mut weights: Vec<f64> = sets.iter().flat_map(|&i| &settled[i][at.clone()]).map(|&w| f64::from(w)).collect();
        let changed = match whole {
            Some(whole) => apportion(&mut weights, whole),
            None => rescale(&mut weights),
        };
        if changed {
            for (set, values) in sets.iter().zip(weights.chunks_exact(4)) {
                for (place, value) in settled[*set].to_mut()[at.clone()].iter_mut().zip(values) {
                    *place = *value as f32;
                }
            }
        }
    }
}

/// Largest remainder: the integers nearest to the weights that sum to `whole`, as fractions of it. Answers whether
/// anything had to change.
fn apportion(weights: &mut [f64], whole: f64) -> bool {
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 || !sum.is_finite() || weights.iter().map(|w| (w * whole).round()).sum::<f64>() == whole {
        return false;
    }
    let exact: Vec<f64> = weights.iter().map(|w| w.max(0.0) / sum * whole).collect();
    let mut missing = whole - exact.iter().map(|e| e.floor()).sum::<f64>();
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()).then(a.cmp(&b)));
    for (weight, exact) in weights.iter_mut().zip(&exact) {
        *weight = exact.floor() / whole;
    }
    for i in order {
        if missing < 1.0 {
            break;
        }
        weights[i] = (exact[i].floor() + 1.0) / whole;
        missing -= 1.0;
    }
    true
}

/// Floats: only what rounding left over is mended. A sum that is far off is the exporter's own, LOD 0 shows it too,
/// and the levels must look like LOD 0.
fn rescale(weights: &mut [f64]) -> bool {
    let sum: f64 = weights.iter().sum();
    let off = (sum - 1.0).abs();
    if off <= 2e-7 || off > 1e-2 {
        return false;
    }
    for weight in weights {
        *weight /= sum;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [ComponentType; 6] = [
        ComponentType::I8,
        ComponentType::U8,
        ComponentType::I16,
        ComponentType::U16,
        ComponentType::U32,
        ComponentType::F32,
    ];

    fn attribute(name: &str, components: usize, format: Format, values: &[f32]) -> Attribute {
        Attribute { name: name.to_owned(), components, format, values: values.to_vec() }
    }

    fn decode(bytes: &[u8], format: Format) -> f64 {
        let raw = match format.component {
            ComponentType::I8 => f64::from(bytes[0] as i8),
            ComponentType::U8 => f64::from(bytes[0]),
            ComponentType::I16 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            ComponentType::U16 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            ComponentType::U32 => f64::from(u32::from_le_bytes(bytes[..4].try_into().unwrap())),
            ComponentType::F32 => f64::from(f32::from_le_bytes(bytes[..4].try_into().unwrap())),
        };
        if format.normalized { (raw / unit(format.component)).max(-1.0) } else { raw }
    }

    #[test]
    fn every_format_comes_back() {
        for component in ALL {
            for normalized in [false, true] {
                let format = Format { component, normalized };
                let top = if normalized { 1.0 } else { unit(component).min(60000.0) };
                let values: Vec<f32> = (-20..=20).map(|i| (f64::from(i) / 20.0 * top) as f32).collect();
                let encoded = encode(&values, Layout::new("SCALAR", 1, component), format);
                let step = if normalized { 1.0 / unit(component) } else { 1.0 };
                for (value, bytes) in values.iter().zip(encoded.bytes.chunks_exact(4)) {
                    let signed = matches!(component, ComponentType::I8 | ComponentType::I16 | ComponentType::F32);
                    let expected = if signed { f64::from(*value) } else { f64::from(*value).max(0.0) };
                    let error = (decode(bytes, format) - expected).abs();
                    assert!(error <= step * 0.5 + 1e-6, "{format:?} {value}: {error}");
                }
            }
        }
    }

    #[test]
    fn stored_integers_survive_decoding_and_encoding() {
        for (component, top) in [(ComponentType::U8, 255u32), (ComponentType::U16, 65535)] {
            let format = Format { component, normalized: true };
            let values: Vec<f32> = (0..=top).map(|i| (f64::from(i) / f64::from(top)) as f32).collect();
            let encoded = encode(&values, Layout::new("SCALAR", 1, component), format);
            for (i, bytes) in (0..=top).zip(encoded.bytes.chunks_exact(4)) {
                assert_eq!((decode(bytes, format) * f64::from(top)).round() as u32, i);
            }
        }
    }

    #[test]
    fn values_outside_are_clamped() {
        let format = Format { component: ComponentType::I8, normalized: true };
        let encoded = encode(&[-3.0, 3.0], Layout::new("SCALAR", 1, ComponentType::I8), format);
        assert_eq!(encoded.bytes, [129, 0, 0, 0, 127, 0, 0, 0]);
        let plain = Format { component: ComponentType::I8, normalized: false };
        let encoded = encode(&[-300.0], Layout::new("SCALAR", 1, ComponentType::I8), plain);
        assert_eq!(encoded.bytes[0] as i8, -128);
        assert_eq!((encoded.min[0], encoded.max[0]), (-128.0, -128.0));
    }

    #[test]
    fn elements_and_matrix_columns_are_padded() {
        let bytes = |kind, components, component| {
            let values: Vec<f32> = (1..=components).map(|i| i as f32).collect();
            encode(&values, Layout::new(kind, components, component), Format { component, normalized: false }).bytes
        };
        assert_eq!(bytes("VEC3", 3, ComponentType::U8), [1, 2, 3, 0]);
        assert_eq!(bytes("VEC4", 4, ComponentType::U8), [1, 2, 3, 4]);
        assert_eq!(bytes("MAT2", 4, ComponentType::U8), [1, 2, 0, 0, 3, 4, 0, 0]);
        assert_eq!(bytes("MAT3", 9, ComponentType::U8), [1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0]);
        assert_eq!(bytes("MAT3", 9, ComponentType::U16).len(), 24);
        assert_eq!(bytes("MAT4", 16, ComponentType::F32).len(), 64);
        assert_eq!(Layout::new("MAT2", 4, ComponentType::F32).kind(), "MAT2");
        assert_eq!(Layout::new("", 4, ComponentType::F32).kind(), "VEC4");
    }

    #[test]
    fn normals_become_unit_vectors_and_right_ones_keep_their_bits() {
        let kept = [0.6_f32, 0.8, 0.0];
        let normals = attribute("NORMAL", 3, Format::F32, &[kept[0], kept[1], kept[2], 0.0, 3.0, 4.0, 0.0, 0.0, 0.0]);
        let sources = [normals];
        let settled = settle(&sources);
        assert_eq!(settled[0][..3].iter().map(|v| v.to_bits()).collect::<Vec<_>>(), kept.map(f32::to_bits));
        assert_eq!(settled[0][3..], [0.0, 0.6, 0.8, 0.0, 0.0, 0.0]);
        let tangents = [attribute("TANGENT", 4, Format::F32, &[0.0, 0.0, 2.0, -0.3])];
        assert_eq!(settle(&tangents)[0][..], [0.0, 0.0, 1.0, -1.0]);
        // A displacement is no direction.
        let other = [attribute("_NORMAL", 3, Format::F32, &[0.0, 3.0, 4.0])];
        assert!(matches!(settle(&other)[0], Cow::Borrowed(_)));
    }

    #[test]
    fn coarse_grids_keep_their_normals() {
        let format = Format { component: ComponentType::I8, normalized: true };
        let stored = [73.0_f32, 73.0, 73.0].map(|v| v / 127.0);
        let sources = [attribute("NORMAL", 3, format, &stored)];
        assert!(matches!(settle(&sources)[0], Cow::Borrowed(_)));
    }

    #[test]
    fn integer_weights_sum_to_one() {
        for (component, whole) in [(ComponentType::U8, 255.0_f32), (ComponentType::U16, 65535.0)] {
            let format = Format { component, normalized: true };
            let thirds = [1.0_f32 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0];
            let two = [attribute("WEIGHTS_0", 4, format, &thirds), attribute("WEIGHTS_1", 4, format, &[0.1; 4])];
            let settled = settle(&two);
            let stored: Vec<f32> = settled.iter().flat_map(|s| s.iter()).map(|w| (w * whole).round()).collect();
            assert_eq!(stored.iter().sum::<f32>(), whole);
            assert_eq!(stored[3], 0.0, "an influence of nothing stays nothing");
        }
    }

    #[test]
    fn whole_weights_keep_their_bits_and_empty_ones_stay_empty() {
        let format = Format { component: ComponentType::U8, normalized: true };
        let values = [128.0 / 255.0, 127.0 / 255.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let sources = [attribute("WEIGHTS_0", 4, format, &values)];
        assert!(matches!(settle(&sources)[0], Cow::Borrowed(_)));
    }

    #[test]
    fn float_weights_lose_only_the_rounding() {
        let near = [attribute("WEIGHTS_0", 4, Format::F32, &[0.5, 0.499, 0.0, 0.0])];
        assert!((settle(&near)[0].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let far = [attribute("WEIGHTS_0", 4, Format::F32, &[0.5, 0.2, 0.0, 0.0])];
        assert_eq!(settle(&far)[0][..], [0.5, 0.2, 0.0, 0.0]);
    }
}
