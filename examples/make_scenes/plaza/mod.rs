//! A small plaza: a fountain in rings of paving, lamps with bunting, benches, trees, a colonnade, a market.
//!
//! More than 700 nodes show about thirty meshes. Most instances share a mesh; the crowns, tulips, awnings and half of
//! the paving stones are declared again with equal geometry and another material, as exporters do.

mod furniture;
mod stall;
mod stonework;
mod trees;

use crate::File;
use crate::coats::{stone, wood};
use crate::gltf::{Document, Pose, triple};
use crate::props::{barrel, boulder, crates};
use crate::random::Random;
use crate::raster::hex;
use crate::surface::{Surface, linear};
use crate::turn;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};

/// The document and the groups of nodes placed so far.
struct Plaza {
    document: Document,
    roots: Vec<usize>,
}

/// Materials that several things share.
struct Materials {
    marble: usize,
    granite: usize,
    sandstone: usize,
    iron: usize,
    oak: usize,
}

/// A node to be: where it stands and what it shows.
struct Placed {
    mesh: usize,
    pose: Pose,
}

impl Placed {
    /// On the ground at `degrees` and `radius`, its front turned `face` degrees from looking outwards.
    fn around(mesh: usize, degrees: f64, radius: f64, face: f64) -> Self {
        let at = turn::around(degrees) * radius;
        Self { mesh, pose: Pose { at, turn: turn::about(DVec3::Y, degrees + face), scale: DVec3::ONE } }
    }

    fn raised(mut self, y: f64) -> Self {
        self.pose.at.y += y;
        self
    }

    /// On the lawn, a little sunk.
    fn on_lawn(self) -> Self {
        let y = stonework::lawn(self.pose.at) - 0.02;
        self.raised(y)
    }

    fn scaled(mut self, factor: f64) -> Self {
        self.pose.scale = DVec3::splat(factor);
        self
    }
}

impl Plaza {
    fn mesh(&mut self, name: &str, parts: &[(&Surface, usize)]) -> usize {
        let primitives: Vec<Value> =
            parts.iter().map(|(surface, material)| self.document.part(surface, *material)).collect();
        self.mesh_of(name, &primitives)
    }

    /// A mesh of primitives that may already belong to another mesh: the accessors are then used twice.
    fn mesh_of(&mut self, name: &str, primitives: &[Value]) -> usize {
        self.document.push("meshes", json!({ "name": name, "primitives": primitives }))
    }

    /// Nodes named `name 1`, `name 2`, … below a node of their own.
    fn group(&mut self, name: &str, placed: impl IntoIterator<Item = Placed>) {
        let children: Vec<usize> = placed
            .into_iter()
            .enumerate()
            .map(|(k, p)| self.document.node(&format!("{name} {}", k + 1), &p.pose, json!({ "mesh": p.mesh })))
            .collect();
        let group = self.document.node(&format!("{name} group"), &Pose::default(), json!({ "children": children }));
        self.roots.push(group);
    }

    /// A plain material that multiplies the vertex colours.
    fn dyed(&mut self, name: &str, color: u32, rough: f64) -> usize {
        self.document.plain(name, hex(color), 0.0, rough)
    }
}

/// The files of `scenes/plaza/`.
pub fn files() -> Vec<File> {
    let mut plaza = Plaza { document: Document::default(), roots: Vec::new() };
    let materials = materials(&mut plaza);
    ground(&mut plaza, &materials);
    paving(&mut plaza, &materials);
    fountain(&mut plaza, &materials);
    colonnade(&mut plaza, &materials);
    lamps(&mut plaza, &materials);
    benches(&mut plaza, &materials);
    fence(&mut plaza, &materials);
    trees(&mut plaza);
    flowers(&mut plaza);
    market(&mut plaza, &materials);
    pigeons(&mut plaza);
    sun(&mut plaza);
    cameras(&mut plaza);
    let roots = plaza.roots.clone();
    plaza.document.push("scenes", json!({ "name": "plaza", "nodes": roots }));
    vec![File::new("plaza/plaza.glb", plaza.document.glb())]
}

