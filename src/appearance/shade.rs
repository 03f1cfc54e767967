//! What colour a pixel has: glTF's metallic-roughness material under one lamp at the camera and a faint even light
//! from everywhere.
//!
//! With the lamp at the camera, light, view and half vector are one, and the formulas get short. The material is that
//! of the glTF 2.0 specification, appendix B; the even light's specular part after B. Karis, *Physically
//! based shading on mobile*, 2014.

use super::drawable::Part;
use super::looks::Looks;
use super::material::{Alpha, Material, TextureUse};
use super::raster::{Setup, Weights};
use super::srgb::Srgb;
use glam::{DMat3, DMat4, DVec3, Mat3, Vec2, Vec3, Vec4};
use std::sync::LazyLock;

/// What the lamp adds to a white matte surface that faces it.
pub const LAMP: f32 = 0.9;

/// What the even light adds to it. Without it polished metal would be black but for its highlight.
pub const EVEN: f32 = 0.1;

/// Smoothest surface, as three.js has it: a smaller highlight would be lost between pixels.
pub const LEAST_ROUGHNESS: f32 = 0.0525;

/// What is behind everything: light grey. A lamp at the camera leaves outlines the darkest part of a surface (0 to
/// about 130), so that they stand out from it on bright and on dark objects; from black or mid-grey one of them would
/// not.
pub const BACKGROUND: [u8; 3] = [192; 3];

/// Thresholds of the screen door for blended surfaces (B. Bayer, 1973), in sixteenths.
pub const SCREEN_DOOR: [u8; 16] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// An instance, prepared for all views.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Object space to world space.
    pub transform: DMat4,
    /// Turns directions; not to scale.
    pub(super) linear: Mat3,
    /// Turns normals, outward stays outward; not to scale.
    pub(super) normal: Mat3,
    /// The transform mirrors.
    pub mirrored: bool,
}

impl Placed {
    /// Prepares a transform.
    pub fn new(transform: DMat4) -> Self {
        let linear = DMat3::from_mat4(transform);
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let mirrored = x.cross(y).dot(z) < 0.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign);
        Self { transform, linear: unscaled(linear), normal: unscaled(cofactor), mirrored }
    }
}

/// The matrix scaled so that its largest number is 1, where single precision is at home.
fn unscaled(matrix: DMat3) -> Mat3 {
    let most = matrix.to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if most > 0.0 && most.is_finite() { (matrix * (1.0 / most)).as_mat3() } else { Mat3::IDENTITY }
}

/// exp2(-9.28 x) at x = i / 255.
pub(super) static FALL_OFF: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| libm::exp2(-9.28 * i as f64 / 255.0) as f32));

/// Shades the pixels of one view.
#[derive(Clone, Copy)]
pub struct Shader<'a> {
    /// Materials and textures.
    pub looks: &'a Looks,
    /// The camera and the lamp, world space.
    pub eye: DVec3,
    /// Tables of the transfer function.
    pub srgb: Srgb,
}

/// One pixel of one triangle.
struct Pixel<'a> {
    part: &'a Part,
    setup: &'a Setup,
    weights: Weights,
    /// Texture coordinates of set 0, which most materials use alone.
    first: Option<Laid>,
}

/// Texture coordinates at a pixel and their change for one pixel to the right and up.
#[derive(Clone, Copy)]
struct Laid {
    at: Vec2,
    dx: Vec2,
    dy: Vec2,
}

impl<'a> Pixel<'a> {
    fn new(part: &'a Part, setup: &'a Setup, x: i32, y: i32) -> Self {
        let mut pixel = Self { part, setup, weights: setup.weights(x, y), first: None };
        pixel.first = pixel.lay(0);
        pixel
    }

    /// The texture coordinates of the corners; a part need not have them.
    fn corners(&self, set: usize) -> Option<[Vec2; 3]> {
        let set = self.part.uvs.get(set).filter(|set| !set.is_empty())?;
        Some(self.setup.corners.map(|i| set[i as usize]))
    }

    fn lay(&self, set: usize) -> Option<Laid> {
        let corners = self.corners(set)?;
        let (dx, dy) = self.weights.slope(corners);
        Some(Laid { at: mix(corners, self.weights.at), dx, dy })
    }

    fn laid(&self, set: usize) -> Option<Laid> {
        if set == 0 { self.first } else { self.lay(set) }
    }
}

