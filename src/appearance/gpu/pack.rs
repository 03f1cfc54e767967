//! Drawables as arrays of words for a shader: records of parts, materials and textures that point at each other.
//!
//! Knows the layout that `draw.wgsl` reads and nothing of devices.

use std::ops::Range;

use glam::{DMat4, DVec3, Mat3, Vec2, Vec3, Vec4};

use crate::appearance::drawable::{Drawable, Instance, MOST_SETS, Part};
use crate::appearance::looks::Looks;
use crate::appearance::material::{Alpha, Material, TextureUse};
use crate::appearance::shade::{FALL_OFF, Placed};
use crate::appearance::srgb::Srgb;
use crate::appearance::texture::{Encoding, Wrap};
use crate::appearance::views::Camera;

/// Stands for "has none".
const NONE: u32 = u32::MAX;

/// Offsets in records and the numbers of closed lists, by the shader's names for them.
pub(super) const OFFSETS: [(&str, usize); 39] = [
    // A part: where its arrays start, or NONE.
    ("PART_POSITIONS", 0),
    ("PART_NORMALS", 1),
    ("PART_TANGENTS", 2),
    ("PART_COLORS", 3),
    ("PART_INDICES", 4),
    ("PART_MATERIAL", 5),
    ("PART_FIRST_FACE", 6),
    ("PART_UVS", 7),
    // A material.
    ("MATERIAL_BASE", 0),
    ("MATERIAL_METALLIC", 4),
    ("MATERIAL_ROUGHNESS", 5),
    ("MATERIAL_NORMAL_SCALE", 6),
    ("MATERIAL_EMISSIVE", 7),
    ("MATERIAL_ALPHA", 10),
    ("MATERIAL_CUTOFF", 11),
    ("MATERIAL_DOUBLE_SIDED", 12),
    ("MATERIAL_UNLIT", 13),
    ("MATERIAL_BASE_USE", 14),
    ("MATERIAL_METALLIC_ROUGHNESS_USE", 14 + USE),
    ("MATERIAL_NORMAL_USE", 14 + 2 * USE),
    ("MATERIAL_EMISSIVE_USE", 14 + 3 * USE),
    // A texture in use.
    ("USE_TEXTURE", 0),
    ("USE_SET", 1),
    ("USE_WRAP", 2),
    ("USE_U", 4),
    ("USE_V", 6),
    ("USE_OFFSET", 8),
    // A texture: start, width and height of each level.
    ("TEXTURE_COUNT", 0),
    ("TEXTURE_COLOR", 1),
    ("TEXTURE_LEVELS", 2),
    // Tables, from where the first one starts: light of each byte, least light of each byte, fall-off.
    ("TABLE_LEAST", 256),
    ("TABLE_FALL_OFF", 256 + 257),
    ("WRAP_REPEAT", 0),
    ("WRAP_MIRROR", 1),
    ("WRAP_CLAMP", 2),
    ("ALPHA_OPAQUE", 0),
    ("ALPHA_MASK", 1),
    ("ALPHA_BLEND", 2),
    ("SETS", MOST_SETS),
];

/// Words of a texture in use.
const USE: usize = 10;

/// A drawable as the shader reads it.
pub(super) struct Packed {
    /// Tables, textures' records, materials, parts with their vertices.
    pub words: Vec<u32>,
    /// Four bytes each, red in the lowest.
    pub texels: Vec<u32>,
    outline: Outline,
}

/// What is needed of it for each view.
pub(super) struct Outline {
    /// Where the tables start.
    pub tables: u32,
    /// Where each part's record starts.
    parts: Vec<u32>,
    /// What was taken from each part's positions, so that they are small numbers.
    centers: Vec<DVec3>,
}

/// As `Placed` in the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Place([[f32; 4]; 12]);

impl Packed {
    pub(super) fn new(drawable: &Drawable) -> Self {
        let mut words = Vec::new();
        let srgb = Srgb::new();
        let tables = words.len() as u32;
        put(&mut words, (0..=255).map(|byte| srgb.light(byte)));
        put(&mut words, srgb.least().iter().copied());
        put(&mut words, FALL_OFF.iter().copied());
        let mut texels = vec![0];
        let textures = put_textures(&drawable.looks, &mut words, &mut texels);
        let materials: Vec<u32> = drawable
            .looks
            .materials
            .iter()
            .map(|material| {
                let at = words.len() as u32;
                put_material(material, &textures, &mut words);
                at
            })
            .collect();
        let mut outline = Outline { tables, parts: Vec::new(), centers: Vec::new() };
        for (part, first_face) in drawable.parts.iter().zip(drawable.first_faces()) {
            let center = middle(part);
            outline.parts.push(put_part(part, center, materials[part.material], first_face, &mut words));
            outline.centers.push(center);
        }
        Self { words, texels, outline }
    }

    /// Gives the arrays back to the memory.
    pub(super) fn into_outline(self) -> Outline {
        self.outline
    }
}

fn put(words: &mut Vec<u32>, values: impl IntoIterator<Item = f32>) -> u32 {
    let at = words.len() as u32;
    words.extend(values.into_iter().map(f32::to_bits));
    at
}

