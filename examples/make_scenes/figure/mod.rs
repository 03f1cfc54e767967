//! A fox with a scarf: one skinned mesh of three primitives with three morph targets, and three animations.

mod body;
mod face;
mod motion;
mod scarf;
mod skeleton;

use crate::File;
use crate::gltf::{Deform, Document, Pose};
use crate::raster::{Raster, blend, hex};
use crate::solid::{corners, lathe, profile};
use crate::surface::Surface;
use crate::turn::step;
use crate::{coats, noise};
use face::Mood;
use glam::{DMat4, DVec2, DVec3};
use motion::{CLIPS, Clip, Stance, TARGETS};
use serde_json::{Value, json};
use skeleton::{JOINTS, Joint, rest};

/// Edge of a cell of the fur's surface, in metres.
const CELL: f64 = 0.024;

/// The files of `scenes/figure/`.
pub fn files() -> Vec<File> {
    vec![File::new("figure/fox.glb", scene().glb())]
}

fn scene() -> Document {
    let mut document = Document::default();
    let joints = joints(&mut document);
    let matrices: Vec<f32> =
        JOINTS.iter().flat_map(|j| DMat4::from_translation(-rest(j.0)).as_mat4().to_cols_array()).collect();
    let matrices = document.curve("MAT4", &matrices);
    let skin = document.push(
        "skins",
        json!({ "name": "fox", "inverseBindMatrices": matrices, "joints": joints, "skeleton": joints[0] }),
    );
    let primitives = [fur(&mut document), features(&mut document), wool(&mut document)];
    let mesh = document.push(
        "meshes",
        json!({ "name": "fox", "primitives": primitives, "weights": [0.0, 0.0, 0.25], "extras": { "targetNames": TARGETS } }),
    );
    let fox = document.node("fox", &Pose::default(), json!({ "mesh": mesh, "skin": skin }));
    for clip in &CLIPS {
        animation(&mut document, clip, &joints, fox);
    }
    let stump = stump(&mut document);
    let camera = document.push(
        "cameras",
        json!({ "name": "portrait", "type": "perspective", "perspective": { "yfov": 0.6, "znear": 0.05, "zfar": 50.0 } }),
    );
    let pose = Pose {
        at: DVec3::new(0.95, 0.85, 2.25),
        turn: crate::turn::about(DVec3::Y, 22.5) * crate::turn::about(DVec3::X, -7.0),
        ..Pose::default()
    };
    let camera = document.node("portrait camera", &pose, json!({ "camera": camera }));
    document.push("scenes", json!({ "name": "fox", "nodes": [fox, joints[0], stump, camera] }));
    document
}

/// A node for each joint; returns them in the order of [`JOINTS`].
fn joints(document: &mut Document) -> Vec<usize> {
    let first = 0;
    for (joint, name, parent, _) in JOINTS {
        let at = rest(joint) - parent.map_or(DVec3::ZERO, rest);
        let children: Vec<usize> =
            JOINTS.iter().filter(|child| child.2 == Some(joint)).map(|child| first + child.0 as usize).collect();
        let what = if children.is_empty() { Value::Null } else { json!({ "children": children }) };
        document.node(name, &Pose { at, ..Pose::default() }, what);
    }
    (first..first + JOINTS.len()).collect()
}

fn fur(document: &mut Document) -> Value {
    let skin = body::fur(CELL);
    let material = document.plain("fur", DVec3::ONE, 0.0, 0.85);
    let shapes = skeleton::shapes();
    let (joints, weights) = skin.positions.iter().map(|p| body::weights(&shapes, *p)).unzip();
    let breathe = |p: DVec3, n: DVec3| {
        let belly =
            step(0.22, 0.42, p.y) * step(0.64, 0.52, p.y) * step(0.22, 0.15, p.x.abs()) * step(-0.16, -0.1, p.z);
        n * 0.011 * belly
    };
    let cheeks = |p: DVec3, _: DVec3| {
        let cheek = (p - DVec3::new(0.12 * p.x.signum(), 0.785, 0.13)).length();
        DVec3::new(0.004 * p.x.signum(), 0.012, 0.003) * step(0.11, 0.02, cheek)
    };
    let still = |_: DVec3, _: DVec3| DVec3::ZERO;
    let targets = vec![shifts(&skin, breathe), shifts(&skin, still), shifts(&skin, cheeks)];
    document.deforming_part(&skin, material, &Deform { joints, weights, targets })
}

/// A target's shifts, and those of the normals that follow from them.
fn shifts(skin: &Surface, shift: impl Fn(DVec3, DVec3) -> DVec3) -> Vec<[DVec3; 2]> {
    let moved: Vec<DVec3> = skin.positions.iter().zip(&skin.normals).map(|(p, n)| shift(*p, *n)).collect();
    let mut before = vec![DVec3::ZERO; moved.len()];
    let mut after = before.clone();
    for t in &skin.triangles {
        let rest = t.map(|i| skin.positions[i as usize]);
        let now = t.map(|i| skin.positions[i as usize] + moved[i as usize]);
        for &i in t {
            before[i as usize] += (rest[1] - rest[0]).cross(rest[2] - rest[0]);
            after[i as usize] += (now[1] - now[0]).cross(now[2] - now[0]);
        }
    }
    let turned = |i: usize| after[i].normalize_or_zero() - before[i].normalize_or_zero();
    (0..moved.len()).map(|i| [moved[i], turned(i)]).collect()
}