impl Shader<'_> {
    /// Is a surface with holes solid in a pixel?
    pub fn passes(&self, part: &Part, setup: &Setup, x: i32, y: i32) -> bool {
        let material = &self.looks.materials[part.material];
        let alpha = || self.base(material, &Pixel::new(part, setup, x, y)).w;
        match material.alpha {
            Alpha::Opaque => true,
            Alpha::Mask(cutoff) => alpha() >= cutoff,
            Alpha::Blend => alpha() * 16.0 > f32::from(SCREEN_DOOR[(y % 4 * 4 + x % 4) as usize]) + 0.5,
        }
    }

    /// The colour of a pixel, sRGB.
    pub fn color(&self, part: &Part, placed: &Placed, setup: &Setup, x: i32, y: i32) -> [u8; 3] {
        let material = &self.looks.materials[part.material];
        let pixel = Pixel::new(part, setup, x, y);
        let base = self.base(material, &pixel).truncate();
        let light = if material.unlit { base } else { self.lit(material, base, placed, &pixel) };
        light.to_array().map(|c| self.srgb.byte(c))
    }

    /// Base colour and alpha.
    fn base(&self, material: &Material, pixel: &Pixel<'_>) -> Vec4 {
        let mut base = material.base;
        if let Some(colors) = &pixel.part.colors {
            base *= mix(pixel.setup.corners.map(|i| colors[i as usize]), pixel.weights.at);
        }
        if let Some(value) = self.texture(material.base_texture.as_ref(), pixel) {
            base *= value;
        }
        base
    }

    /// The value of a texture; none without one or without coordinates for it.
    fn texture(&self, used: Option<&TextureUse>, pixel: &Pixel<'_>) -> Option<Vec4> {
        let used = used?;
        let Laid { at, dx, dy } = pixel.laid(used.set)?;
        let (dx, dy) = (used.direction(dx), used.direction(dy));
        Some(self.looks.textures[used.texture].sample(self.srgb, used.point(at), dx, dy, used.wrap))
    }

    fn lit(&self, material: &Material, base: Vec3, placed: &Placed, pixel: &Pixel<'_>) -> Vec3 {
        let positions = pixel.setup.corners.map(|i| pixel.part.positions[i as usize]);
        let at = placed.transform.transform_point3(mix(positions, pixel.weights.at).as_dvec3());
        let view = (self.eye - at).as_vec3().normalize_or_zero();
        let mut normal = self.normal(material, placed, pixel, positions);
        if pixel.setup.back {
            normal = -normal;
        }
        let facing = normal.dot(view).clamp(0.0, 1.0);
        let (mut metallic, mut roughness) = (material.metallic, material.roughness);
        if let Some(value) = self.texture(material.metallic_roughness_texture.as_ref(), pixel) {
            metallic *= value.z;
            roughness *= value.y;
        }
        let roughness = roughness.max(LEAST_ROUGHNESS);
        let specular = Vec3::splat(0.04) * (1.0 - metallic) + base * metallic;
        let diffuse = base * ((1.0 - metallic) * 0.96);
        let mut light = diffuse * (LAMP * facing + EVEN) + specular * (LAMP * highlight(facing, roughness));
        let (scale, bias) = surround(facing, roughness);
        light += (specular * scale + Vec3::splat(bias)) * EVEN;
        light += self.emission(material, pixel);
        light
    }

    fn emission(&self, material: &Material, pixel: &Pixel<'_>) -> Vec3 {
        if material.emissive == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let texture = self.texture(material.emissive_texture.as_ref(), pixel);
        texture.map_or(material.emissive, |value| material.emissive * value.truncate())
    }

    /// The shading normal in world space, a unit vector, outward.
    fn normal(&self, material: &Material, placed: &Placed, pixel: &Pixel<'_>, positions: [Vec3; 3]) -> Vec3 {
        let smooth = mix(pixel.setup.corners.map(|i| pixel.part.normals[i as usize]), pixel.weights.at);
        let normal = (placed.normal * smooth).normalize_or_zero();
        if normal == Vec3::ZERO {
            return flat(placed, pixel.setup, positions);
        }
        let used = material.normal_texture.as_ref();
        let Some((used, value)) = used.zip(self.texture(used, pixel)) else { return normal };
        let Some((tangent, bitangent)) = tangents(placed, pixel, smooth, positions, used) else { return normal };
        let bump = value.truncate() * 2.0 - Vec3::ONE;
        let bump = Vec3::new(bump.x * material.normal_scale, bump.y * material.normal_scale, bump.z);
        let bent = (tangent * bump.x + bitangent * bump.y + normal * bump.z).normalize_or_zero();
        if bent == Vec3::ZERO { normal } else { bent }
    }
}

