//! What the images of a document weigh and measure: bytes and texels, read from the files' first bytes and not decoded.

use std::path::Path;

use serde_json::Value;

use super::image_file::dimensions;
use super::looks::image_bytes;
use crate::gltf::buffers::Buffers;
use crate::gltf::document::Document;
use crate::gltf::uri;
use crate::gltf::views::Views;

/// One entry of `images`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageFacts {
    /// Its name, else the name of its file.
    pub name: Option<String>,
    /// Length of the image file, wherever it is kept.
    pub bytes: u64,
    /// What it takes of the scene file and its buffers; 0 for a file of its own.
    pub embedded: u64,
    /// Width and height in texels; `None` for formats that are not known here.
    pub size: Option<[u32; 2]>,
}

/// One for each entry of `images`. An image that is missing weighs nothing. `base` is the scene's folder.
pub fn image_facts(document: &Document, buffers: &Buffers, base: &Path) -> Vec<ImageFacts> {
    let (Ok(entries), Ok(views)) = (document.array("images"), Views::new(document, buffers)) else { return Vec::new() };
    let facts = |(index, entry): (usize, &Value)| {
        let address = entry.get("uri").and_then(Value::as_str);
        let is_data = address.is_some_and(|address| uri::form(address) == uri::Form::Data);
        let file = address.filter(|_| !is_data).map(|address| address.rsplit('/').next().unwrap_or(address));
        let name = entry.get("name").and_then(Value::as_str).filter(|name| !name.is_empty()).or(file);
        let content = image_bytes(document, &views, base, index).ok();
        let bytes = content.as_ref().map_or(0, |content| content.len() as u64);
        let embedded = match address {
            Some(address) if is_data => address.len() as u64,
            Some(_) => 0,
            None => bytes,
        };
        let size = content.and_then(|content| dimensions(&content));
        ImageFacts { name: name.map(str::to_owned), bytes, embedded, size }
    };
    entries.iter().enumerate().map(facts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::document::Container;
    use base64::Engine as _;
    use serde_json::json;
    use std::io::Cursor;

    #[test]
    fn images_are_measured_wherever_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let mut png = Vec::new();
        image::RgbaImage::new(6, 3).write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        std::fs::write(folder.path().join("a b.png"), &png).unwrap();
        let data = format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(&png));
        let mut document = Document::new(Container::Gltf, "test");
        document.json["images"] =
            json!([{ "uri": "a%20b.png" }, { "uri": data, "name": "inside" }, { "uri": "no.png" }]);
        let found = image_facts(&document, &Buffers::default(), folder.path());
        let bytes = png.len() as u64;
        let one = |name: &str, bytes, embedded, size| ImageFacts { name: Some(name.into()), bytes, embedded, size };
        assert_eq!(found[0], one("a%20b.png", bytes, 0, Some([6, 3])));
        assert_eq!(found[1], one("inside", bytes, data.len() as u64, Some([6, 3])));
        assert_eq!(found[2], one("no.png", 0, 0, None));
    }

    #[test]
    fn ktx2_tells_its_size_in_its_header() {
        let mut file = b"\xABKTX 20\xBB\r\n\x1A\n".to_vec();
        file.extend([0, 1, 512, 256].map(u32::to_le_bytes).concat());
        assert_eq!(dimensions(&file), Some([512, 256]));
        assert_eq!(dimensions(b"nothing"), None);
    }
}
