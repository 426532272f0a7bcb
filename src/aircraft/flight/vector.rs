//! Vectors and rotations as plain arrays.

pub(super) type Vector = [f64; 3];
/// Rows.
pub(super) type Matrix = [[f64; 3]; 3];

#[inline(always)]
pub(super) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// C v.
#[inline(always)]
pub(super) fn times(c: &Matrix, v: Vector) -> Vector {
    [dot(c[0], v), dot(c[1], v), dot(c[2], v)]
}

/// Cᵀ v.
#[inline(always)]
pub(super) fn back(c: &Matrix, v: Vector) -> Vector {
    std::array::from_fn(|i| c[0][i] * v[0] + c[1][i] * v[1] + c[2][i] * v[2])
}

/// A B.
pub(super) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) fn transpose(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// The matrix of a unit quaternion (scalar first) that turns body vectors into the other frame.
#[inline(always)]
pub(super) fn matrix(e: [f64; 4]) -> Matrix {
    let [e0, e1, e2, e3] = e;
    let (s0, s1, s2, s3) = (e0 * e0, e1 * e1, e2 * e2, e3 * e3);
    [
        [s0 + s1 - s2 - s3, 2.0 * (e1 * e2 - e0 * e3), 2.0 * (e1 * e3 + e0 * e2)],
        [2.0 * (e1 * e2 + e0 * e3), s0 - s1 + s2 - s3, 2.0 * (e2 * e3 - e0 * e1)],
        [2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1), s0 - s1 - s2 + s3],
    ]
}

/// The quaternion of a rotation matrix, by its largest component.
pub(super) fn quaternion(c: &Matrix) -> [f64; 4] {
    let trace = c[0][0] + c[1][1] + c[2][2];
    let squares =
        [trace, 2.0 * c[0][0] - trace, 2.0 * c[1][1] - trace, 2.0 * c[2][2] - trace].map(|x| 0.25 * (1.0 + x));
    let largest = (0..4).max_by(|&i, &j| squares[i].total_cmp(&squares[j])).unwrap_or(0);
    let root = squares[largest].sqrt();
    let f = 0.25 / root;
    match largest {
        0 => [root, f * (c[2][1] - c[1][2]), f * (c[0][2] - c[2][0]), f * (c[1][0] - c[0][1])],
        1 => [f * (c[2][1] - c[1][2]), root, f * (c[0][1] + c[1][0]), f * (c[0][2] + c[2][0])],
        2 => [f * (c[0][2] - c[2][0]), f * (c[0][1] + c[1][0]), root, f * (c[1][2] + c[2][1])],
        _ => [f * (c[1][0] - c[0][1]), f * (c[0][2] + c[2][0]), f * (c[1][2] + c[2][1]), root],
    }
}

/// Body to north-east-down from roll, pitch, yaw: turn by yaw about down, then by pitch about the new right, then by
/// roll about the new forward axis.
pub(super) fn from_euler([phi, theta, psi]: Vector) -> Matrix {
    let ((sf, cf), (st, ct), (sp, cp)) = (phi.sin_cos(), theta.sin_cos(), psi.sin_cos());
    [
        [ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp],
        [ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp],
        [-st, sf * ct, cf * ct],
    ]
}

/// Roll, pitch, yaw of a body to north-east-down matrix.
pub(super) fn to_euler(c: &Matrix) -> Vector {
    [c[2][1].atan2(c[2][2]), (-c[2][0]).clamp(-1.0, 1.0).asin(), c[1][0].atan2(c[0][0])]
}