fn materials(plaza: &mut Plaza) -> Materials {
    let document = &mut plaza.document;
    let marble = document.picture("marble", stone::marble().color.jpeg(85));
    let marble = document.textured("marble", marble, 0.45);
    let granite = document.coat("granite", &stone::granite());
    let granite = document.coated("granite", granite);
    let sandstone = document.coat("sandstone", &stone::sandstone());
    let sandstone = document.coated("sandstone", sandstone);
    let iron = document.plain("painted iron", hex(0x24403a), 0.35, 0.42);
    let oak = document.picture("weathered oak", wood::planks(wood::oak(), 91).color.jpeg(85));
    let oak = document.textured("oak", oak, 0.75);
    Materials { marble, granite, sandstone, iron, oak }
}

fn ground(plaza: &mut Plaza, materials: &Materials) {
    let earth = plaza.dyed("earth", 0xffffff, 0.98);
    let lawn = plaza.mesh("lawn", &[(&stonework::ground(), earth)]);
    let gravel = plaza.document.coat("gravel", &stone::gravel());
    let gravel = plaza.document.coated("gravel", gravel);
    let bed = plaza.mesh("gravel bed", &[(&stonework::bed(), gravel)]);
    plaza.group("ground", [Placed::around(lawn, 0.0, 0.0, 0.0), Placed::around(bed, 0.0, 0.0, 0.0).raised(0.012)]);
    let kerb = plaza.mesh("kerb stone", &[(&stonework::kerb(), materials.granite)]);
    let kerbs = (0..60).map(|k| 3.0 + 6.0 * f64::from(k)).filter(|a| (a + 8.0) % 90.0 > 16.0);
    let kerbs = kerbs.map(|a| Placed::around(kerb, a, stonework::PAVED, 0.0));
    plaza.group("kerb", kerbs);
}

/// Rings of stones of three cuts and two materials; rays of sandstone lead to the paths.
fn paving(plaza: &mut Plaza, materials: &Materials) {
    let cuts: Vec<Surface> = (0..3).map(|seed| stonework::paving(201 + seed)).collect();
    let mut meshes = Vec::new();
    for (stone, material) in [("granite", materials.granite), ("sandstone", materials.sandstone)] {
        for (k, cut) in cuts.iter().enumerate() {
            meshes.push(plaza.mesh(&format!("{stone} paving {}", k + 1), &[(cut, material)]));
        }
    }
    let mut random = Random::new(51);
    let mut stones = Vec::new();
    for ring in 0..11 {
        let radius = 2.92 + 0.625 * f64::from(ring);
        let count = (std::f64::consts::TAU * radius / 0.915).floor();
        for k in 0..count as u32 {
            let degrees = (f64::from(k) + 0.5 * f64::from(ring % 2)) * 360.0 / count;
            let to_ray = (degrees + 22.5).rem_euclid(45.0) - 22.5;
            let reach = 26.0 - 2.4 * f64::from(ring);
            let star = to_ray.abs() < reach * 0.5 && ring < 8;
            let warm = star || ring == 10 || (ring == 9 && k % 2 == 0);
            let mesh = meshes[random.pick(3) + if warm { 3 } else { 0 }];
            let back = if random.unit() < 0.5 { 0.0 } else { 180.0 };
            stones.push(Placed::around(mesh, degrees, radius, back).raised(0.02 + random.range(-0.006, 0.006)));
        }
    }
    plaza.group("paving", stones);
}

