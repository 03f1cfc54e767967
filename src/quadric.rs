//! Quadric algebra: the squared distance to planes, and to linear attribute fields, as coefficients that add up.
//!
//! Knows nothing of meshes. M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, 1997;
//! H. Hoppe, *New quadric metric for simplifying meshes with appearance attributes*, 1999 (gradient form).

use glam::Vec4;

/// `q(p) = pᵀA p + 2 b·p + c`, with `A` symmetric.
///
/// Coefficients in the order `xx xy xz yy yz zz  bx by bz  c`: one flat array, so that sums become vector additions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quadric(pub [f64; 10]);

impl Quadric {
    /// `weight · (n·p + d)²`; `n` need not be a unit vector.
    #[inline]
    pub fn plane(n: [f64; 3], d: f64, weight: f64) -> Self {
        let [x, y, z] = n;
        let (wx, wy, wz, wd) = (weight * x, weight * y, weight * z, weight * d);
        Self([wx * x, wx * y, wx * z, wy * y, wy * z, wz * z, wx * d, wy * d, wz * d, wd * d])
    }

    /// Adds `other`.
    #[inline]
    pub fn add(&mut self, other: &Self) {
        for (a, b) in self.0.iter_mut().zip(&other.0) {
            *a += b;
        }
    }

    /// Adds `weight · (g·p + d)²`, as [`Self::plane`] but in place.
    #[inline]
    pub fn add_plane(&mut self, n: [f64; 3], d: f64, weight: f64) {
        self.add(&Self::plane(n, d, weight));
    }

    /// The value at `p`. May be slightly negative where the exact value is zero.
    #[inline]
    pub fn eval(&self, p: [f64; 3]) -> f64 {
        let q = &self.0;
        let [x, y, z] = p;
        let ax = q[0] * x + q[1] * y + q[2] * z;
        let ay = q[1] * x + q[3] * y + q[4] * z;
        let az = q[2] * x + q[4] * y + q[5] * z;
        x * (ax + 2.0 * q[6]) + y * (ay + 2.0 * q[7]) + z * (az + 2.0 * q[8]) + q[9]
    }