fn put_textures(looks: &Looks, words: &mut Vec<u32>, texels: &mut Vec<u32>) -> Vec<u32> {
    let mut records = Vec::new();
    for texture in &looks.textures {
        records.push(words.len() as u32);
        words.extend([texture.levels().count() as u32, u32::from(texture.encoding() == Encoding::Color)]);
        for (width, height, level) in texture.levels() {
            words.extend([texels.len() as u32, width, height]);
            texels.extend(level.iter().map(|texel| u32::from_le_bytes(*texel)));
        }
    }
    records
}

fn put_material(material: &Material, textures: &[u32], words: &mut Vec<u32>) {
    put(words, material.base.to_array());
    put(words, [material.metallic, material.roughness, material.normal_scale]);
    put(words, material.emissive.to_array());
    let (alpha, cutoff) = match material.alpha {
        Alpha::Opaque => (0, 0.0),
        Alpha::Mask(cutoff) => (1, cutoff),
        Alpha::Blend => (2, 0.0),
    };
    words.push(alpha);
    put(words, [cutoff]);
    words.extend([u32::from(material.double_sided), u32::from(material.unlit)]);
    let uses = [
        &material.base_texture,
        &material.metallic_roughness_texture,
        &material.normal_texture,
        &material.emissive_texture,
    ];
    for used in uses {
        put_use(used.as_ref(), textures, words);
    }
}

fn put_use(used: Option<&TextureUse>, textures: &[u32], words: &mut Vec<u32>) {
    // Parts have no more sets than that, so that the texture could not be laid on anyway.
    let Some(used) = used.filter(|used| used.set < MOST_SETS) else {
        words.extend([NONE; USE]);
        return;
    };
    let mode = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    words.extend([textures[used.texture], used.set as u32, mode(used.wrap[0]), mode(used.wrap[1])]);
    let (u, v, offset) = used.transform.map_or(([1.0, 0.0], [0.0, 1.0], [0.0; 2]), |transform| {
        (transform.u.to_array(), transform.v.to_array(), transform.offset.to_array())
    });
    put(words, u.into_iter().chain(v).chain(offset));
}

/// The middle of a part's bounding box, in single precision, so that differences from it are as exact as can be.
fn middle(part: &Part) -> DVec3 {
    let points = || part.positions.iter().filter(|p| p.is_finite());
    let (low, high) = points().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let middle = low.midpoint(high);
    if middle.is_finite() { middle.as_dvec3() } else { DVec3::ZERO }
}

/// Answers where the record starts.
fn put_part(part: &Part, center: DVec3, material: u32, first_face: u32, words: &mut Vec<u32>) -> u32 {
    let positions = put(words, part.positions.iter().flat_map(|p| (p.as_dvec3() - center).as_vec3().to_array()));
    let normals = put(words, part.normals.iter().flat_map(Vec3::to_array));
    let tangents = part.tangents.as_ref().map_or(NONE, |list| put(words, list.iter().flat_map(Vec4::to_array)));
    let colors = part.colors.as_ref().map_or(NONE, |list| put(words, list.iter().flat_map(Vec4::to_array)));
    let sets: Vec<u32> = (0..MOST_SETS)
        .map(|set| match part.uvs.get(set) {
            Some(uvs) if !uvs.is_empty() => put(words, uvs.iter().flat_map(Vec2::to_array)),
            _ => NONE,
        })
        .collect();
    let indices = words.len() as u32;
    words.extend(&part.indices);
    let record = words.len() as u32;
    words.extend([positions, normals, tangents, colors, indices, material, first_face]);
    words.extend(sets);
    record
}

impl Outline {
    /// The instances, as seen from one camera.
    pub(super) fn places(&self, drawable: &Drawable, camera: &Camera) -> Vec<Place> {
        let place = |instance: &Instance| {
            let placed = Placed::new(instance.transform);
            // In double precision up to here: what is far from the origin loses nothing.
            let own = instance.transform * DMat4::from_translation(self.centers[instance.part]);
            let clip = (camera.clip * own).transpose();
            let around = (DMat4::from_translation(-camera.eye) * own).transpose();
            let (linear, normal) = (columns(placed.linear), columns(placed.normal));
            let rows = [clip.x_axis, clip.y_axis, clip.w_axis, around.x_axis, around.y_axis, around.z_axis];
            let rows = rows.map(|row| row.as_vec4().to_array());
            let mut out = [[0.0; 4]; 12];
            out[..6].copy_from_slice(&rows);
            out[6..9].copy_from_slice(&linear);
            out[9..].copy_from_slice(&normal);
            out[6][3] = f32::from_bits(self.parts[instance.part]);
            out[9][3] = f32::from(u8::from(placed.mirrored));
            Place(out)
        };
        drawable.instances.iter().map(place).collect()
    }
}

/// Corners and instances of each call, in order: neighbours that show the same part are drawn at once.
pub(super) fn draws(drawable: &Drawable) -> impl Iterator<Item = (u32, Range<u32>)> + '_ {
    let groups = drawable.instances.chunk_by(|a, b| a.part == b.part);
    groups.scan(0, |first, group| {
        let range = *first..*first + group.len() as u32;
        *first = range.end;
        Some((drawable.parts[group[0].part].indices.len() as u32, range))
    })
}

fn columns(matrix: Mat3) -> [[f32; 4]; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.extend(0.0).to_array())
}
