//! What a mesh is, whatever the order of its vertices and triangles, its place, turn and size.
//!
//! Corners that stand at the same place (within the tolerance) are one *place*: how vertices are split does not count,
//! only what is drawn. Each place gets a label from what no similarity changes: the attributes of its corners but for
//! positions, normals and tangents, and the labels of its neighbours. Meshes that are alike have the same labels as
//! often. Labels are sums of mixed bits: a chance collision costs time, never a wrong match, since all is verified.

use super::grid::Grid;
use crate::identify::places::{Key, places};
use crate::mesh::hash::positive_zero;
use crate::mesh::sets::Sets;
use crate::mesh::{Attribute, Primitive};
use glam::DVec3;

/// Rounds in which labels take in those of their neighbours.
const ROUNDS: usize = 3;

/// Vectors that turn with the surface: compared by their values, not by their bits.
const TURNING: [&str; 3] = ["POSITION", "NORMAL", "TANGENT"];

/// A place, seen from the middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) position: DVec3,
    pub(super) label: u64,
    /// From the middle of the shape.
    pub(super) distance: f64,
}

/// A mesh on its way to be compared.
#[derive(Debug)]
pub(super) struct Shape<'a> {
    pub(super) primitives: Vec<&'a Primitive>,
    /// Primitive and vertex of each corner, three for each triangle.
    pub(super) corners: Vec<(u32, u32)>,
    /// Place of each corner.
    pub(super) corner_places: Vec<u32>,
    pub(super) places: Vec<Place>,
    /// Places by label, then by distance from the middle.
    pub(super) order: Vec<u32>,
    /// Different positions, and the place of each.
    pub(super) spots: Vec<DVec3>,
    pub(super) spot_places: Vec<u32>,
    pub(super) grid: Grid,
    /// Mean of all corners.
    pub(super) middle: DVec3,
    /// Root mean square distance of the corners from it.
    pub(super) spread: f64,
    /// Largest distance from it.
    pub(super) radius: f64,
    /// What positions may be apart, as a fraction of the radius: the tolerance, or what they are rounded by.
    pub(super) slack: f64,
    /// The same in the mesh's units: within this distance positions are the same.
    pub(super) reach: f64,
    /// Of all labels.
    pub(super) signature: u64,
    /// Area, and mean fourth power of the distance from the middle, in units of the spread.
    pub(super) moments: [f64; 2],
}

/// What single precision does to a position of a part, where it came from and where it stands, and to the translation between
/// them, as a fraction of its greatest coordinate: four units in the last place, each axis for itself.
const ROUNDING: f64 = 4.0 / 8388608.0;

/// Parts whose rounding is more than this fraction of their radius are too coarse for telling what is alike.
const MOST_ROUNDING: f64 = 2.5e-4;

/// How far off a first guess may be, in units of [`Shape::reach`].
pub(super) const LOOSE: f64 = 32.0;

impl<'a> Shape<'a> {
    /// `None` for a mesh without extent. `tolerance` is a fraction of the radius. If it `rounds`, what single precision rounds
    /// its positions by is no difference either.
    pub(super) fn new(primitives: Vec<&'a Primitive>, tolerance: f64, rounds: bool) -> Option<Self> {
        let corners: Vec<(u32, u32)> =
            (0..).zip(&primitives).flat_map(|(i, p)| p.indices.iter().map(move |&v| (i, v))).collect();
        let position = |&(p, v): &(u32, u32)| primitives[p as usize].positions()[v as usize];
        let points: Vec<[f32; 3]> = corners.iter().map(position).collect();
        let points_exact: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
        let count = points.len() as f64;
        let middle = points_exact.iter().copied().sum::<DVec3>() / count;
        let power = |n: i32| {
            let even = |p: &DVec3| {
                if n == 2 {
                    p.distance_squared(middle)
                } else {
                    p.distance_squared(middle) * p.distance_squared(middle)
                }
            };
            points_exact.iter().map(even).sum::<f64>() / count
        };
        let spread = power(2).sqrt();
        let radius = points_exact.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let greatest = points_exact.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let rounding = if rounds { ROUNDING * greatest / radius } else { 0.0 };
        let slack = tolerance.max(rounding.min(MOST_ROUNDING));
        let reach = slack * radius;
        if !(0.0 < reach && 0.0 < spread && reach.is_finite() && spread.is_finite()) {
            return None;
        }
        let (spots, corner_spots) = spots(&points);
        let grid = Grid::new(&spots, LOOSE * reach);
        let (spot_places, first_spots) = join(&spots, &grid, reach);
        let corner_places: Vec<u32> = corner_spots.iter().map(|&s| spot_places[s as usize]).collect();
        let labels = labels(&primitives, &corners, &corner_places, first_spots.len());
        let places: Vec<Place> = std::iter::zip(&first_spots, &labels)
            .map(|(&spot, &label)| {
                let position = spots[spot as usize];
                Place { position, label, distance: position.distance(middle) }
            })
            .collect();
        let mut order: Vec<u32> = (0..places.len() as u32).collect();
        order.sort_by(|&a, &b| {
            let (p, q) = (&places[a as usize], &places[b as usize]);
            p.label.cmp(&q.label).then(p.distance.total_cmp(&q.distance)).then(a.cmp(&b))
        });
        let area: f64 = points_exact.chunks_exact(3).map(|t| 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length()).sum();
        let moments = [area / (spread * spread), power(4) / (spread * spread * spread * spread)];
        let signature = labels.iter().fold(form(&primitives), |sum, &label| sum.wrapping_add(mix(label, 17)));
        Some(Self {
            primitives,
            corners,
            corner_places,
            places,
            order,
            spots,
            spot_places,
            grid,
            middle,
            spread,
            radius,
            slack,
            reach,
            signature,
            moments,
        })
    }

