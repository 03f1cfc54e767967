//! A similarity of space as a node can carry it: translation, rotation, one scale, perhaps a reflection.
//!
//! Knows nothing of meshes. Results use + − × ÷ √ alone.

use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// `p ↦ translation + rotation · scale · p`, after `x ↦ −x` where it mirrors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// More than 0.
    pub scale: f64,
    /// Reflects in the plane x = 0 first.
    pub mirror: bool,
    /// A unit quaternion.
    pub rotation: DQuat,
    /// Last.
    pub translation: DVec3,
}

impl Similarity {
    /// Everything stays where it is.
    pub const IDENTITY: Self = Self { scale: 1.0, mirror: false, rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Where a point goes.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.rotation * (self.scale * self.reflected(p)) + self.translation
    }

    /// Where a direction points, its length unchanged.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.rotation * self.reflected(d)
    }

    fn reflected(&self, p: DVec3) -> DVec3 {
        if self.mirror { DVec3::new(-p.x, p.y, p.z) } else { p }
    }

    /// With rotation and scale as the single-precision numbers that readers make of them, and the translation that
    /// then takes `from` to `to`: errors grow with the distance from there and not with that from the origin.
    pub fn as_read(&self, from: DVec3, to: DVec3) -> Self {
        let q = self.rotation.to_array().map(single);
        let scale = single(self.scale);
        let rounded = Self { scale, rotation: DQuat::from_array(q), translation: DVec3::ZERO, ..*self };
        let t = to - rounded.point(from);
        Self { translation: DVec3::new(single(t.x), single(t.y), single(t.z)), ..rounded }
    }

    /// Members of a node; what changes nothing is left out.
    pub fn node(&self) -> Map<String, Value> {
        let mut members = Map::new();
        if self.translation != DVec3::ZERO {
            members.insert("translation".to_owned(), numbers(&self.translation.to_array()));
        }
        if self.rotation != DQuat::IDENTITY {
            members.insert("rotation".to_owned(), numbers(&self.rotation.to_array()));
        }
        if self.scale != 1.0 || self.mirror {
            let x = if self.mirror { -self.scale } else { self.scale };
            members.insert("scale".to_owned(), numbers(&[x, self.scale, self.scale]));
        }
        members
    }
}

/// The rotation that a quaternion of any length but 0 stands for; none for 0.
pub fn rotation(q: DQuat) -> DQuat {
    let length = q.length();
    if 0.0 < length { q * (1.0 / length) } else { DQuat::IDENTITY }
}

fn single(value: f64) -> f64 {
    f64::from(value as f32)
}

/// As short as single precision can be read back.
fn numbers(values: &[f64]) -> Value {
    values.iter().map(|&v| json!((v as f32).to_string().parse::<f64>().unwrap_or(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_reflects_before_all_else() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turn = DQuat::from_xyzw(0.0, 0.0, half, half);
        let all = Similarity { scale: 2.0, mirror: true, rotation: turn, translation: DVec3::new(0.0, 0.0, 5.0) };
        let moved = all.point(DVec3::new(1.0, 0.0, 1.0));
        assert!((moved - DVec3::new(0.0, -2.0, 7.0)).length() < 1e-12, "{moved}");
        assert!((all.direction(DVec3::X) - DVec3::NEG_Y).length() < 1e-12);
        assert_eq!(all.node()["scale"], json!([-2.0, 2.0, 2.0]));
        assert!(Similarity::IDENTITY.node().is_empty());
    }

    #[test]
    fn what_is_written_is_what_was_meant() {
        let rotation = rotation(DQuat::from_xyzw(0.1, 0.2, 0.3, 0.4));
        let exact = Similarity { scale: 1.1, mirror: false, rotation, translation: DVec3::new(1.0, 2.0, 3.0) };
        let far = DVec3::new(1000.0, -2000.0, 500.0);
        let read = exact.as_read(far, exact.point(far));
        assert!((read.point(far) - exact.point(far)).length() < 2e-4);
        let written: Vec<f32> =
            read.node()["rotation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect();
        assert_eq!(written.iter().map(|&v| f64::from(v)).collect::<Vec<_>>(), read.rotation.to_array());
    }
}
