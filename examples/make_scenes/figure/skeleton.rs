//! The fox's joints, where they rest, and the shapes that hang on them. Metres; the fox looks along +z, its left is +x.

use crate::field::{ellipsoid, limb};
use glam::DVec3;

/// A joint; the order is the order in the skin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Joint {
    Root,
    Hips,
    Spine,
    Chest,
    Neck,
    Head,
    EarLeft,
    EarRight,
    ArmLeft,
    ForearmLeft,
    HandLeft,
    ArmRight,
    ForearmRight,
    HandRight,
    ThighLeft,
    ShinLeft,
    FootLeft,
    ThighRight,
    ShinRight,
    FootRight,
    Tail1,
    Tail2,
    Tail3,
    Tail4,
    Scarf1,
    Scarf2,
}

use Joint::{
    ArmLeft, ArmRight, Chest, EarLeft, EarRight, FootLeft, FootRight, ForearmLeft, ForearmRight, HandLeft, HandRight,
    Head, Hips, Neck, Root, Scarf1, Scarf2, ShinLeft, ShinRight, Spine, Tail1, Tail2, Tail3, Tail4, ThighLeft,
    ThighRight,
};

/// Every joint with its name, its parent and its place at rest; parents come first. Rest rotations are identities.
pub const JOINTS: [(Joint, &str, Option<Joint>, [f64; 3]); 26] = [
    (Root, "root", None, [0.0, 0.0, 0.0]),
    (Hips, "hips", Some(Root), [0.0, 0.34, 0.0]),
    (Spine, "spine", Some(Hips), [0.0, 0.44, 0.0]),
    (Chest, "chest", Some(Spine), [0.0, 0.54, 0.0]),
    (Neck, "neck", Some(Chest), [0.0, 0.63, 0.0]),
    (Head, "head", Some(Neck), [0.0, 0.70, 0.0]),
    (EarLeft, "ear left", Some(Head), [0.125, 0.97, 0.0]),
    (EarRight, "ear right", Some(Head), [-0.125, 0.97, 0.0]),
    (ArmLeft, "arm left", Some(Chest), [0.125, 0.57, 0.0]),
    (ForearmLeft, "forearm left", Some(ArmLeft), [0.235, 0.46, 0.005]),
    (HandLeft, "hand left", Some(ForearmLeft), [0.33, 0.365, 0.03]),
    (ArmRight, "arm right", Some(Chest), [-0.125, 0.57, 0.0]),
    (ForearmRight, "forearm right", Some(ArmRight), [-0.235, 0.46, 0.005]),
    (HandRight, "hand right", Some(ForearmRight), [-0.33, 0.365, 0.03]),
    (ThighLeft, "thigh left", Some(Hips), [0.088, 0.29, 0.0]),
    (ShinLeft, "shin left", Some(ThighLeft), [0.1, 0.17, 0.012]),
    (FootLeft, "foot left", Some(ShinLeft), [0.102, 0.065, 0.0]),
    (ThighRight, "thigh right", Some(Hips), [-0.088, 0.29, 0.0]),
    (ShinRight, "shin right", Some(ThighRight), [-0.1, 0.17, 0.012]),
    (FootRight, "foot right", Some(ShinRight), [-0.102, 0.065, 0.0]),
    (Tail1, "tail 1", Some(Hips), [0.0, 0.31, -0.12]),
    (Tail2, "tail 2", Some(Tail1), [0.03, 0.27, -0.28]),
    (Tail3, "tail 3", Some(Tail2), [0.08, 0.36, -0.43]),
    (Tail4, "tail 4", Some(Tail3), [0.11, 0.54, -0.5]),
    (Scarf1, "scarf 1", Some(Chest), [0.075, 0.63, 0.125]),
    (Scarf2, "scarf 2", Some(Scarf1), [0.09, 0.53, 0.165]),
];

/// Where a joint rests.
pub fn rest(joint: Joint) -> DVec3 {
    DVec3::from_array(JOINTS[joint as usize].3)
}

/// One piece of the body.
#[derive(Clone, Copy)]
pub enum Shape {
    /// Middle and radii.
    Egg([f64; 3], [f64; 3]),
    /// Both ends and their radii.
    Limb([[f64; 3]; 2], [f64; 2]),
    /// A limb flattened along z by the factor given.
    Blade([[f64; 3]; 2], [f64; 2], f64),
}

impl Shape {
    /// Distance to its surface, negative inside.
    pub fn distance(self, p: DVec3) -> f64 {
        match self {
            Self::Egg(middle, radii) => ellipsoid(p, DVec3::from_array(middle), DVec3::from_array(radii)),
            Self::Limb(ends, radii) => limb(p, ends.map(DVec3::from_array), radii),
            Self::Blade(ends, radii, flat) => {
                let squash = DVec3::new(1.0, 1.0, flat);
                let [a, b] = ends.map(|e| DVec3::from_array(e) * squash);
                limb(p * squash, [a, b], radii) / flat.sqrt()
            }
        }
    }

    /// On the other side.
    fn mirrored(self) -> Self {
        let m = |[x, y, z]: [f64; 3]| [-x, y, z];
        match self {
            Self::Egg(middle, radii) => Self::Egg(m(middle), radii),
            Self::Limb([a, b], radii) => Self::Limb([m(a), m(b)], radii),
            Self::Blade([a, b], radii, flat) => Self::Blade([m(a), m(b)], radii, flat),
        }
    }
}

