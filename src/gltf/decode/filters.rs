//! The filters of `EXT_meshopt_compression` (octahedral, quaternion, exponential) and the colour filter that
//! `KHR_meshopt_compression` adds, on little-endian data in place.
//!
//! Written out here in plain f32 arithmetic although the codec's own library has them: that one takes approximate
//! reciprocal square roots from the processor, so its last bits differ between makes of processors, and with them
//! the hash of a mesh.

/// Unit vectors: x and y of an octahedron, z its "one". `data` holds four components of `bytes` (1 or 2) each.
pub fn octahedral(data: &mut [u8], bytes: usize) {
    for_each_quad(data, bytes, |quad| {
        let [mut x, mut y] = [quad[0] as f32, quad[1] as f32];
        let z = quad[2] as f32 - x.abs() - y.abs();
        // The lower half of the octahedron is folded outwards.
        let fold = if z >= 0.0 { 0.0 } else { z };
        x += if x >= 0.0 { fold } else { -fold };
        y += if y >= 0.0 { fold } else { -fold };
        let scale = signed_max(bytes) / (x * x + y * y + z * z).sqrt();
        [round(x * scale), round(y * scale), round(z * scale), quad[3]]
    });
}

/// Unit quaternions: the three smallest components, and in the fourth their scale and which one is missing.
pub fn quaternion(data: &mut [u8]) {
    for_each_quad(data, 2, |quad| {
        let one = (quad[3] | 3) as f32;
        let [x, y, z] = [quad[0] as f32, quad[1] as f32, quad[2] as f32];
        let rest = one * one * 2.0 - x * x - y * y - z * z;
        let w = if rest >= 0.0 { rest.sqrt() } else { 0.0 };
        let scale = 32767.0 / 2f32.sqrt() / one;
        let missing = (quad[3] & 3) as usize;
        let mut out = [0; 4];
        for (i, value) in [w, x, y, z].into_iter().enumerate() {
            out[(missing + i) & 3] = round(value * scale);
        }
        out
    });
}

/// Floats with an 8-bit exponent and a 24-bit mantissa, both signed, to IEEE floats.
pub fn exponential(data: &mut [u8]) {
    for bytes in data.as_chunks_mut::<4>().0 {
        let word = i32::from_le_bytes(*bytes);
        let mantissa = (word << 8) >> 8;
        // 2ᵉ by its bits: exponents stay within −100…100 in valid data, others must merely not panic.
        let power = f32::from_bits(((word >> 24).wrapping_add(127) as u32) << 23);
        *bytes = (power * mantissa as f32).to_le_bytes();
    }
}

/// Colours: luma and two chroma differences, and an alpha whose highest bit tells the scale.
pub fn colour(data: &mut [u8], bytes: usize) {
    let mask = if bytes == 1 { 0xFF } else { 0xFFFF };
    for_each_quad(data, bytes, |quad| {
        let [luma, orange, green] = [quad[0] & mask, quad[1], quad[2]];
        let alpha = quad[3] & mask;
        let one = [1, 2, 4, 8].into_iter().fold(alpha, |bits, shift| bits | (bits >> shift));
        let scale = mask as f32 / one as f32;
        // Alpha has one bit less; its last bit is repeated.
        let alpha = ((alpha << 1) & one) | (alpha & 1);
        let rgba = [luma + orange - green, luma + green, luma - orange - green, alpha];
        rgba.map(|value| (value as f32 * scale + 0.5) as i32)
    });
}

fn signed_max(bytes: usize) -> f32 {
    if bytes == 1 { 127.0 } else { 32767.0 }
}

/// Half away from zero, as the format says.
fn round(value: f32) -> i32 {
    (value + if value >= 0.0 { 0.5 } else { -0.5 }) as i32
}

