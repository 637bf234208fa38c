// SPDX-License-Identifier: Apache-2.0
// Vectors and 4x4 matrices (column by column, as WebGL takes them).

export type Vector = [number, number, number];
export type Quaternion = [number, number, number, number];  // w, x, y, z
export type Matrix = Float32Array;

export const add = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a: Vector, s: number): Vector => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector, b: Vector): Vector =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Vector): number => Math.hypot(...a);
export const unit = (a: Vector): Vector => times(a, 1 / Math.max(length(a), 1e-12));

/** Columns of the rotation. */
export function axesOf([w, x, y, z]: Quaternion): [Vector, Vector, Vector] {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
}

export function rotate(q: Quaternion, v: Vector): Vector {
  const [a, b, c] = axesOf(q);
  return add(add(times(a, v[0]), times(b, v[1])), times(c, v[2]));
}

export function poseMatrix(t: Vector, q: Quaternion): Matrix {
  const [a, b, c] = axesOf(q);
  return new Float32Array([...a, 0, ...b, 0, ...c, 0, ...t, 1]);
}

export function multiply(a: Matrix, b: Matrix): Matrix {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; ++column) {
    for (let row = 0; row < 4; ++row) {
      let sum = 0;
      for (let k = 0; k < 4; ++k) sum += a[4 * k + row] * b[4 * column + k];
      out[4 * column + row] = sum;
    }
  }
  return out;
}

export function perspective(fovY: number, aspect: number, near: number, far: number): Matrix {
  const f = 1 / Math.tan(fovY / 2), d = near - far;
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / d, -1, 0, 0, 2 * near * far / d, 0]);
}

export function lookAt(eye: Vector, target: Vector, up: Vector): Matrix {
  const z = unit(minus(eye, target)), x = unit(cross(up, z)), y = cross(z, x);
  return new Float32Array([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0,
    -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

/** In clip space: x, y, w. */
export function project(m: Matrix, [x, y, z]: Vector): Vector {
  const row = (r: number) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r];
  return [row(0), row(1), row(3)];
}

/** Eigenvectors, as long as the square roots of their values, of a symmetric 3x3 matrix (Jacobi). */
export function halfAxes(m: number[][]): Vector[] {
  const a = m.map((row) => [...row]), v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let turn = 0; turn < 24; ++turn) {
    const [p, q] = ([[0, 1], [0, 2], [1, 2]] as [number, number][])
      .reduce((best, now) => Math.abs(a[now[0]][now[1]]) > Math.abs(a[best[0]][best[1]]) ? now : best);
    if (Math.abs(a[p][q]) < 1e-18) break;
    const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]), c = Math.cos(angle), s = Math.sin(angle);
    for (let k = 0; k < 3; ++k) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
    for (let k = 0; k < 3; ++k) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
    for (let k = 0; k < 3; ++k) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
  }
  return [0, 1, 2].map((i) => times([v[0][i], v[1][i], v[2][i]], Math.sqrt(Math.max(a[i][i], 0))));
}
