//! Image files as texels: PNG, JPEG, WebP, and KTX2 with Basis Universal.
//!
//! The JPEG decoder's vector code gives the same bytes as its scalar code (compared on all JPEG files of the corpus), so
//! that texels do not depend on the machine. Knows nothing of glTF.

use std::io::Cursor;

/// Largest image that is decoded, in texels along a side: a file of some bytes may claim more than fits in memory.
const LONGEST_SIDE: u32 = 16384;

/// Most bytes for one decoder.
const MOST_MEMORY: u64 = 2 << 30;

const KTX2: [u8; 12] = *b"\xABKTX 20\xBB\r\n\x1A\n";

/// An image as rows of texels from the top.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// Texels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue, alpha, as stored.
    pub texels: Vec<[u8; 4]>,
}

/// Width and height in texels, from the header alone; `None` for formats that are not known.
pub fn dimensions(bytes: &[u8]) -> Option<[u32; 2]> {
    if bytes.starts_with(&KTX2) {
        let at = |from: usize| Some(u32::from_le_bytes(bytes.get(from..from + 4)?.try_into().ok()?));
        return Some([at(20)?, at(24)?]);
    }
    let reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()?;
    let (width, height) = reader.into_dimensions().ok()?;
    Some([width, height])
}

/// Decodes an image file of any known format; what is wrong with it, in words.
pub fn decode(bytes: &[u8]) -> Result<Decoded, String> {
    if bytes.starts_with(&KTX2) {
        return basis(bytes);
    }
    let fail = |e: image::ImageError| format!("the image cannot be decoded: {e}");
    let mut reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    if reader.format().is_none() {
        return Err("the image is neither PNG, JPEG, WebP nor KTX2".to_owned());
    }
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LONGEST_SIDE), Some(LONGEST_SIDE));
    limits.max_alloc = Some(MOST_MEMORY);
    reader.limits(limits);
    let image = reader.decode().map_err(fail)?.into_rgba8();
    let (width, height) = image.dimensions();
    Ok(Decoded { width, height, texels: rows(image.as_raw()) })
}

/// The finest level of a KTX2 file in one of the Basis Universal formats.
fn basis(bytes: &[u8]) -> Result<Decoded, String> {
    let fail = |e: basisu::Error| format!("the KTX2 image cannot be decoded: {e:?}");
    // The length of the key/value data, which is of no use here and which basisu 0.1.0 believes too readily.
    let mut bytes = bytes.to_vec();
    if let Some(length) = bytes.get_mut(60..64) {
        length.fill(0);
    }
    let file = basisu::Transcoder::new(&bytes).map_err(fail)?;
    let (width, height) = file.base_dimensions();
    if width > LONGEST_SIDE || height > LONGEST_SIDE {
        return Err(format!("the KTX2 image has {width}×{height} texels, more than can be shown"));
    }
    let texels = file.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE).map_err(fail)?;
    Ok(Decoded { width, height, texels: rows(&texels) })
}

fn rows(bytes: &[u8]) -> Vec<[u8; 4]> {
    bytes.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(format: image::ImageFormat) -> Decoded {
        let image =
            image::RgbImage::from_fn(16, 8, |x, _| image::Rgb(if x < 8 { [200, 40, 40] } else { [40, 40, 200] }));
        let mut bytes = Vec::new();
        image.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        decode(&bytes).unwrap()
    }

    #[test]
    fn png_jpeg_and_webp_are_read() {
        for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg, image::ImageFormat::WebP] {
            let image = written(format);
            assert_eq!((image.width, image.height, image.texels.len()), (16, 8, 128));
            let [r, _, b, a] = image.texels[2];
            assert!(r.abs_diff(200) < 8 && b.abs_diff(40) < 8 && a == 255, "{format:?}: {r} {b}");
            assert!(image.texels[125][2].abs_diff(200) < 8, "{format:?}");
        }
    }

    #[test]
    fn damaged_files_are_named() {
        let mut ktx = KTX2.to_vec();
        ktx.resize(80, 7);
        assert!(decode(&ktx).unwrap_err().starts_with("the KTX2 image cannot be decoded: "));
        assert!(decode(&KTX2).is_err());
        let words = decode(b"\x89PNG\r\n\x1A\n....").unwrap_err();
        assert!(words.starts_with("the image cannot be decoded: "), "{words}");
        assert_eq!(
            decode(b"GIF89a").unwrap_err(),
            "the image cannot be decoded: The image format Gif is not supported"
        );
    }
}