/// The triangle's own normal, for vertices whose normals are zero.
fn flat(placed: &Placed, setup: &Setup, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let normal = (placed.normal * (b - a).cross(c - a)).normalize_or_zero();
    // Corners of triangles that are clockwise on the screen were put in the other order.
    if setup.back == placed.mirrored { normal } else { -normal }
}

/// Unit tangent and bitangent in world space: those of the vertices, else along the texture's axes, whose v points
/// down while a normal map's y points up. `None` where the texture is laid on without extent.
fn tangents(
    placed: &Placed,
    pixel: &Pixel<'_>,
    normal: Vec3,
    [a, b, c]: [Vec3; 3],
    used: &TextureUse,
) -> Option<(Vec3, Vec3)> {
    let (tangent, bitangent) = if let Some(tangents) = &pixel.part.tangents {
        let corners = pixel.setup.corners.map(|i| tangents[i as usize]);
        let tangent = mix(corners, pixel.weights.at).truncate();
        (tangent, normal.cross(tangent) * corners[0].w)
    } else {
        let uv = pixel.corners(used.set)?;
        let (p, q) = (b - a, c - a);
        let (s, t) = (used.direction(uv[1] - uv[0]), used.direction(uv[2] - uv[0]));
        let area = s.perp_dot(t);
        if area == 0.0 {
            return None;
        }
        let sign = if area < 0.0 { -1.0 } else { 1.0 };
        ((p * t.y - q * s.y) * sign, (p * t.x - q * s.x) * sign)
    };
    let world = (placed.normal * normal).normalize_or_zero();
    let tangent = placed.linear * tangent;
    let tangent = (tangent - world * world.dot(tangent)).normalize_or_zero();
    let bitangent = placed.linear * bitangent;
    let bitangent = (bitangent - world * world.dot(bitangent)).normalize_or_zero();
    (tangent != Vec3::ZERO && bitangent != Vec3::ZERO).then_some((tangent, bitangent))
}

/// Sum of three corners' values by their shares, in that order.
#[inline]
fn mix<T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>>([a, b, c]: [T; 3], w: [f32; 3]) -> T {
    a * w[0] + b * w[1] + c * w[2]
}

/// The specular part of the lamp for a surface of specular colour 1: D · V · n·l · π with light = view = half vector
/// (GGX, Smith). `facing` = n·v.
fn highlight(facing: f32, roughness: f32) -> f32 {
    let a2 = {
        let a = roughness * roughness;
        a * a
    };
    let f2 = facing * facing;
    let d = f2 * (a2 - 1.0) + 1.0;
    a2 / (d * d) * 0.25 / (f2 * (1.0 - a2) + a2).sqrt()
}

/// The specular part of light 1 from everywhere: factor of the specular colour and what comes on top.
fn surround(facing: f32, roughness: f32) -> (f32, f32) {
    let x = 1.0 - roughness;
    let y = 0.0425 - 0.0275 * roughness;
    let (z, w) = (1.04 - 0.572 * roughness, 0.022 * roughness - 0.04);
    let fall_off = FALL_OFF[(facing * 255.0 + 0.5) as usize];
    let a = (x * x).min(fall_off) * x + y;
    (z - 1.04 * a, 1.04 * a + w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_light_on_a_white_surface_is_about_all_reflected() {
        for i in 0..=10 {
            let (scale, bias) = surround(i as f32 / 10.0, 0.3);
            assert!((0.8..=1.05).contains(&(scale + bias)), "{i}: {scale} {bias}");
        }
    }

    #[test]
    fn highlight_has_its_closed_form_at_the_middle() {
        // D = 1 / (π a²), V = 1 / 4, times π.
        let roughness = 0.5f32;
        assert!((highlight(1.0, roughness) - 0.25 / 0.0625).abs() < 1e-3);
        assert!(highlight(0.0, 0.0525).is_finite() && highlight(0.5, 0.1) < highlight(0.9, 0.1));
    }

    #[test]
    fn normals_stay_outward_in_a_mirror() {
        let placed = Placed::new(DMat4::from_scale(DVec3::new(-2.0, 1.0, 1.0)));
        assert!(placed.mirrored);
        let n = (placed.normal * Vec3::X).normalize_or_zero();
        assert_eq!(n, -Vec3::X);
        assert!(!Placed::new(DMat4::IDENTITY).mirrored);
        assert_eq!(Placed::new(DMat4::ZERO).linear, Mat3::IDENTITY);
    }
}
