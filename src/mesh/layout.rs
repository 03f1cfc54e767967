//! Which attributes of a mesh take part in the error, and how they become numbers of one common unit.
//!
//! All distances are in units of the mesh's radius (half the diagonal of its bounding box), all attributes are scaled
//! so that a difference of 1 weighs as much as moving by one radius. Knows nothing of metrics and quadrics.

use super::{Mesh, Primitive};

/// Scale of each kind of attribute: what a difference of one unit weighs against a distance of one radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeScale {
    /// For unit normals.
    pub normal: f64,
    /// For texture coordinates, after they are scaled to the surface (`sqrt(area / area in texture space)`).
    pub texcoord: f64,
    /// For colours in [0, 1].
    pub color: f64,
}

/// A scale below this is raised to it: the value is still carried and solved for, but weighs nothing.
const LEAST_SCALE: f64 = 1e-6;

/// Kind of a field group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// `NORMAL`
    Normal,
    /// `TEXCOORD_n`
    Texcoord,
    /// `COLOR_n`
    Color,
}

/// One attribute that takes part in the error.
#[derive(Clone, Debug)]
pub struct Field {
    /// glTF semantic.
    pub name: String,
    /// What it is.
    pub kind: FieldKind,
    /// First column in a wedge's values.
    pub offset: usize,
    /// Number of columns.
    pub components: usize,
    /// Scale for each primitive, 0 where the primitive lacks the attribute; none in [`Layout::unscaled`].
    pub scale: Vec<f64>,
}

/// The fields of a mesh, the frame its positions are scaled to, and nothing else.
#[derive(Clone, Debug)]
pub struct Layout {
    /// In the order of their columns.
    pub fields: Vec<Field>,
    /// Number of columns of all fields.
    pub columns: usize,
    /// Centre of the bounding box, object space.
    pub center: [f64; 3],
    /// Half the diagonal of the bounding box, object space; 1 if that is zero.
    pub radius: f64,
}

impl Layout {
    /// The layout of `mesh`.
    pub fn new(mesh: &Mesh, scale: AttributeScale) -> Self {
        let mut out = Self::unscaled(mesh);
        for field in &mut out.fields {
            field.scale = mesh.primitives.iter().map(|p| field_scale(field, p, scale, out.radius)).collect();
        }
        out
    }

    /// The layout of `mesh` without scales.
    pub fn unscaled(mesh: &Mesh) -> Self {
        let (center, radius) = frame(&mesh.primitives);
        let mut fields: Vec<Field> = Vec::new();
        for primitive in &mesh.primitives {
            for attribute in &primitive.attributes {
                if let Some(kind) = kind(&attribute.name)
                    && !fields.iter().any(|f| f.name == attribute.name)
                {
                    let components = attribute.components;
                    fields.push(Field { name: attribute.name.clone(), kind, offset: 0, components, scale: Vec::new() });
                }
            }
        }
        fields.sort_by(|a, b| (a.kind as u8, &a.name).cmp(&(b.kind as u8, &b.name)));
        let mut columns = 0;
        fields.retain(|field| {
            columns += field.components;
            columns <= MOST_COLUMNS
        });
        columns = 0;
        for field in &mut fields {
            field.offset = columns;
            columns += field.components;
        }
        Self { fields, columns, center, radius }
    }

    /// Object space to the unit frame.
    #[inline]
    pub fn to_frame(&self, p: [f32; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| (f64::from(p[i]) - self.center[i]) / self.radius)
    }

    /// Unit frame to object space.
    #[inline]
    pub fn to_object(&self, p: [f64; 3]) -> [f32; 3] {
        [0, 1, 2].map(|i| (self.center[i] + p[i] * self.radius) as f32)
    }
}

/// Attributes past this many values take no part in the error and are interpolated.
pub const MOST_COLUMNS: usize = 32;

fn kind(name: &str) -> Option<FieldKind> {
    if name == "NORMAL" {
        Some(FieldKind::Normal)
    } else if name.starts_with("TEXCOORD_") {
        Some(FieldKind::Texcoord)
    } else if name.starts_with("COLOR_") {
        Some(FieldKind::Color)
    } else {
        None
    }
}

/// Centre and half diagonal of the bounding box of all positions.
pub fn frame<'a>(primitives: impl IntoIterator<Item = &'a Primitive>) -> ([f64; 3], f64) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for primitive in primitives {
        for p in primitive.positions() {
            for i in 0..3 {
                low[i] = low[i].min(f64::from(p[i]));
                high[i] = high[i].max(f64::from(p[i]));
            }
        }
    }
    if high[0] < low[0] {
        return ([0.0; 3], 1.0);
    }
    let center = [0, 1, 2].map(|i| low[i] + (high[i] - low[i]) * 0.5);
    let diagonal: f64 = (0..3).map(|i| (high[i] - low[i]) * (high[i] - low[i])).sum::<f64>().sqrt();
    (center, if diagonal > 0.0 { diagonal * 0.5 } else { 1.0 })
}

fn field_scale(field: &Field, primitive: &Primitive, scale: AttributeScale, radius: f64) -> f64 {
    let Some(attribute) = primitive.attribute(&field.name) else { return 0.0 };
    if attribute.components != field.components {
        return 0.0;
    }
    match field.kind {
        FieldKind::Normal => scale.normal.max(LEAST_SCALE),
        FieldKind::Color => scale.color.max(LEAST_SCALE),
        FieldKind::Texcoord => {
            let weight = scale.texcoord.max(LEAST_SCALE);
            weight * texture_to_surface(primitive, &attribute.values) / radius
        }
    }
}

/// `sqrt(area of the surface / area in texture space)`; 1 where the texture space is degenerate.
fn texture_to_surface(primitive: &Primitive, uv: &[f32]) -> f64 {
    let positions = primitive.positions();
    let (mut surface, mut texture) = (0.0, 0.0);
    for t in primitive.indices.chunks_exact(3) {
        let p = [0, 1, 2].map(|i| positions[t[i] as usize].map(f64::from));
        let n = crate::quadric::cross(crate::quadric::sub(p[1], p[0]), crate::quadric::sub(p[2], p[0]));
        surface += crate::quadric::dot(n, n).sqrt();
        let q = [0, 1, 2].map(|i| {
            let at = t[i] as usize * 2;
            [f64::from(uv[at]), f64::from(uv[at + 1])]
        });
        texture += ((q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0])).abs();
    }
    let ratio = (surface / texture).sqrt();
    if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
}