    /// The point of least value, pulled towards `towards` by `1e-6` of the trace, which decides the directions in
    /// which the quadric is flat. `None` if it is zero everywhere.
    #[inline]
    pub fn minimum(&self, towards: [f64; 3]) -> Option<[f64; 3]> {
        let q = &self.0;
        let pull = 1e-6 * (q[0] + q[3] + q[5]);
        if pull.is_nan() || pull <= 0.0 {
            return None;
        }
        let (xx, xy, xz, yy, yz, zz) = (q[0] + pull, q[1], q[2], q[3] + pull, q[4], q[5] + pull);
        let (rx, ry, rz) = (pull * towards[0] - q[6], pull * towards[1] - q[7], pull * towards[2] - q[8]);
        // Cramer's rule on the symmetric matrix: no branches, the same operations on every machine.
        let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let determinant = xx * cx + xy * cy + xz * cz;
        let inverse = 1.0 / determinant;
        if !inverse.is_finite() {
            return None;
        }
        let (dy, dyz, dz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        Some([
            (cx * rx + cy * ry + cz * rz) * inverse,
            (cy * rx + dy * ry + dyz * rz) * inverse,
            (cz * rx + dyz * ry + dz * rz) * inverse,
        ])
    }
}

/// Rows of the inverse of the symmetric matrix `[xx, xy, xz, yy, yz, zz]`; `None` if it has none.
pub fn inverse([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Option<[[f64; 3]; 3]> {
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let by = 1.0 / (xx * cx + xy * cy + xz * cz);
    let (dy, dyz, dz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    by.is_finite().then(|| [[cx, cy, cz], [cy, dy, dyz], [cz, dyz, dz]].map(|row| scale(row, by)))
}

/// A quadric around a place of its own, its origin: `q(x) = xᵀA x + 2 b·x + c` for the offset `x` from there.
///
/// Near its origin nothing large cancels, so single precision is enough, and sums are a few vector additions. Row `i` is
/// `(A_i0, A_i1, A_i2, b_i)`. Only component-wise operations: the same bits with and without vector registers.
///
/// A cache line each, in one line each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Form {
    rows: [Vec4; 3],
    constant: f32,
}

impl Form {
    /// Adds `weight · (v.xyz·x + v.w)²`.
    #[inline]
    pub fn add_linear(&mut self, v: Vec4, weight: f32) {
        let weighted = v * weight;
        self.rows[0] += v * weighted.x;
        self.rows[1] += v * weighted.y;
        self.rows[2] += v * weighted.z;
        self.constant += v.w * weighted.w;
    }

    /// Adds `weight · (s11 (u·x)² + 2 s12 (u·x)(v·x) + s22 (v·x)²)`; `u.w` and `v.w` must be 0.
    #[inline]
    pub fn add_plane_form(&mut self, u: Vec4, v: Vec4, [s11, s12, s22]: [f32; 3], weight: f32) {
        let p = u * (s11 * weight) + v * (s12 * weight);
        let q = u * (s12 * weight) + v * (s22 * weight);
        self.rows[0] += u * p.x + v * q.x;
        self.rows[1] += u * p.y + v * q.y;
        self.rows[2] += u * p.z + v * q.z;
    }

    /// The value at the origin.
    #[inline]
    pub fn constant(&self) -> f32 {
        self.constant
    }

    /// Adds `other`, which must have the same origin.
    #[inline]
    pub fn add(&mut self, other: &Self) {
        for (a, b) in self.rows.iter_mut().zip(other.rows) {
            *a += b;
        }
        self.constant += other.constant;
    }

    /// The same quadric around `origin + by`.
    #[inline]
    pub fn moved(&self, by: [f32; 3]) -> Self {
        // A by, and b·by as the fourth.
        let step = self.rows[0] * by[0] + self.rows[1] * by[1] + self.rows[2] * by[2];
        let mut out = *self;
        out.rows[0].w += step.x;
        out.rows[1].w += step.y;
        out.rows[2].w += step.z;
        out.constant += 2.0 * step.w + (step.x * by[0] + step.y * by[1] + step.z * by[2]);
        out
    }

    /// The same in double precision, around the point `origin`.
    #[inline]
    pub fn widen(&self) -> Quadric {
        let [x, y, z] = self.rows;
        Quadric([x.x, x.y, x.z, y.y, y.z, z.z, x.w, y.w, z.w, self.constant].map(f64::from))
    }
}

/// Scalar product of the first three components.
#[inline]
pub fn dot3(v: Vec4, x: [f32; 3]) -> f32 {
    v.x * x[0] + v.y * x[1] + v.z * x[2]
}

/// `a − b`
#[inline]
pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · b`
#[inline]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a × b`
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a · k`
#[inline]
pub fn scale(a: [f64; 3], k: f64) -> [f64; 3] {
    [a[0] * k, a[1] * k, a[2] * k]
}

/// `a + (b − a) t`
#[inline]
pub fn lerp(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

/// Squared distance from `p` to a triangle, and the shares of its corners at the nearest point (C. Ericson, *Real-Time
/// Collision Detection*, 2005, section 5.1.5).
#[inline]
pub fn nearest_on_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> (f64, [f64; 3]) {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let weights = shares(p, [a, b, c], ab, ac, ap);
    let at = [0, 1, 2].map(|i| a[i] * weights[0] + b[i] * weights[1] + c[i] * weights[2]);
    let off = sub(p, at);
    (dot(off, off), weights)
}

#[inline]
fn shares(p: [f64; 3], [_, b, c]: [[f64; 3]; 3], ab: [f64; 3], ac: [f64; 3], ap: [f64; 3]) -> [f64; 3] {
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if 0.0 <= d3 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && 0.0 <= d1 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if 0.0 <= d6 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && 0.0 <= d2 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && 0.0 <= d4 - d3 && 0.0 <= d5 - d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    if sum <= 0.0 || sum.is_nan() {
        return [1.0, 0.0, 0.0];
    }
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plane_quadric_is_the_weighted_squared_distance() {
        let q = Quadric::plane([0.0, 0.0, 1.0], -2.0, 3.0);
        assert!((q.eval([5.0, -7.0, 4.0]) - 12.0).abs() < 1e-12);
        assert!(q.eval([1.0, 1.0, 2.0]).abs() < 1e-12);
    }

    #[test]
    fn three_planes_meet_in_their_minimum() {
        let mut q = Quadric::plane([1.0, 0.0, 0.0], -1.0, 1.0);
        q.add_plane([0.0, 1.0, 0.0], -2.0, 1.0);
        q.add_plane([0.0, 0.0, 1.0], -3.0, 1.0);
        let p = q.minimum([0.0; 3]).expect("regular");
        for (got, want) in p.iter().zip([1.0, 2.0, 3.0]) {
            assert!((got - want).abs() < 1e-4, "{p:?}");
        }
    }

    #[test]
    fn a_flat_direction_follows_the_pull() {
        let q = Quadric::plane([0.0, 0.0, 1.0], 0.0, 1.0);
        let p = q.minimum([4.0, 5.0, 6.0]).expect("pulled");
        assert!((p[0] - 4.0).abs() < 1e-6 && (p[1] - 5.0).abs() < 1e-6 && p[2].abs() < 1e-4, "{p:?}");
        assert!(Quadric::default().minimum([0.0; 3]).is_none());
    }

    #[test]
    fn a_form_is_its_quadric_wherever_its_origin_is() {
        let origin = [1.0f32, -2.0, 0.5];
        let mut form = Form::default();
        form.add_linear(Vec4::new(1.0, 2.0, -1.0, 0.25), 2.0);
        form.add_plane_form(Vec4::new(0.0, 1.0, 0.5, 0.0), Vec4::new(1.0, 0.0, 0.0, 0.0), [1.0, 0.5, 3.0], 0.5);
        let value = |p: [f64; 3]| {
            let x = [0, 1, 2].map(|i| p[i] - f64::from(origin[i]));
            let (u, v) = (x[1] + 0.5 * x[2], x[0]);
            let linear = x[0] + 2.0 * x[1] - x[2] + 0.25;
            2.0 * linear * linear + 0.5 * (u * u + 2.0 * 0.5 * u * v + 3.0 * v * v)
        };
        for by in [[0.0f32; 3], [0.5, 0.25, -1.0], [-3.0, 1.0, 2.0]] {
            let moved = form.moved(by).widen();
            for p in [[0.0, 0.0, 0.0], [1.5, -1.0, 2.0]] {
                let x = [0, 1, 2].map(|i| p[i] - f64::from(origin[i] + by[i]));
                assert!((moved.eval(x) - value(p)).abs() < 1e-4, "{by:?} {p:?}");
            }
        }
    }

    #[test]
    fn the_nearest_point_is_no_further_than_any_other() {
        let triangle = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [0.5, 1.5, 0.0]];
        for i in 0..343 {
            let p = [i % 7, i / 7 % 7, i / 49].map(|x| f64::from(x) * 0.6 - 1.5);
            let (squared, weights) = nearest_on_triangle(p, triangle);
            assert!(weights.iter().all(|&w| (-1e-12..=1.0 + 1e-12).contains(&w)), "{weights:?}");
            for (a, b) in (0..=20).flat_map(|a| (0..=20 - a).map(move |b| (a, b))) {
                let w = [a, b, 20 - a - b].map(|x| f64::from(x) / 20.0);
                let q = [0, 1, 2].map(|axis| (0..3).map(|corner| triangle[corner][axis] * w[corner]).sum::<f64>());
                let off = sub(p, q);
                assert!(squared <= dot(off, off) + 1e-12, "{p:?}");
            }
        }
    }
}
