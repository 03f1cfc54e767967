//! Which triangle is seen in which pixel: snapped to 1/256 pixel, integer edge functions, no pixel twice or missed
//! along shared edges.
//!
//! Knows geometry and, through a question to its caller, holes; shading comes after, once for each pixel.

use super::drawable::Part;
use glam::{DMat4, Vec2};

/// Positions on the screen are multiples of 1/256 pixel.
pub(super) const STEPS: i32 = 256;

/// Farther out than this (in steps) a corner cannot be computed with; its triangle is left out. The largest picture
/// is a quarter of it wide.
const FARTHEST: f64 = (1 << 22) as f64;

/// Largest side of a picture, in pixels.
pub const LARGEST_SIZE: u32 = 4096;

/// Bits of a depth that count. Surfaces that are closer together than one part in 131,072 of their distance touch, and
/// the first one drawn is seen: rounding in the last bits would mix them at random.
pub(super) const TOUCHING: u32 = !0x3F;

/// A vertex on the screen.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Steps from the left.
    x: i32,
    /// Steps from the bottom.
    y: i32,
    /// One over the distance in front of the camera; 0 if the vertex cannot be shown.
    near: f32,
}

/// A triangle that may be seen, ready for drawing. Corners run counter-clockwise on the screen.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    at: [[i32; 2]; 3],
    near: [f32; 3],
    /// One over twice the area in square steps.
    inverse_area: f32,
    /// Index in the drawable's instances.
    pub instance: u32,
    /// Number of the triangle in its part.
    pub triangle: u32,
    /// The vertices of the part, in the order of `at`.
    pub corners: [u32; 3],
    /// Seen from behind.
    pub back: bool,
}

/// Where in a triangle a pixel's centre lies, and how that changes from pixel to pixel.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// Shares of the corners at the pixel's centre, corrected for perspective; their sum is 1.
    pub at: [f32; 3],
    /// Change for one pixel to the right.
    pub dx: [f32; 3],
    /// Change for one pixel up.
    pub dy: [f32; 3],
}

impl Weights {
    /// The change of a pair of numbers to the right and up, given at the corners.
    #[inline]
    pub fn slope(&self, values: [Vec2; 3]) -> (Vec2, Vec2) {
        let sum = |w: [f32; 3]| values[0] * w[0] + values[1] * w[1] + values[2] * w[2];
        (sum(self.dx), sum(self.dy))
    }
}

/// Puts the vertices of a part on the screen. `clip` maps its object space to clip space.
pub fn project(part: &Part, clip: &DMat4, size: u32, out: &mut Vec<Corner>) {
    let half = f64::from(size) * 0.5 * f64::from(STEPS);
    out.clear();
    out.extend(part.positions.iter().map(|p| {
        let p = *clip * p.as_dvec3().extend(1.0);
        let near = 1.0 / p.w;
        let (x, y) = ((p.x * near + 1.0) * half, (p.y * near + 1.0) * half);
        // Also false for numbers that are not finite.
        let shown = p.w > 0.0 && near as f32 > 0.0 && x.abs() < FARTHEST && y.abs() < FARTHEST;
        if !(shown && (near as f32).is_finite()) {
            return Corner { x: 0, y: 0, near: 0.0 };
        }
        Corner { x: (x + 0.5).floor() as i32, y: (y + 0.5).floor() as i32, near: near as f32 }
    }));
}

/// Edge function from `a` to `b` at `p`: twice the area of the triangle, positive if `p` lies to the left.
#[inline]
fn edge(a: [i32; 2], b: [i32; 2], p: [i32; 2]) -> i64 {
    i64::from(b[0] - a[0]) * i64::from(p[1] - a[1]) - i64::from(b[1] - a[1]) * i64::from(p[0] - a[0])
}

/// Centres of pixels within a range of steps: first and last, empty if first > last.
#[inline]
fn covered(low: i32, high: i32, size: u32) -> (i32, i32) {
    let first = (low + STEPS / 2 - 1).div_euclid(STEPS);
    let last = (high - STEPS / 2).div_euclid(STEPS);
    (first.max(0), last.min(size as i32 - 1))
}

