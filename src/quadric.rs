//! Quadric algebra: the squared distance to planes, and to linear attribute fields, as coefficients that add up.
//!
//! Knows nothing of meshes. M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, 1997;
//! H. Hoppe, *New quadric metric for simplifying meshes with appearance attributes*, 1999 (gradient form).

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

/// Squared error of `M` linear attribute fields: `Σ_f a_f Σ_j (g_fj·p + d_fj − s_j)²`, kept so that the best values
/// `s` at any point follow in O(M).
///
/// Gradient sums are stored by axis (`gx[j]`, `gy[j]`, `gz[j]`), so that loops over `j` run over flat arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldQuadric<const M: usize> {
    /// The part that depends on the point alone: `Σ a (g·p + d)²` over faces and fields.
    pub point: Quadric,
    /// `Σ a g_x` for each field.
    pub gx: [f64; M],
    /// `Σ a g_y` for each field.
    pub gy: [f64; M],
    /// `Σ a g_z` for each field.
    pub gz: [f64; M],
    /// `Σ a d` for each field.
    pub d: [f64; M],
    /// `Σ a`: sum of the weights (areas).
    pub weight: f64,
}

impl<const M: usize> Default for FieldQuadric<M> {
    fn default() -> Self {
        Self { point: Quadric::default(), gx: [0.0; M], gy: [0.0; M], gz: [0.0; M], d: [0.0; M], weight: 0.0 }
    }
}

#[expect(clippy::needless_range_loop, reason = "one index runs over several flat arrays")]
impl<const M: usize> FieldQuadric<M> {
    /// Of one triangle: the fields take the values `s` at its corners `p` and are linear between them.
    /// `normal` is the cross product of the edges (twice the area long), `weight` the triangle's weight.
    #[inline]
    pub fn triangle(p: &[[f64; 3]; 3], s: [&[f64]; 3], normal: [f64; 3], weight: f64) -> Self {
        let mut out = Self::default();
        let squared = dot(normal, normal);
        if M == 0 || squared <= 0.0 || weight <= 0.0 {
            return out;
        }
        // Dual basis of the edges in the triangle's plane: gradient = ds1·b1 + ds2·b2.
        let inverse = 1.0 / squared;
        if !inverse.is_finite() {
            return out;
        }
        let b1 = scale(cross(sub(p[2], p[0]), normal), inverse);
        let b2 = scale(cross(normal, sub(p[1], p[0])), inverse);
        let mut sums = [0.0; 10];
        for j in 0..M {
            let (s0, d1, d2) = (s[0][j], s[1][j] - s[0][j], s[2][j] - s[0][j]);
            let x = d1 * b1[0] + d2 * b2[0];
            let y = d1 * b1[1] + d2 * b2[1];
            let z = d1 * b1[2] + d2 * b2[2];
            let d = s0 - (x * p[0][0] + y * p[0][1] + z * p[0][2]);
            out.gx[j] = weight * x;
            out.gy[j] = weight * y;
            out.gz[j] = weight * z;
            out.d[j] = weight * d;
            sums[0] += x * x;
            sums[1] += x * y;
            sums[2] += x * z;
            sums[3] += y * y;
            sums[4] += y * z;
            sums[5] += z * z;
            sums[6] += x * d;
            sums[7] += y * d;
            sums[8] += z * d;
            sums[9] += d * d;
        }
        for (q, sum) in out.point.0.iter_mut().zip(sums) {
            *q = weight * sum;
        }
        out.weight = weight;
        out
    }

    /// Adds `other`.
    #[inline]
    pub fn add(&mut self, other: &Self) {
        self.point.add(&other.point);
        for j in 0..M {
            self.gx[j] += other.gx[j];
            self.gy[j] += other.gy[j];
            self.gz[j] += other.gz[j];
            self.d[j] += other.d[j];
        }
        self.weight += other.weight;
    }

    /// Adds to `to` the quadric over the point alone that remains when every field takes its best value there
    /// (Schur complement).
    #[inline]
    pub fn reduce_into(&self, to: &mut Quadric) {
        if self.weight <= 0.0 {
            return;
        }
        let inverse = 1.0 / self.weight;
        let mut sums = [0.0; 10];
        for j in 0..M {
            let (x, y, z, d) = (self.gx[j], self.gy[j], self.gz[j], self.d[j]);
            sums[0] += x * x;
            sums[1] += x * y;
            sums[2] += x * z;
            sums[3] += y * y;
            sums[4] += y * z;
            sums[5] += z * z;
            sums[6] += x * d;
            sums[7] += y * d;
            sums[8] += z * d;
            sums[9] += d * d;
        }
        for ((q, point), sum) in to.0.iter_mut().zip(self.point.0).zip(sums) {
            *q += point - sum * inverse;
        }
    }

    /// The best field values at `p`; `None` if no face has weight.
    #[inline]
    pub fn solve(&self, p: [f64; 3]) -> Option<[f64; M]> {
        if self.weight <= 0.0 {
            return None;
        }
        let inverse = 1.0 / self.weight;
        let mut out = [0.0; M];
        for (j, s) in out.iter_mut().enumerate() {
            *s = (self.gx[j] * p[0] + self.gy[j] * p[1] + self.gz[j] * p[2] + self.d[j]) * inverse;
        }
        Some(out)
    }

    /// The error at `p` when the fields are held at `s`.
    #[inline]
    pub fn eval_fixed(&self, p: [f64; 3], s: &[f64]) -> f64 {
        let mut sum = self.point.eval(p);
        for j in 0..M {
            let at = self.gx[j] * p[0] + self.gy[j] * p[1] + self.gz[j] * p[2] + self.d[j];
            sum += s[j] * (self.weight * s[j] - 2.0 * at);
        }
        sum
    }
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
    fn a_linear_field_costs_nothing_and_is_solved_exactly() {
        // Two triangles of a unit square, field f(p) = 2x − 3y + 1: any point, right value, no error.
        let f = |p: [f64; 3]| 2.0 * p[0] - 3.0 * p[1] + 1.0;
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mut sum = FieldQuadric::<1>::default();
        for t in [[0, 1, 2], [0, 2, 3]] {
            let p = t.map(|i| square[i]);
            let s = p.map(|p| [f(p)]);
            let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
            sum.add(&FieldQuadric::triangle(&p, [&s[0], &s[1], &s[2]], n, 0.5));
        }
        let at = [0.3, 0.9, 0.0];
        assert!((sum.solve(at).expect("weight")[0] - f(at)).abs() < 1e-12);
        let mut reduced = Quadric::default();
        sum.reduce_into(&mut reduced);
        assert!(reduced.eval(at).abs() < 1e-12);
        assert!((sum.eval_fixed(at, &[f(at) + 2.0]) - 4.0).abs() < 1e-12);
    }
}
