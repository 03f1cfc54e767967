//! What the fox does: poses as functions of time, sampled into keys.

use super::skeleton::{JOINTS, Joint};
use crate::turn::{about, sin, step};
use glam::{DQuat, DVec3};

/// Names of the morph targets, in order.
pub const TARGETS: [&str; 3] = ["breathe", "blink", "smile"];

/// All joints at one time.
pub struct Stance {
    /// Rotation of each joint, in the order of [`JOINTS`].
    pub turns: [DQuat; JOINTS.len()],
    /// Shift of the hips from their rest.
    pub hips: DVec3,
    /// Weight of each morph target.
    pub morphs: [f64; 3],
}

impl Stance {
    fn rest() -> Self {
        Self { turns: [DQuat::IDENTITY; JOINTS.len()], hips: DVec3::ZERO, morphs: [0.0; 3] }
    }

    /// Turns a joint about x, then z, then y, in degrees.
    fn turn(&mut self, joint: Joint, x: f64, y: f64, z: f64) {
        self.turns[joint as usize] = about(DVec3::Y, y) * about(DVec3::Z, z) * about(DVec3::X, x);
    }

    /// Arms from the pose they were modelled in down to the body, swung by `swing` degrees.
    fn arms(&mut self, lower: f64, swing: [f64; 2], bend: f64) {
        self.turn(Joint::ArmLeft, swing[0], 0.0, -lower);
        self.turn(Joint::ArmRight, swing[1], 0.0, lower);
        self.turn(Joint::ForearmLeft, -bend, 0.0, -lower * 0.3);
        self.turn(Joint::ForearmRight, -bend, 0.0, lower * 0.3);
    }

    /// A wave that runs down the tail.
    fn tail(&mut self, phase: f64, sway: f64, lift: f64) {
        for (k, joint) in [Joint::Tail1, Joint::Tail2, Joint::Tail3, Joint::Tail4].into_iter().enumerate() {
            let late = phase - 50.0 * k as f64;
            self.turn(joint, lift * sin(late), sway * sin(late), 0.4 * sway * sin(late));
        }
    }
}

/// A loop.
pub struct Clip {
    /// For people.
    pub name: &'static str,
    /// Seconds.
    pub seconds: f64,
    /// Keys, without the closing one.
    pub keys: usize,
    /// The stance at a part of the loop, in [0, 1].
    pub stance: fn(f64) -> Stance,
}

/// Everything the fox can do.
pub const CLIPS: [Clip; 3] = [
    Clip { name: "idle", seconds: 4.0, keys: 32, stance: idle },
    Clip { name: "walk", seconds: 0.9, keys: 18, stance: walk },
    Clip { name: "wave", seconds: 3.0, keys: 36, stance: wave },
];

/// 1 around `at`, 0 beyond `half` away.
fn pulse(t: f64, at: f64, half: f64) -> f64 {
    step(half, 0.0, (t - at).abs())
}

fn idle(t: f64) -> Stance {
    let mut s = Stance::rest();
    let breath = sin(720.0 * t - 90.0);
    s.arms(24.0 + breath, [2.0 * breath, 2.0 * breath], 14.0);
    s.hips = DVec3::new(0.006 * sin(360.0 * t), -0.004 + 0.003 * breath, 0.0);
    s.turn(Joint::Spine, -breath, 2.0 * sin(360.0 * t), 0.0);
    s.turn(Joint::Chest, 1.2 * breath, 0.0, -sin(360.0 * t));
    s.turn(Joint::Head, -1.5 * breath, 9.0 * sin(360.0 * t), 4.0 * sin(360.0 * t + 30.0));
    s.turn(Joint::EarLeft, 0.0, 0.0, -10.0 * pulse(t, 0.62, 0.05));
    s.turn(Joint::EarRight, 0.0, 0.0, 8.0 * pulse(t, 0.66, 0.05));
    s.turn(Joint::Scarf1, 2.0 * breath, 0.0, 2.0 * sin(360.0 * t));
    s.turn(Joint::Scarf2, 3.0 * breath, 0.0, 3.0 * sin(360.0 * t - 40.0));
    s.tail(360.0 * t, 11.0, 3.0);
    s.morphs = [0.5 + 0.5 * breath, pulse(t, 0.3125, 0.05).max(pulse(t, 0.875, 0.05)), 0.25];
    s
}