fn fountain(plaza: &mut Plaza, materials: &Materials) {
    let basin = plaza.mesh("fountain", &[(&stonework::fountain(), materials.marble)]);
    let water = plaza.document.push(
        "materials",
        json!({ "name": "water", "alphaMode": "BLEND", "pbrMetallicRoughness": {
            "baseColorFactor": [0.18, 0.5, 0.62, 0.62], "metallicFactor": 0.0, "roughnessFactor": 0.06 } }),
    );
    let water = plaza.mesh("water", &[(&stonework::water(), water)]);
    let here = |mesh| Placed::around(mesh, 0.0, 0.0, 0.0).raised(0.02);
    plaza.group("fountain", [here(basin), here(water)]);
}

fn colonnade(plaza: &mut Plaza, materials: &Materials) {
    const RADIUS: f64 = 13.6;
    let column = plaza.mesh("column", &[(&stonework::column(), materials.marble)]);
    let beam = plaza.mesh("beam", &[(&stonework::beam(RADIUS, 9.0), materials.marble)]);
    let angle = |k: i32| 180.0 + 9.0 * (f64::from(k) - 5.0);
    let columns = (0..11).map(|k| Placed::around(column, angle(k), RADIUS, 0.0));
    plaza.group("column", columns);
    let beams = (0..10).map(|k| Placed::around(beam, angle(k) + 4.5, RADIUS, 0.0));
    plaza.group("beam", beams);
}

fn lamps(plaza: &mut Plaza, materials: &Materials) {
    let glass = plaza.dyed("lamp glass", 0xffe9bd, 0.3);
    plaza.document.material(glass)["emissiveFactor"] = json!([1.0, 0.78, 0.42]);
    let lamp = plaza.mesh("lamp", &[(&furniture::lamp_post(), materials.iron), (&furniture::lamp_glass(), glass)]);
    let corners = (0..8).map(|k| 22.5 + 45.0 * f64::from(k));
    plaza.group("lamp", corners.clone().map(|a| Placed::around(lamp, a, 9.0, 0.0).raised(0.08)));
    let light = json!({ "extensions": { "KHR_lights_punctual": { "light": 1 } } });
    let lights: Vec<usize> = corners
        .clone()
        .enumerate()
        .map(|(k, a)| {
            let pose = Pose { at: turn::around(a) * 9.0 + DVec3::Y * 3.1, ..Pose::default() };
            plaza.document.node(&format!("lamp light {}", k + 1), &pose, light.clone())
        })
        .collect();
    let lights = plaza.document.node("lamp lights", &Pose::default(), json!({ "children": lights }));
    plaza.roots.push(lights);
    let cloth = plaza.dyed("bunting", 0xffffff, 0.85);
    let bunting = plaza.mesh("bunting", &[(&furniture::bunting(), cloth)]);
    let middle = 9.0 * turn::cos(22.5);
    plaza.group("bunting", corners.map(|a| Placed::around(bunting, a + 22.5, middle, 0.0).raised(0.08)));
}

fn benches(plaza: &mut Plaza, materials: &Materials) {
    let bench =
        plaza.mesh("bench", &[(&furniture::bench_slats(), materials.oak), (&furniture::bench_ends(), materials.iron)]);
    let places = (0..4).flat_map(|k| [33.0, 57.0].map(|a| a + 90.0 * f64::from(k)));
    plaza.group("bench", places.map(|a| Placed::around(bench, a, 8.35, 180.0).raised(0.085)));
    let urn = plaza.mesh("urn", &[(&stonework::urn(), materials.marble)]);
    let box_green = plaza.dyed("box", 0x5f8f3c, 0.9);
    let bush = plaza.mesh("bush", &[(&trees::bush(), box_green)]);
    let places: Vec<f64> = (0..4).flat_map(|k| [18.0, 45.0, 72.0].map(|a| a + 90.0 * f64::from(k))).collect();
    plaza.group("urn", places.iter().map(|a| Placed::around(urn, *a, 8.4, 0.0).raised(0.085)));
    let mut bushes: Vec<Placed> = places.iter().map(|a| Placed::around(bush, *a, 8.4, 3.0 * a).raised(0.685)).collect();
    // The same bush stands in groups on the lawn.
    let lawn = [
        (20.0, 12.6),
        (25.0, 13.1),
        (23.0, 13.9),
        (38.0, 14.2),
        (50.0, 13.4),
        (46.0, 14.3),
        (76.0, 12.2),
        (104.0, 11.9),
        (256.0, 11.8),
        (284.0, 12.2),
        (300.0, 13.9),
        (325.0, 13.0),
        (347.0, 14.4),
    ];
    bushes.extend(
        lawn.iter()
            .enumerate()
            .map(|(k, (a, r))| Placed::around(bush, *a, *r, 77.0 * a).on_lawn().scaled([1.5, 1.05, 1.25][k % 3])),
    );
    plaza.group("bush", bushes);
}