/// Shapes of the left side and their joints; the right side mirrors them.
#[expect(clippy::approx_constant, reason = "a place on the body, not a part of a circle")]
const LEFT: [(Joint, Joint, Shape); 18] = [
    (EarLeft, EarRight, Shape::Blade([[0.12, 0.95, 0.0], [0.2, 1.185, -0.012]], [0.092, 0.01], 1.7)),
    (ArmLeft, ArmRight, Shape::Limb([[0.11, 0.565, 0.0], [0.235, 0.46, 0.005]], [0.056, 0.045])),
    (ForearmLeft, ForearmRight, Shape::Limb([[0.235, 0.46, 0.005], [0.325, 0.37, 0.028]], [0.045, 0.04])),
    (HandLeft, HandRight, Shape::Egg([0.35, 0.342, 0.036], [0.05, 0.05, 0.042])),
    (HandLeft, HandRight, Shape::Limb([[0.345, 0.34, 0.06], [0.352, 0.318, 0.086]], [0.024, 0.018])),
    (HandLeft, HandRight, Shape::Limb([[0.37, 0.33, 0.04], [0.4, 0.296, 0.05]], [0.024, 0.019])),
    (HandLeft, HandRight, Shape::Limb([[0.36, 0.32, 0.03], [0.38, 0.286, 0.035]], [0.024, 0.019])),
    (ThighLeft, ThighRight, Shape::Limb([[0.085, 0.29, 0.0], [0.1, 0.17, 0.012]], [0.095, 0.062])),
    (ShinLeft, ShinRight, Shape::Limb([[0.1, 0.17, 0.012], [0.102, 0.065, 0.0]], [0.06, 0.05])),
    (FootLeft, FootRight, Shape::Egg([0.108, 0.042, 0.05], [0.066, 0.045, 0.1])),
    (FootLeft, FootRight, Shape::Egg([0.145, 0.03, 0.115], [0.026, 0.026, 0.034])),
    (FootLeft, FootRight, Shape::Egg([0.108, 0.03, 0.132], [0.026, 0.027, 0.034])),
    (FootLeft, FootRight, Shape::Egg([0.072, 0.03, 0.118], [0.026, 0.026, 0.034])),
    (Head, Head, Shape::Egg([0.105, 0.79, 0.065], [0.12, 0.1, 0.12])),
    (Head, Head, Shape::Blade([[0.17, 0.8, 0.045], [0.305, 0.775, 0.02]], [0.06, 0.006], 1.3)),
    (Head, Head, Shape::Blade([[0.15, 0.77, 0.05], [0.27, 0.715, 0.025]], [0.06, 0.006], 1.3)),
    (Chest, Chest, Shape::Limb([[0.03, 0.55, 0.07], [0.045, 0.49, 0.135]], [0.05, 0.008])),
    (Hips, Hips, Shape::Egg([0.07, 0.32, -0.03], [0.1, 0.1, 0.1])),
];

/// Shapes on the middle plane.
const MIDDLE: [(Joint, Shape); 17] = [
    (Hips, Shape::Egg([0.0, 0.34, 0.0], [0.165, 0.13, 0.145])),
    (Spine, Shape::Egg([0.0, 0.43, 0.01], [0.158, 0.13, 0.145])),
    (Chest, Shape::Egg([0.0, 0.54, -0.005], [0.135, 0.11, 0.115])),
    (Chest, Shape::Limb([[0.0, 0.53, 0.08], [0.0, 0.455, 0.158]], [0.05, 0.006])),
    (Neck, Shape::Limb([[0.0, 0.6, 0.0], [0.0, 0.7, 0.0]], [0.09, 0.085])),
    (Head, Shape::Egg([0.0, 0.86, 0.0], [0.222, 0.185, 0.19])),
    (Head, Shape::Limb([[0.0, 0.795, 0.12], [0.0, 0.778, 0.272]], [0.096, 0.043])),
    (Head, Shape::Limb([[0.0, 1.02, 0.06], [0.02, 1.1, 0.075]], [0.035, 0.004])),
    (Head, Shape::Limb([[0.0, 1.02, 0.03], [-0.035, 1.085, 0.05]], [0.03, 0.004])),
    (Head, Shape::Limb([[0.01, 1.02, 0.03], [0.055, 1.075, 0.05]], [0.03, 0.004])),
    (Tail1, Shape::Limb([[0.0, 0.31, -0.1], [0.03, 0.27, -0.28]], [0.045, 0.075])),
    (Tail2, Shape::Limb([[0.03, 0.27, -0.28], [0.08, 0.36, -0.43]], [0.075, 0.108])),
    (Tail3, Shape::Limb([[0.08, 0.36, -0.43], [0.11, 0.54, -0.5]], [0.108, 0.112])),
    (Tail4, Shape::Limb([[0.11, 0.54, -0.5], [0.1, 0.66, -0.49]], [0.112, 0.085])),
    (Tail4, Shape::Limb([[0.1, 0.66, -0.49], [0.05, 0.82, -0.45]], [0.085, 0.008])),
    (Tail4, Shape::Limb([[0.11, 0.6, -0.5], [0.15, 0.77, -0.46]], [0.08, 0.006])),
    (Tail4, Shape::Limb([[0.1, 0.6, -0.49], [0.06, 0.74, -0.54]], [0.08, 0.006])),
];

/// Every shape of the body with the joint that moves it.
pub fn shapes() -> Vec<(Joint, Shape)> {
    let mut all = MIDDLE.to_vec();
    for (left, right, shape) in LEFT {
        all.push((left, shape));
        all.push((right, shape.mirrored()));
    }
    all
}