fn walk(t: f64) -> Stance {
    let mut s = Stance::rest();
    let stride = sin(360.0 * t);
    for (side, thigh, shin, foot) in [
        (1.0, Joint::ThighLeft, Joint::ShinLeft, Joint::FootLeft),
        (-1.0, Joint::ThighRight, Joint::ShinRight, Joint::FootRight),
    ] {
        let (swing, lift) = (side * stride, (side * sin(360.0 * t + 90.0)).max(0.0));
        s.turn(thigh, -34.0 * swing - 12.0 * lift, 0.0, 0.0);
        s.turn(shin, 10.0 + 46.0 * lift, 0.0, 0.0);
        s.turn(foot, 14.0 * swing + 8.0 - 14.0 * lift, 0.0, 0.0);
    }
    s.arms(30.0, [32.0 * stride, -32.0 * stride], 30.0);
    let bounce = sin(720.0 * t + 100.0);
    s.hips = DVec3::new(0.01 * sin(360.0 * t + 90.0), 0.012 * bounce - 0.008, 0.0);
    s.turn(Joint::Hips, 0.0, 7.0 * stride, 3.0 * sin(360.0 * t + 90.0));
    s.turn(Joint::Spine, 4.0, -6.0 * stride, -2.0 * sin(360.0 * t + 90.0));
    s.turn(Joint::Chest, 2.0, -8.0 * stride, 0.0);
    s.turn(Joint::Head, -5.0 + 2.0 * bounce, 7.0 * stride, -2.0 * sin(360.0 * t + 90.0));
    s.turn(Joint::EarLeft, -6.0 * bounce, 0.0, 4.0 * bounce);
    s.turn(Joint::EarRight, -6.0 * bounce, 0.0, -4.0 * bounce);
    s.turn(Joint::Scarf1, -5.0 + 6.0 * bounce, 0.0, 5.0 * stride);
    s.turn(Joint::Scarf2, -4.0 + 9.0 * bounce, 0.0, 6.0 * sin(360.0 * t - 50.0));
    s.tail(360.0 * t, 14.0, 5.0);
    s.morphs = [0.3, 0.0, 0.5];
    s
}

fn wave(t: f64) -> Stance {
    let mut s = Stance::rest();
    let up = step(0.03, 0.2, t) * step(0.97, 0.78, t);
    let wag = sin(360.0 * 5.0 * t) * step(0.16, 0.26, t) * step(0.86, 0.74, t);
    s.arms(24.0 * (1.0 - 0.2 * up), [3.0, 3.0], 14.0);
    s.turn(Joint::ArmRight, 3.0 - 8.0 * up, -6.0 * up, 24.0 - 112.0 * up);
    s.turn(Joint::ForearmRight, -14.0 * (1.0 - up), -20.0 * up, 7.0 - 40.0 * up + 24.0 * wag);
    s.turn(Joint::HandRight, 0.0, -30.0 * up, 16.0 * wag);
    s.hips = DVec3::new(0.012 * up, -0.003 * up, 0.0);
    s.turn(Joint::Spine, 0.0, -3.0 * up, 3.0 * up + 0.8 * wag);
    s.turn(Joint::Chest, 0.0, -4.0 * up, 4.0 * up);
    s.turn(Joint::Head, -4.0 * up, -4.0 * up, -11.0 * up + 2.0 * wag);
    s.turn(Joint::EarLeft, 0.0, 0.0, 6.0 * up);
    s.turn(Joint::EarRight, 0.0, 0.0, -6.0 * up);
    s.turn(Joint::Scarf1, 2.0 * wag, 0.0, -3.0 * up + 2.0 * wag);
    s.turn(Joint::Scarf2, 2.0 * wag, 0.0, 3.0 * wag);
    s.tail(720.0 * t, 7.0 + 14.0 * up, 3.0);
    s.morphs = [0.4 * up, pulse(t, 0.5, 0.05), 0.25 + 0.75 * up];
    s
}