/// Bollards and chains along the lawn, open where the paths come in.
fn fence(plaza: &mut Plaza, materials: &Materials) {
    const RADIUS: f64 = 10.05;
    const STEP: f64 = 10.5;
    let bollard = plaza.mesh("bollard", &[(&furniture::bollard(), materials.iron)]);
    let chain = plaza.mesh("chain", &[(&furniture::chain(2.0 * RADIUS * turn::sin(STEP / 2.0)), materials.iron)]);
    let starts = (0..4).map(|k| 45.0 + 90.0 * f64::from(k) - 3.0 * STEP);
    let posts = starts.clone().flat_map(|s| (0..7).map(move |k| s + STEP * f64::from(k)));
    plaza.group("bollard", posts.map(|a| Placed::around(bollard, a, RADIUS, 0.0)));
    let spans = starts.flat_map(|s| (0..6).map(move |k| s + STEP * (f64::from(k) + 0.5)));
    let middle = RADIUS * turn::cos(STEP / 2.0);
    plaza.group("chain", spans.map(|a| Placed::around(chain, a, middle, 0.0)));
}

fn trees(plaza: &mut Plaza) {
    let bark = plaza.document.coat("bark", &wood::bark());
    let bark = plaza.document.coated("bark", bark);
    let (trunk, crown) = (plaza.document.part(&trees::trunk(), bark), trees::crown());
    let kinds: Vec<usize> = [("lime tree", 0x86ad48), ("maple tree", 0xe08a35), ("plum tree", 0xc2566a)]
        .into_iter()
        .map(|(name, color)| {
            let leaves = plaza.dyed(&format!("{name} leaves"), color, 0.9);
            let crown = plaza.document.part(&crown, leaves);
            plaza.mesh_of(name, &[trunk.clone(), crown])
        })
        .collect();
    let mut random = Random::new(53);
    let mut placed = Vec::new();
    for (k, degrees) in [66.0, 106.0, 118.0, 244.0, 254.0, 288.0, 312.0, 337.0].into_iter().enumerate() {
        let tree = Placed::around(
            kinds[[1, 2, 0, 0, 2, 0, 1, 0][k]],
            degrees,
            random.range(12.6, 13.4),
            random.range(0.0, 360.0),
        );
        placed.push(tree.on_lawn().scaled(random.range(0.95, 1.2)));
    }
    plaza.group("tree", placed);
    let green = plaza.dyed("cypress", 0x54793f, 0.95);
    let cypress = plaza.mesh("cypress", &[(&trees::cypress(), green)]);
    let row = (0..13).map(|k| {
        let degrees = 180.0 + 9.0 * (f64::from(k) - 6.0);
        let tree = Placed::around(cypress, degrees, 16.0, random.range(0.0, 360.0)).on_lawn();
        tree.scaled(random.range(0.9, 1.2))
    });
    plaza.group("cypress", row);
}