/// Which faces of a part are drawn.
#[derive(Clone, Copy, Debug)]
pub struct Facing {
    /// The transform mirrors: counter-clockwise faces are clockwise on the screen.
    pub mirrored: bool,
    /// Faces seen from behind are drawn as well.
    pub double_sided: bool,
}

/// The nearest triangle of each pixel.
#[derive(Debug)]
pub struct Visibility {
    size: u32,
    /// One over the distance; 0 = nothing there. Rows from the bottom.
    near: Vec<f32>,
    /// Index in `setups`.
    seen: Vec<u32>,
    setups: Vec<Setup>,
}

impl Visibility {
    /// Nothing to see yet. `size` is the side of the picture in pixels, at most [`LARGEST_SIZE`].
    pub fn new(size: u32) -> Self {
        let pixels = size as usize * size as usize;
        Self { size, near: vec![0.0; pixels], seen: vec![u32::MAX; pixels], setups: Vec::new() }
    }

    /// Draws the triangles of one instance. `passes` says for a pixel (from the left, from the bottom) whether the
    /// triangle is solid there; it is only asked where `holes`.
    pub fn draw(
        &mut self,
        instance: u32,
        part: &Part,
        corners: &[Corner],
        facing: Facing,
        holes: bool,
        passes: impl Fn(&Setup, i32, i32) -> bool,
    ) {
        for (triangle, t) in part.indices.chunks_exact(3).enumerate() {
            let [a, b, c] = [0, 1, 2].map(|i| corners[t[i] as usize]);
            if a.near == 0.0 || b.near == 0.0 || c.near == 0.0 {
                continue;
            }
            // Most triangles of a fine mesh lie between the centres of pixels.
            let columns = covered(a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x), self.size);
            let rows = covered(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), self.size);
            if columns.0 > columns.1 || rows.0 > rows.1 {
                continue;
            }
            let area = edge([a.x, a.y], [b.x, b.y], [c.x, c.y]);
            let back = (area < 0) != facing.mirrored;
            if area == 0 || (back && !facing.double_sided) {
                continue;
            }
            let (order, area) = if area > 0 { ([0, 1, 2], area) } else { ([0, 2, 1], -area) };
            let sorted = order.map(|i| [a, b, c][i]);
            let setup = Setup {
                at: sorted.map(|v| [v.x, v.y]),
                near: sorted.map(|v| v.near),
                inverse_area: 1.0 / area as f32,
                instance,
                triangle: triangle as u32,
                corners: order.map(|i| t[i]),
                back,
            };
            if self.fill(&setup, columns, rows, |x, y| !holes || passes(&setup, x, y)) {
                self.setups.push(setup);
            }
        }
    }

    /// Takes the pixels where the triangle is nearest; answers whether there were any.
    #[inline]
    fn fill(
        &mut self,
        setup: &Setup,
        columns: (i32, i32),
        rows: (i32, i32),
        passes: impl Fn(i32, i32) -> bool,
    ) -> bool {
        let number = self.setups.len() as u32;
        let [a, b, c] = setup.at;
        let sides = [(b, c), (c, a), (a, b)];
        let steps = i64::from(STEPS);
        let start = [columns.0, rows.0].map(|i| i * STEPS + STEPS / 2);
        let across = sides.map(|(p, q)| -i64::from(q[1] - p[1]) * steps);
        let upward = sides.map(|(p, q)| i64::from(q[0] - p[0]) * steps);
        // Pixels exactly on an edge belong to the triangle on one side of it: left and top edges keep theirs.
        let mut row = sides.map(|(p, q)| {
            let keeps = q[1] < p[1] || (q[1] == p[1] && q[0] < p[0]);
            edge(p, q, start) - i64::from(!keeps)
        });
        let (slope_x, slope_y) = setup.near_slopes();
        let least = setup.near[0].min(setup.near[1]).min(setup.near[2]);
        let most = setup.near[0].max(setup.near[1]).max(setup.near[2]);
        let mut any = false;
        for y in rows.0..=rows.1 {
            let mut e = row;
            let off_y = (y * STEPS + STEPS / 2 - a[1]) as f32 * (1.0 / STEPS as f32);
            let near_row = setup.near[0] + slope_y * off_y;
            let line = y as usize * self.size as usize;
            for x in columns.0..=columns.1 {
                if (e[0] | e[1] | e[2]) >= 0 {
                    let off_x = (x * STEPS + STEPS / 2 - a[0]) as f32 * (1.0 / STEPS as f32);
                    let near = (near_row + slope_x * off_x).clamp(least, most);
                    let near = f32::from_bits(near.to_bits() & TOUCHING);
                    let pixel = line + x as usize;
                    if near > self.near[pixel] && passes(x, y) {
                        self.near[pixel] = near;
                        self.seen[pixel] = number;
                        any = true;
                    }
                }
                e = [e[0] + across[0], e[1] + across[1], e[2] + across[2]];
            }
            row = [row[0] + upward[0], row[1] + upward[1], row[2] + upward[2]];
        }
        any
    }

    /// The triangle seen in a pixel, from the left and from the bottom.
    #[inline]
    pub fn seen(&self, x: u32, y: u32) -> Option<&Setup> {
        self.setups.get(self.seen[(y * self.size + x) as usize] as usize)
    }
}

