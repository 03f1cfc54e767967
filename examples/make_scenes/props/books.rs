//! A stack of books with a candle: one cover mesh declared once for each colour, as exporters do, so that equal
//! geometry stands in the file several times with different materials.

use crate::coats;
use crate::gltf::{CoatTextures, Document, Pose};
use crate::noise;
use crate::raster::{Raster, blend, hex};
use crate::solid::{Ring, block, hoop, lathe, profile, tube};
use crate::surface::{Surface, linear};
use crate::turn::{self, step};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Half width (from spine to edge), half thickness, half length of a book.
const HALF: DVec3 = DVec3::new(0.085, 0.022, 0.12);

/// Two boards and a rounded spine with four raised bands.
fn cover() -> Surface {
    let board = |side: f64| {
        block(DVec3::new(HALF.x, 0.0022, HALF.z), 0.002, 1, [6, 1, 8]).moved(0.0, side * (HALF.y - 0.002), 0.0)
    };
    let (columns, rows) = (14, 44);
    let thick = 0.003;
    let bulge = |angle: f64, z: f64, inner: f64| {
        let band = [-0.09, -0.035, 0.035, 0.09].iter().map(|at| step(0.007, 0.003, (z - at).abs())).fold(0.0, f64::max);
        let r = HALF.y - inner + if inner == 0.0 { 0.0025 * band } else { 0.0 };
        DVec3::new(-HALF.x + 0.004 - r * turn::cos(angle) * 0.55, r * turn::sin(angle), z)
    };
    let side =
        |inner: f64| Surface::grid(columns, rows, |u, v| bulge(-90.0 + 180.0 * u, (v - 0.5) * 2.0 * HALF.z, inner));
    let rim = |end: f64| {
        Surface::grid(columns, 1, |u, v| {
            bulge(-90.0 + 180.0 * u, end * HALF.z, thick * if end > 0.0 { v } else { 1.0 - v })
        })
    };
    let lip = |angle: f64| {
        Surface::grid(1, rows, |u, v| {
            let outer = if angle < 0.0 { 1.0 - u } else { u };
            bulge(angle, (v - 0.5) * 2.0 * HALF.z, thick * outer)
        })
    };
    let leather = |s: Surface| s.textured(DVec2::new(0.5, 1.2), DVec2::new(0.1, 0.0));
    let spine =
        [side(0.0), side(thick).flipped(), rim(1.0), rim(-1.0), lip(-90.0), lip(90.0)].map(|s| leather(s.flipped()));
    let mut all = Surface::joined([board(1.0), board(-1.0)]).textured(DVec2::splat(5.0), DVec2::ZERO);
    all.join(&Surface::joined(spine));
    all.shaded(40.0).with_tangents()
}

/// The page block, its fore edge hollow; every page edge is a line of the texture.
fn pages() -> Surface {
    let block = block(DVec3::new(HALF.x - 0.006, HALF.y - 0.0043, HALF.z - 0.005), 0.0004, 1, [6, 6, 6]);
    let mut sheets = block.mapped(|p| {
        let t = p.y / HALF.y;
        let fore =
            if p.x > 0.0 { 0.006 * (1.0 - t * t) * (p.x / HALF.x) } else { 0.004 * (1.0 - t * t) * (p.x / HALF.x) };
        DVec3::new(p.x - fore, p.y, p.z)
    });
    for (p, uv) in sheets.positions.iter().zip(&mut sheets.uvs) {
        *uv = DVec2::new((p.x + p.z) * 3.0, p.y * 11.0);
    }
    sheets.shaded(30.0)
}

fn page_lines() -> Raster {
    Raster::paint([128, 128], |uv| {
        let line = noise::tile(uv, [2, 64], 151) + 0.5 * noise::tile(uv, [1, 32], 152);
        blend(hex(0xa98f62), hex(0xf3e6c6), 0.72 + 0.5 * line).extend(1.0).to_array()
    })
}

/// A gilt frame and an ornament on both boards, and a title field on the spine, lying on the cover.
fn gilding() -> Surface {
    let mut all = Surface::default();
    for side in [1.0, -1.0] {
        let y = side * (HALF.y + 0.0002);
        let bar = |x: f64, z: f64, w: f64, d: f64| block(DVec3::new(w, 0.0004, d), 0.0003, 1, [1; 3]).moved(x, y, z);
        let (w, d) = (HALF.x - 0.014, HALF.z - 0.014);
        all.join(&Surface::joined([
            bar(w, 0.0, 0.0012, d),
            bar(-w, 0.0, 0.0012, d),
            bar(0.0, d, w, 0.0012),
            bar(0.0, -d, w, 0.0012),
        ]));
        all.join(&hoop(0.026, [0.0012, 0.0004], 28).moved(0.0, y, 0.0));
        for k in 0..8 {
            let petal = block(DVec3::new(0.003, 0.0004, 0.0085), 0.0003, 1, [1, 1, 2])
                .mapped(|p| DVec3::new(p.x * (1.0 - (p.z / 0.0086) * (p.z / 0.0086)) + p.x * 0.15, p.y, p.z))
                .moved(0.0, 0.0, 0.0125);
            all.join(&petal.turned(turn::y(45.0 * f64::from(k))).moved(0.0, y, 0.0));
        }
    }
    all.uvs.clear();
    all.shaded(40.0)
}