fn flowers(plaza: &mut Plaza) {
    let green = plaza.dyed("tulip stems", 0xffffff, 0.8);
    let (stems, petals) = (plaza.document.part(&trees::stems(), green), trees::petals());
    let kinds: Vec<usize> = [("red", 0xd6322f), ("yellow", 0xf4bd2c), ("white", 0xf7efe6), ("violet", 0x8e4b9e)]
        .into_iter()
        .map(|(name, color)| {
            let flower = plaza.dyed(&format!("{name} petals"), color, 0.6);
            let petals = plaza.document.part(&petals, flower);
            plaza.mesh_of(&format!("{name} tulips"), &[stems.clone(), petals])
        })
        .collect();
    let mut random = Random::new(57);
    let mut clumps = Vec::new();
    for quarter in 0..4 {
        for k in 0..22 {
            let (row, place) = (k % 2, k / 2);
            let degrees = 45.0 + 90.0 * f64::from(quarter) + (f64::from(place) - 5.0 + 0.5 * f64::from(row)) * 4.6;
            let radius = 10.65 + 0.5 * f64::from(row) + random.range(-0.08, 0.08);
            let kind = kinds[(quarter as usize + place as usize / 3 + row as usize) % 4];
            clumps.push(
                Placed::around(kind, degrees, radius, random.range(0.0, 360.0))
                    .on_lawn()
                    .scaled(random.range(0.95, 1.25)),
            );
        }
    }
    plaza.group("tulips", clumps);
    let rock = boulder::rock(5, 4);
    let stone = plaza.document.plain("rock", DVec3::ONE, 0.0, 0.9);
    let stone = plaza.mesh("rock", &[(&rock, stone)]);
    let spots = [
        (30.0, 14.6, 0.7),
        (34.0, 15.3, 0.4),
        (58.0, 15.0, 0.5),
        (100.0, 14.8, 0.8),
        (105.0, 15.5, 0.45),
        (256.0, 15.0, 0.7),
        (300.0, 15.2, 0.55),
        (330.0, 14.9, 0.75),
        (326.0, 15.6, 0.4),
    ];
    let rocks = spots.iter().map(|(a, r, s)| Placed::around(stone, *a, *r, a * 7.0).on_lawn().scaled(*s));
    plaza.group("rock", rocks);
}

/// Two stalls at the front, with crates of apples and barrels.
fn market(plaza: &mut Plaza, materials: &Materials) {
    let (frame, awning) = (plaza.document.part(&stall::frame(), materials.oak), stall::awning());
    let mut stalls = Vec::new();
    for (name, dye) in [("red", 0xc23b33), ("blue", 0x3a6ea5)] {
        let cloth = plaza.document.picture(&format!("{name} stripes"), stall::stripes(dye).jpeg(85));
        let cloth = plaza.document.textured(&format!("{name} cloth"), cloth, 0.9);
        let awning = plaza.document.part(&awning, cloth);
        stalls.push(plaza.mesh_of(&format!("{name} stall"), &[frame.clone(), awning]));
    }
    let crates = crates::parts(&mut plaza.document);
    let crates = plaza.document.push("meshes", json!({ "name": "crate", "primitives": crates }));
    let barrel = barrel::parts(&mut plaza.document);
    let barrel = plaza.document.push("meshes", json!({ "name": "barrel", "primitives": barrel }));
    let apple = crates::apple_mesh(&mut plaza.document);
    let mut goods = Vec::new();
    for (stall, degrees) in [(stalls[0], 292.0), (stalls[1], 90.0 - 22.0)] {
        let base = Placed::around(stall, degrees, 6.1, 180.0).raised(0.085);
        let on = |mesh: usize, at: DVec3, yaw: f64| {
            let turn = base.pose.turn * turn::about(DVec3::Y, yaw);
            Placed { mesh, pose: Pose { at: base.pose.at + base.pose.turn * at, turn, scale: DVec3::ONE } }
        };
        for (x, z, y, yaw) in
            [(-0.62, 0.12, 0.865, 8.0), (0.05, 0.1, 0.865, -5.0), (0.7, 0.14, 0.865, 4.0), (-1.45, 0.5, 0.0, 25.0)]
        {
            let crate_ = on(crates, DVec3::new(x, y, z), yaw);
            for pose in crates::apples().into_iter().skip(10).step_by(2) {
                let at = crate_.pose.at + crate_.pose.turn * pose.at;
                goods.push(Placed { mesh: apple, pose: Pose { at, turn: crate_.pose.turn * pose.turn, ..pose } });
            }
            goods.push(crate_);
        }
        goods.push(on(barrel, DVec3::new(1.55, 0.0, 0.2), 30.0));
        goods.push(on(barrel, DVec3::new(1.6, 0.0, -0.65), 100.0));
        goods.push(base);
    }
    plaza.group("market", goods);
}