/// Runs over groups of four signed components of one or two bytes.
fn for_each_quad(data: &mut [u8], bytes: usize, decode: impl Fn([i32; 4]) -> [i32; 4]) {
    if bytes == 1 {
        for quad in data.as_chunks_mut::<4>().0 {
            *quad = decode(quad.map(|byte| i32::from(byte as i8))).map(|value| value as u8);
        }
    } else {
        for quad in data.as_chunks_mut::<8>().0 {
            let (pairs, _) = quad.as_chunks_mut::<2>();
            let values = [pairs[0], pairs[1], pairs[2], pairs[3]].map(|pair| i32::from(i16::from_le_bytes(pair)));
            for (pair, value) in pairs.iter_mut().zip(decode(values)) {
                *pair = (value as i16).to_le_bytes();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit vectors all over the sphere, with a fourth component.
    fn directions() -> Vec<[f32; 4]> {
        let mut all = Vec::new();
        for i in -4..=4i8 {
            for j in -4..=4i8 {
                for k in -4..=4i8 {
                    let v = [f32::from(i), f32::from(j), f32::from(k)];
                    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
                    if length > 0.0 {
                        all.push([v[0] / length, v[1] / length, v[2] / length, f32::from(i & 1)]);
                    }
                }
            }
        }
        all
    }

    /// Largest difference to the codec library's own filter; its approximations may round the other way.
    fn largest_difference<T: bytemuck::Pod + Copy>(ours: &[u8], theirs: &[T], number: fn(T) -> i32) -> i32 {
        let ours: Vec<T> = bytemuck::pod_collect_to_vec(ours);
        ours.iter().zip(theirs).map(|(a, b)| (number(*a) - number(*b)).abs()).max().unwrap()
    }

    #[test]
    fn octahedral_vectors_come_back() {
        let small: Vec<[i8; 4]> = meshopt::encode_filter_oct(&directions(), 8);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&small);
        octahedral(&mut ours, 1);
        for (got, wanted) in ours.as_chunks::<4>().0.iter().zip(directions()) {
            for (byte, component) in got.iter().zip(wanted) {
                assert!((f32::from(*byte as i8) / 127.0 - component).abs() < 0.02);
            }
        }
        let mut theirs = small;
        meshopt::decode_filter_oct(&mut theirs);
        assert!(largest_difference::<i8>(&ours, theirs.as_flattened(), i32::from) <= 1);

        let wide: Vec<[i16; 4]> = meshopt::encode_filter_oct(&directions(), 12);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&wide);
        octahedral(&mut ours, 2);
        let mut theirs = wide;
        meshopt::decode_filter_oct(&mut theirs);
        assert!(largest_difference::<i16>(&ours, theirs.as_flattened(), i32::from) <= 1);
    }

    #[test]
    fn quaternions_come_back() {
        let encoded = meshopt::encode_filter_quat(&directions(), 12);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&encoded);
        quaternion(&mut ours);
        let mut theirs = encoded;
        meshopt::decode_filter_quat(&mut theirs);
        assert!(largest_difference::<i16>(&ours, theirs.as_flattened(), i32::from) <= 1);
    }

    #[test]
    fn exponents_come_back_bit_for_bit() {
        let values: Vec<[f32; 3]> = directions().iter().map(|v| [v[0] * 1e6, v[1] * 1e-6, v[2]]).collect();
        let encoded = meshopt::encode_filter_exp(&values, 20, meshopt::EncodeExpMode::Separate);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&encoded);
        exponential(&mut ours);
        let mut theirs = encoded;
        meshopt::decode_filter_exp(&mut theirs);
        assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&ours), theirs.as_flattened());
        exponential(&mut [0x80; 4]);
        exponential(&mut [0x7F; 4]);
    }

    #[test]
    fn colours_come_back() {
        let colours: Vec<[f32; 4]> = directions().iter().map(|v| v.map(f32::abs)).collect();
        let encoded: Vec<[u8; 4]> = meshopt::encode_filter_color(&colours, 8);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&encoded);
        colour(&mut ours, 1);
        let mut theirs = encoded;
        meshopt::decode_filter_color(&mut theirs);
        assert!(largest_difference::<u8>(&ours, theirs.as_flattened(), i32::from) <= 1);

        let encoded: Vec<[u16; 4]> = meshopt::encode_filter_color(&colours, 12);
        let mut ours: Vec<u8> = bytemuck::pod_collect_to_vec(&encoded);
        colour(&mut ours, 2);
        let mut theirs = encoded;
        meshopt::decode_filter_color(&mut theirs);
        assert!(largest_difference::<u16>(&ours, theirs.as_flattened(), i32::from) <= 1);
    }

    #[test]
    fn nonsense_does_not_panic() {
        for byte in [0, 1, 0x7F, 0x80, 0xFF] {
            octahedral(&mut [byte; 8], 1);
            octahedral(&mut [byte; 8], 2);
            quaternion(&mut [byte; 8]);
            exponential(&mut [byte; 8]);
            colour(&mut [byte; 8], 1);
            colour(&mut [byte; 8], 2);
        }
    }
}