fn candle() -> Surface {
    let outline = profile(
        &[
            [0.0, 0.0],
            [0.021, 0.0],
            [0.0205, 0.02],
            [0.0195, 0.07],
            [0.02, 0.106],
            [0.0175, 0.112],
            [0.012, 0.107],
            [0.0, 0.104],
        ],
        5,
    );
    let wax = lathe(&outline, 40).mapped(|p| {
        let drip =
            noise::space(DVec3::new(p.x * 90.0, p.y * 14.0, p.z * 90.0), 41).max(0.0) * 0.006 * step(0.03, 0.1, p.y);
        let out = DVec3::new(p.x, 0.0, p.z).normalize_or_zero();
        p + out * drip + DVec3::Y * 0.005 * noise::space(p * 60.0, 42) * step(0.09, 0.11, p.y)
    });
    let wick = tube(
        &[[0.0, 0.1], [0.001, 0.112], [0.003, 0.121]].map(|[x, y]| Ring::round(DVec3::new(x, y, 0.0), 0.0011)),
        DVec3::Z,
        8,
    );
    let mut all = wax.shaded(60.0).painted(|p, _| blend(hex(0xe7c98f), hex(0xfff3d8), p.y / 0.1).to_array());
    all.join(&wick.shaded(60.0).painted(|_, _| [0.08, 0.06, 0.05]));
    all.uvs.clear();
    all
}

/// A dish with a ring to hold it by.
fn holder() -> Surface {
    let dish = [
        [0.0, 0.0],
        [0.05, 0.0],
        [0.064, 0.006],
        [0.07, 0.016],
        [0.068, 0.018],
        [0.06, 0.009],
        [0.03, 0.006],
        [0.026, 0.01],
        [0.0255, 0.03],
        [0.0225, 0.031],
        [0.0215, 0.012],
        [0.0, 0.01],
    ];
    let ring = hoop(0.017, [0.0035, 0.0035], 32).turned(turn::x(90.0)).moved(0.0, 0.018, 0.083);
    let mut all = Surface::joined([lathe(&profile(&dish, 3), 48), ring]).shaded(45.0);
    all.uvs.clear();
    all
}

fn flame() -> Surface {
    let outline = profile(&[[0.0, -0.006], [0.0048, 0.0], [0.0058, 0.007], [0.0035, 0.02], [0.0, 0.034]], 6);
    let mut fire = lathe(&outline, 20).mapped(|p| DVec3::new(p.x + 6.0 * p.y * p.y.max(0.0), p.y, p.z)).shaded(180.0);
    fire.uvs.clear();
    fire
}

/// One book: a cover of its own, declared again by each call, round the primitives that all books share.
fn book(document: &mut Document, name: &str, dye: u32, leather: CoatTextures, shared: &[Value]) -> usize {
    let material = document.coated(&format!("{name} leather"), leather);
    let c = linear(hex(dye).to_array());
    document.material(material)["pbrMetallicRoughness"]["baseColorFactor"] = json!([c.x, c.y, c.z, 1.0]);
    let mut primitives = vec![document.part(&cover(), material)];
    primitives.extend_from_slice(shared);
    document.push("meshes", json!({ "name": name, "primitives": primitives }))
}

fn candle_mesh(document: &mut Document) -> usize {
    let brass = document.plain("brass", hex(0xcf9f42), 1.0, 0.25);
    let wax = document.plain("wax", DVec3::ONE, 0.0, 0.5);
    let fire = document.plain("flame", hex(0xffb13c), 0.0, 1.0);
    document.material(fire)["emissiveFactor"] = json!([1.0, 0.62, 0.2]);
    let parts = [
        document.part(&holder(), brass),
        document.part(&candle().moved(0.0, 0.011, 0.0), wax),
        document.part(&flame().moved(0.003, 0.135, 0.0), fire),
    ];
    document.push("meshes", json!({ "name": "candle", "primitives": parts }))
}

/// Four books, three of them stacked, one leaning; a candle on top.
pub fn scene() -> Document {
    let mut document = Document::default();
    let leather = document.coat("leather", &coats::leather());
    let paper = document.picture("page edges", page_lines().jpeg(85));
    let paper = document.textured("paper", paper, 0.95);
    let gilt = document.plain("gilt", hex(0xe3b64f), 1.0, 0.3);
    let shared = [document.part(&pages(), paper), document.part(&gilding(), gilt)];
    let mut nodes = Vec::new();
    let stack = [
        ("green book", 0x2f5a45, [0.0, 0.0], -8.0, [1.12, 1.15, 1.08]),
        ("red book", 0x8f2f2a, [0.006, 0.004], 9.0, [1.0, 1.0, 1.0]),
        ("blue book", 0x2c4470, [-0.008, -0.003], -19.0, [0.92, 0.8, 0.93]),
    ];
    let mut height = 0.0;
    for (name, dye, [x, z], turned, scale) in stack {
        let mesh = book(&mut document, name, dye, leather, &shared);
        let scale = DVec3::from_array(scale);
        let at = DVec3::new(x, height + HALF.y * scale.y, z);
        height += 2.0 * (HALF.y + 0.0002) * scale.y;
        let turn = turn::about(DVec3::Y, turned + 90.0);
        nodes.push(document.node(name, &Pose { at, turn, scale }, json!({ "mesh": mesh })));
    }
    let mesh = book(&mut document, "ochre book", 0xb07b33, leather, &shared);
    // Leans against the stack: stands on its fore edge corner, tilted by 62°.
    let tilt = turn::about(DVec3::Y, 22.0) * turn::about(DVec3::X, -62.0);
    let at = DVec3::new(0.06, 0.104, 0.175);
    nodes.push(document.node(
        "ochre book",
        &Pose { at, turn: tilt, scale: DVec3::splat(0.9) },
        json!({ "mesh": mesh }),
    ));
    let candle = candle_mesh(&mut document);
    let pose = Pose { at: DVec3::new(-0.01, height, -0.01), turn: turn::about(DVec3::Y, 35.0), scale: DVec3::ONE };
    nodes.push(document.node("candle", &pose, json!({ "mesh": candle })));
    document.push("scenes", json!({ "name": "books", "nodes": nodes }));
    document
}
