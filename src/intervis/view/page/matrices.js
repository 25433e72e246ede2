// 4 x 4 matrices in columns, as WebGL takes them, and vectors of three numbers.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const mix = (a, b, share) => a.map((value, axis) => value + share * (b[axis] - value));

export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function unit(a) {
  return scaled(a, 1 / Math.hypot(...a));
}

export function product(a, b) {
  const result = new Float64Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      result[4 * column + row] = sum;
    }
  }
  return result;
}

/** Camera axes from world axes: x right, y up, z towards the eye. */
export function viewMatrix(eye, right, up, back) {
  return new Float64Array([
    right[0], up[0], back[0], 0,
    right[1], up[1], back[1], 0,
    right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
  ]);
}

export function perspective(tanHalf, aspect, near, far) {
  const f = 1 / tanHalf;
  const depth = 1 / (near - far);
  return new Float64Array([
    f / aspect, 0, 0, 0,
    0, f, 0, 0,
    0, 0, (far + near) * depth, -1,
    0, 0, 2 * far * near * depth, 0,
  ]);
}

export function orthographic(halfWidth, halfHeight, near, far) {
  const depth = 1 / (near - far);
  return new Float64Array([
    1 / halfWidth, 0, 0, 0,
    0, 1 / halfHeight, 0, 0,
    0, 0, 2 * depth, 0,
    0, 0, (far + near) * depth, 1,
  ]);
}

/** Pixel (x, y) and clip depth of a point; null behind the eye. */
export function projected(matrix, x, y, z, width, height) {
  const w = matrix[3] * x + matrix[7] * y + matrix[11] * z + matrix[15];
  if (w <= 1e-6) return null;
  const u = (matrix[0] * x + matrix[4] * y + matrix[8] * z + matrix[12]) / w;
  const v = (matrix[1] * x + matrix[5] * y + matrix[9] * z + matrix[13]) / w;
  return [0.5 * width * (1 + u), 0.5 * height * (1 - v), w];
}
