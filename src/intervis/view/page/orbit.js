// Cameras that a pointer moves: around a target, or straight from above.

import {
  add, cross, dot, orthographic, perspective, product, scaled, subtract, unit, viewMatrix,
} from "./matrices.js";

const TAN_HALF = Math.tan((25 * Math.PI) / 180);
const FARTHEST_M = 2000;

/** Looks at a target from an azimuth, an elevation and a distance; z stays up. */
export class OrbitCamera {
  constructor(start) {
    this.start = start;
    this.reset();
  }

  reset() {
    this.target = [...this.start.target];
    this.azimuth = this.start.azimuth;
    this.elevation = this.start.elevation;
    this.distance = this.start.distance;
  }

  axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const back = [-ca * ce, -sa * ce, se];
    const right = [sa, -ca, 0];
    return { right, up: cross(back, right), back };
  }

  eye() {
    return add(this.target, scaled(this.axes().back, this.distance));
  }

  matrix(aspect) {
    const { right, up, back } = this.axes();
    const near = Math.max(0.05, this.distance / 200);
    const far = this.distance + FARTHEST_M;
    return product(perspective(TAN_HALF, aspect, near, far), viewMatrix(this.eye(), right, up, back));
  }

  /** The ray through a place of the canvas, from -1 to 1 to the right and upwards. */
  ray(u, v, aspect) {
    const { right, up, back } = this.axes();
    const sideways = add(scaled(right, u * aspect * TAN_HALF), scaled(up, v * TAN_HALF));
    return { origin: this.eye(), direction: unit(subtract(sideways, back)) };
  }

  turn(du, dv) {
    this.azimuth -= du * Math.PI;
    this.elevation = Math.min(1.55, Math.max(-0.3, this.elevation - dv * 0.5 * Math.PI));
  }

  pan(du, dv, aspect) {
    const { right, up } = this.axes();
    const half = this.distance * TAN_HALF;
    this.target = add(this.target, scaled(right, -du * aspect * half));
    this.target = add(this.target, scaled(up, -dv * half));
  }

  /** What lies under the cursor in the plane of the target stays there. */
  zoom(factor, u, v, aspect) {
    const { origin, direction } = this.ray(u, v, aspect);
    const { back } = this.axes();
    const along = dot(subtract(this.target, origin), back) / dot(direction, back);
    const under = add(origin, scaled(direction, along));
    const kept = Math.min(Math.max(this.distance * factor, 1), 800) / this.distance;
    this.target = add(under, scaled(subtract(this.target, under), kept));
    this.distance *= kept;
  }
}

/** Looks straight down: x upwards, y to the left, as the vehicle drives up the page. */
export class MapCamera {
  constructor(start) {
    this.start = start;
    this.reset();
  }

  reset() {
    this.target = [...this.start.target];
    this.halfM = this.start.halfM;
  }

  matrix(aspect) {
    const view = viewMatrix([...this.target.slice(0, 2), 500], [0, -1, 0], [1, 0, 0], [0, 0, 1]);
    return product(orthographic(this.halfM * aspect, this.halfM, 1, 1000), view);
  }

  ray(u, v, aspect) {
    const x = this.target[0] + v * this.halfM;
    const y = this.target[1] - u * this.halfM * aspect;
    return { origin: [x, y, 500], direction: [0, 0, -1] };
  }

  turn(du, dv, aspect) {
    this.pan(du, dv, aspect);
  }

  pan(du, dv, aspect) {
    this.target[0] -= dv * this.halfM;
    this.target[1] += du * this.halfM * aspect;
  }

  zoom(factor, u, v, aspect) {
    const [x, y] = this.ray(u, v, aspect).origin;
    const halfM = Math.min(Math.max(this.halfM * factor, 2), 400);
    const kept = halfM / this.halfM;
    this.target = [x + (this.target[0] - x) * kept, y + (this.target[1] - y) * kept, 0];
    this.halfM = halfM;
  }
}