fn pigeons(plaza: &mut Plaza) {
    let coat = plaza.dyed("pigeon", 0xffffff, 0.7);
    let pigeon = plaza.mesh("pigeon", &[(&stall::pigeon(), coat)]);
    let mut random = Random::new(59);
    let mut birds: Vec<Placed> = (0..15)
        .map(|_| {
            let (degrees, radius) = (random.range(-28.0, 34.0), random.range(3.6, 6.8));
            Placed::around(pigeon, degrees, radius, random.range(0.0, 360.0))
                .raised(0.1)
                .scaled(random.range(1.15, 1.35))
        })
        .collect();
    for (degrees, radius, height) in [(14.0, 2.3, 0.645), (200.0, 2.3, 0.645), (340.0, 2.28, 0.645), (60.0, 1.15, 1.56)]
    {
        birds.push(Placed::around(pigeon, degrees, radius, random.range(0.0, 360.0)).raised(height).scaled(1.25));
    }
    plaza.group("pigeon", birds);
}

fn sun(plaza: &mut Plaza) {
    let color = |rgb: u32| triple(linear(hex(rgb).to_array()));
    plaza.document.extension(
        "KHR_lights_punctual",
        json!({ "lights": [
            { "name": "sun", "type": "directional", "color": color(0xffe3bd), "intensity": 3.4 },
            { "name": "lamp", "type": "point", "color": color(0xffc87a), "intensity": 6.0, "range": 7.0 },
        ] }),
    );
    let turn = turn::about(DVec3::Y, -58.0) * turn::about(DVec3::X, -42.0);
    let pose = Pose { at: DVec3::new(-8.0, 12.0, 6.0), turn, scale: DVec3::ONE };
    let sun = plaza.document.node("sun", &pose, json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    plaza.roots.push(sun);
}

/// A camera looks along its own -z.
fn looking(from: DVec3, to: DVec3) -> DQuat {
    let way = (to - from).normalize();
    let yaw = libm::atan2(-way.x, -way.z).to_degrees();
    let pitch = libm::asin(way.y).to_degrees();
    turn::about(DVec3::Y, yaw) * turn::about(DVec3::X, pitch)
}

fn cameras(plaza: &mut Plaza) {
    let views = [
        ("overview", [13.0, 12.5, 25.0], [0.0, 0.4, -0.8], 38.0),
        ("arrival", [1.2, 2.6, 14.5], [0.0, 1.7, 0.0], 55.0),
        ("market", [3.4, 1.7, 6.6], [-2.2, 1.35, -2.0], 58.0),
        ("above", [0.0, 48.0, 0.02], [0.0, 0.0, 0.0], 45.0),
    ];
    for (name, from, to, height) in views {
        let (from, to) = (DVec3::from_array(from), DVec3::from_array(to));
        let camera = json!({ "name": name, "type": "perspective", "perspective": {
            "yfov": (height * std::f64::consts::PI / 180.0 * 1e6).round() / 1e6, "znear": 0.1, "zfar": 200.0 } });
        let camera = plaza.document.push("cameras", camera);
        let pose = Pose { at: from, turn: looking(from, to), scale: DVec3::ONE };
        let node = plaza.document.node(&format!("{name} camera"), &pose, json!({ "camera": camera }));
        plaza.roots.push(node);
    }
}