impl Setup {
    /// Change of `near` for one pixel to the right and up.
    #[inline]
    fn near_slopes(&self) -> (f32, f32) {
        let (dx, dy) = self.slopes();
        let sum = |d: [f32; 3]| d[0] * self.near[0] + d[1] * self.near[1] + d[2] * self.near[2];
        (sum(dx), sum(dy))
    }

    /// Change of the corners' shares on the screen, for one pixel to the right and up.
    #[inline]
    fn slopes(&self) -> ([f32; 3], [f32; 3]) {
        let [a, b, c] = self.at;
        let scale = self.inverse_area * STEPS as f32;
        let sides = [(b, c), (c, a), (a, b)];
        (sides.map(|(p, q)| (p[1] - q[1]) as f32 * scale), sides.map(|(p, q)| (q[0] - p[0]) as f32 * scale))
    }

    /// Shares of the corners at a pixel, from the left and from the bottom.
    #[inline]
    pub fn weights(&self, x: i32, y: i32) -> Weights {
        let p = [x * STEPS + STEPS / 2, y * STEPS + STEPS / 2];
        let [a, b, c] = self.at;
        let flat = [edge(b, c, p), edge(c, a, p), edge(a, b, p)].map(|e| e as f32 * self.inverse_area);
        let scaled = [flat[0] * self.near[0], flat[1] * self.near[1], flat[2] * self.near[2]];
        let inverse = 1.0 / (scaled[0] + scaled[1] + scaled[2]);
        let at = scaled.map(|s| s * inverse);
        let (flat_dx, flat_dy) = self.slopes();
        let slope = |flat: [f32; 3]| {
            let scaled = [flat[0] * self.near[0], flat[1] * self.near[1], flat[2] * self.near[2]];
            let sum = scaled[0] + scaled[1] + scaled[2];
            [0, 1, 2].map(|i| (scaled[i] - at[i] * sum) * inverse)
        };
        Weights { at, dx: slope(flat_dx), dy: slope(flat_dy) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    const ONE_SIDED: Facing = Facing { mirrored: false, double_sided: false };

    /// Triangles given in pixels of a picture of 16, all at distance 1.
    fn draw(triangles: &[[[f32; 2]; 3]], facing: Facing) -> Visibility {
        let positions =
            triangles.iter().flatten().map(|p| Vec3::new(p[0] / 8.0 - 1.0, p[1] / 8.0 - 1.0, 0.0)).collect();
        let indices = (0..triangles.len() as u32 * 3).collect();
        let part = Part { positions, indices, ..Part::default() };
        let mut corners = Vec::new();
        project(&part, &DMat4::IDENTITY, 16, &mut corners);
        let mut visibility = Visibility::new(16);
        visibility.draw(0, &part, &corners, facing, false, |_, _, _| true);
        visibility
    }

    fn count(visibility: &Visibility) -> usize {
        (0..256).filter(|i| visibility.seen(i % 16, i / 16).is_some()).count()
    }

    #[test]
    fn shared_edges_are_drawn_once() {
        // Two halves of a square whose diagonal and sides go through centres of pixels.
        let square = [[[2.5, 2.5], [10.5, 2.5], [10.5, 10.5]], [[2.5, 2.5], [10.5, 10.5], [2.5, 10.5]]];
        let halves = square.map(|t| count(&draw(&[t], ONE_SIDED)));
        let both = draw(&square, ONE_SIDED);
        assert_eq!(count(&both), 64);
        assert_eq!(halves[0] + halves[1], 64);
        // Left and top edges keep their pixels.
        assert!(both.seen(2, 10).is_some() && both.seen(2, 2).is_none() && both.seen(10, 5).is_none());
    }

    #[test]
    fn back_faces_follow_the_winding() {
        let clockwise = [[[1.0, 1.0], [1.0, 9.0], [9.0, 1.0]]];
        assert_eq!(count(&draw(&clockwise, ONE_SIDED)), 0);
        let mirrored = draw(&clockwise, Facing { mirrored: true, double_sided: false });
        assert!(count(&mirrored) > 20 && !mirrored.seen(2, 2).unwrap().back);
        let double = draw(&clockwise, Facing { mirrored: false, double_sided: true });
        assert_eq!(count(&double), count(&mirrored));
        assert!(double.seen(2, 2).unwrap().back);
    }

    #[test]
    fn weights_are_those_of_perspective() {
        // A floor that goes away from the camera: w from 1 to 3.
        let part = Part {
            positions: vec![Vec3::new(-1.0, -1.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(0.0, 0.0, 3.0)],
            indices: vec![0, 1, 2],
            ..Part::default()
        };
        // w = z
        let mut clip = DMat4::IDENTITY;
        clip.z_axis.w = 1.0;
        clip.w_axis.w = 0.0;
        let mut corners = Vec::new();
        project(&part, &clip, 16, &mut corners);
        let mut visibility = Visibility::new(16);
        visibility.draw(7, &part, &corners, ONE_SIDED, false, |_, _, _| true);
        let setup = visibility.seen(8, 3).unwrap();
        let weights = setup.weights(8, 3);
        // The ray through (8.5, 3.5) of 16, direction (0.0625, -0.5625, 1), meets the floor y = (z - 3) / 2.
        let z = 1.5 / (0.5 + 0.5625);
        let hit = (0..3).map(|i| part.positions[setup.corners[i] as usize] * weights.at[i]).sum::<Vec3>();
        assert!((hit.as_dvec3() - DVec3::new(0.0625, -0.5625, 1.0) * z).length() < 1e-4, "{hit}");
        assert!((weights.at.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let tiny = 0.001f32;
        let moved = setup.weights(9, 3).at;
        // The slope at the pixel is near the difference to the next one.
        assert!((0..3).all(|i| (moved[i] - weights.at[i] - weights.dx[i]).abs() < 0.02 + tiny));
        assert_eq!(setup.instance, 7);
    }

    #[test]
    fn corners_that_cannot_be_shown_are_left_out() {
        for odd in [f32::NAN, f32::INFINITY, 1e30, -1e9] {
            let visibility =
                draw(&[[[odd, 1.0], [9.0, 1.0], [1.0, 9.0]], [[1.0, 1.0], [9.0, 1.0], [1.0, 9.0]]], ONE_SIDED);
            assert_eq!(visibility.setups.len(), 1);
        }
    }

    #[test]
    fn nearer_wins_and_the_first_of_equals_stays() {
        let t = [[1.0, 1.0], [9.0, 1.0], [1.0, 9.0]];
        assert_eq!(draw(&[t, t], ONE_SIDED).seen(2, 2).unwrap().triangle, 0);
    }
}