fn features(document: &mut Document) -> Value {
    let calm = face::face(Mood::default());
    let material = document.plain("eyes, nose and mouth", DVec3::ONE, 0.0, 0.22);
    let change = |mood: Mood| {
        let other = face::face(mood);
        (0..calm.positions.len())
            .map(|i| [other.positions[i] - calm.positions[i], other.normals[i] - calm.normals[i]])
            .collect()
    };
    let still = vec![[DVec3::ZERO; 2]; calm.positions.len()];
    let targets = vec![still, change(Mood { blink: 1.0, smile: 0.0 }), change(Mood { blink: 0.0, smile: 1.0 })];
    let (joints, weights) = calm.positions.iter().map(|_| body::rigid(Joint::Head)).unzip();
    document.deforming_part(&calm, material, &Deform { joints, weights, targets })
}

fn wool(document: &mut Document) -> Value {
    let scarf = scarf::scarf();
    let textures = document.coat("knit", &scarf::knit());
    let material = document.coated("scarf", textures);
    let (joints, weights) = scarf.positions.iter().map(|p| scarf::weights(*p)).unzip();
    let lifted = |p: DVec3, _: DVec3| DVec3::Z * 0.007 * step(0.05, 0.13, p.z);
    let targets = vec![
        shifts(&scarf, lifted),
        vec![[DVec3::ZERO; 2]; scarf.positions.len()],
        vec![[DVec3::ZERO; 2]; scarf.positions.len()],
    ];
    document.deforming_part(&scarf, material, &Deform { joints, weights, targets })
}

/// Samples a clip; joints that never leave their rest get no channel.
fn animation(document: &mut Document, clip: &Clip, joints: &[usize], fox: usize) {
    let stances: Vec<Stance> =
        (0..=clip.keys).map(|k| (clip.stance)((k % clip.keys) as f64 / clip.keys as f64)).collect();
    let times: Vec<f32> = (0..=clip.keys).map(|k| (clip.seconds * k as f64 / clip.keys as f64) as f32).collect();
    let input = document.curve("SCALAR", &times);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    let mut channel = |document: &mut Document, kind: &str, values: &[f32], target: Value| {
        let output = document.curve(kind, values);
        channels.push(json!({ "sampler": samplers.len(), "target": target }));
        samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
    };
    for (k, joint) in joints.iter().enumerate() {
        if stances.iter().any(|s| s.turns[k] != glam::DQuat::IDENTITY) {
            let values: Vec<f32> = stances.iter().flat_map(|s| s.turns[k].normalize().as_quat().to_array()).collect();
            channel(document, "VEC4", &values, json!({ "node": joint, "path": "rotation" }));
        }
    }
    let at = rest(Joint::Hips);
    let values: Vec<f32> = stances.iter().flat_map(|s| (at + s.hips).as_vec3().to_array()).collect();
    channel(document, "VEC3", &values, json!({ "node": joints[Joint::Hips as usize], "path": "translation" }));
    let values: Vec<f32> = stances.iter().flat_map(|s| s.morphs.map(|m| m as f32)).collect();
    channel(document, "SCALAR", &values, json!({ "node": fox, "path": "weights" }));
    document.push("animations", json!({ "name": clip.name, "channels": channels, "samplers": samplers }));
}

/// The end grain of a log; the middle of the picture is the pith.
fn year_rings() -> Raster {
    Raster::paint([256, 256], |uv| {
        let p = uv - 0.5;
        let r = p.length() * 2.0 + 0.05 * noise::tiles(uv, [3, 3], 3, 181);
        let ring = (r * 17.0) - (r * 17.0).floor();
        let crack = step(0.012, 0.0, noise::tile(uv, [5, 5], 182).abs()) * step(0.2, 0.8, r) * 0.35;
        let wood = blend(
            hex(0xdcb67c),
            hex(0xa8743f),
            ring * ring * 0.8 + 0.35 * r + 0.4 * noise::tiles(uv, [24, 24], 2, 183),
        );
        blend(wood, hex(0x50341c), crack).extend(1.0).to_array()
    })
}

/// A slice of a log for the fox to stand on: bark around, year rings on top.
fn stump(document: &mut Document) -> usize {
    let top = document.picture("year rings", year_rings().jpeg(85));
    let top = document.textured("cut wood", top, 0.8);
    let bark = document.coat("bark", &coats::wood::bark());
    let bark = document.coated("bark", bark);
    let mut disc = lathe(&corners(&[[0.43, -0.012], [0.415, 0.0], [0.2, 0.0], [0.0, 0.0]]), 64);
    for (p, uv) in disc.positions.iter().zip(&mut disc.uvs) {
        *uv = DVec2::new(p.x, p.z) / 0.88 + 0.5;
    }
    let outline = profile(
        &[[0.0, -0.16], [0.44, -0.16], [0.465, -0.145], [0.45, -0.09], [0.452, -0.04], [0.447, -0.014], [0.43, -0.012]],
        3,
    );
    let side = lathe(&outline, 64).textured(DVec2::new(5.0, 1.0), DVec2::ZERO).mapped(|p| {
        let out = DVec3::new(p.x, 0.0, p.z).normalize_or_zero();
        p + out * 0.012 * noise::space(out * 7.0, 184) * step(-0.02, -0.05, p.y) * step(0.3, 0.44, p.length())
    });
    let parts = [document.part(&disc.shaded(40.0), top), document.part(&side.shaded(60.0).with_tangents(), bark)];
    let mesh = document.push("meshes", json!({ "name": "stump", "primitives": parts }));
    document.node("stump", &Pose::default(), json!({ "mesh": mesh }))
}