    /// The place next to `point`, of those with this label (any, if `None`).
    pub(super) fn place_near(&self, point: DVec3, radius: f64, label: Option<u64>) -> Option<u32> {
        let fits =
            |spot: u32| label.is_none_or(|label| self.places[self.spot_places[spot as usize] as usize].label == label);
        self.grid.nearest(&self.spots, point, radius, fits).map(|spot| self.spot_places[spot as usize])
    }

    /// Position of a corner.
    pub(super) fn position(&self, corner: usize) -> DVec3 {
        let (p, v) = self.corners[corner];
        DVec3::from_array(self.primitives[p as usize].positions()[v as usize].map(f64::from))
    }

    /// A vector attribute at a corner, if the mesh has it.
    pub(super) fn vector(&self, corner: usize, name: &str) -> Option<DVec3> {
        let (p, v) = self.corners[corner];
        let attribute = self.primitives[p as usize].attribute(name).filter(|a| a.components >= 3)?;
        let at = v as usize * attribute.components;
        Some(DVec3::new(
            f64::from(attribute.values[at]),
            f64::from(attribute.values[at + 1]),
            f64::from(attribute.values[at + 2]),
        ))
    }
}

/// Number of triangles and kinds of attributes of each primitive: what must be equal before anything is compared.
pub(super) fn form(primitives: &[&Primitive]) -> u64 {
    let attributes = |list: &[Attribute], seed: u64| {
        list.iter().fold(seed, |sum, a| {
            let name = a.name.bytes().fold(mix(a.components as u64, 3), |sum, byte| mix(sum, u64::from(byte)));
            let format = u64::from(a.format.component.gltf()) * 2 + u64::from(a.format.normalized);
            mix(sum ^ name, format)
        })
    };
    primitives.iter().fold(primitives.len() as u64, |sum, p| {
        let own = attributes(&p.attributes, p.triangles() as u64);
        let all = p.targets.iter().fold(mix(own, p.targets.len() as u64), |sum, target| attributes(target, sum));
        mix(sum, all)
    })
}

/// Everything at a vertex that no similarity changes, down to the bits.
pub(super) fn fixed_values<'p>(primitive: &'p Primitive, vertex: u32) -> impl Iterator<Item = u32> + 'p {
    let row = move |a: &'p Attribute, from: usize| {
        let at = vertex as usize * a.components;
        a.values[at + from..at + a.components].iter().map(|v| positive_zero(*v))
    };
    // A tangent's fourth component is a sign.
    let own = primitive.attributes.iter().flat_map(move |a| {
        let from = if TURNING.contains(&a.name.as_str()) { a.components.min(3) } else { 0 };
        row(a, from)
    });
    own.chain(primitive.targets.iter().flatten().flat_map(move |a| row(a, 0)))
}

/// Different positions, and which of them each corner has.
fn spots(points: &[[f32; 3]]) -> (Vec<DVec3>, Vec<u32>) {
    let (of, keys) = places(points);
    let spot = |key: Key| DVec3::from_array(key.map(|bits| f64::from(f32::from_bits(bits))));
    (keys.into_iter().map(spot).collect(), of)
}

/// Joins spots within `reach` of each other: the place of each spot, and the first spot of each place.
fn join(spots: &[DVec3], grid: &Grid, reach: f64) -> (Vec<u32>, Vec<u32>) {
    let mut sets = Sets::new(spots.len());
    for i in 0..spots.len() as u32 {
        let here = spots[i as usize];
        for other in grid.near(here, reach).filter(|&other| other < i) {
            if spots[other as usize].distance_squared(here) <= reach * reach {
                sets.join(i as usize, other as usize);
            }
        }
    }
    let mut places = vec![0u32; spots.len()];
    let mut first = Vec::new();
    for i in 0..spots.len() as u32 {
        let root = sets.root(i as usize);
        if root == i as usize {
            places[root] = first.len() as u32;
            first.push(i);
        } else {
            places[i as usize] = places[root];
        }
    }
    (places, first)
}

fn labels(primitives: &[&Primitive], corners: &[(u32, u32)], places: &[u32], count: usize) -> Vec<u64> {
    let mut labels = vec![0u64; count];
    for (&(p, v), &place) in corners.iter().zip(places) {
        let values = fixed_values(primitives[p as usize], v);
        let hash = values.fold(mix(u64::from(p), 5), |sum, bits| mix(sum, u64::from(bits)));
        labels[place as usize] = labels[place as usize].wrapping_add(mix(hash, 7));
    }
    for _ in 0..ROUNDS {
        let mut next: Vec<u64> = labels.iter().map(|&label| mix(label, 11)).collect();
        for t in places.as_chunks::<3>().0 {
            let [a, b, c] = t.map(|place| labels[place as usize]);
            // The two neighbours in either order: a mirrored mesh has the same labels.
            for (at, other, third) in [(t[0], b, c), (t[1], c, a), (t[2], a, b)] {
                let pair = mix(other.wrapping_add(third), other ^ third);
                next[at as usize] = next[at as usize].wrapping_add(pair);
            }
        }
        labels = next;
    }
    labels
}

/// Scatters the bits of two numbers.
fn mix(a: u64, b: u64) -> u64 {
    let mut x = a ^ b.wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(31);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}
