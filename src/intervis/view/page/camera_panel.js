// The camera image with the returns in it, coloured by state.

import { OCCLUDED, STATE_NAMES, UNKNOWN, VISIBLE } from "./verdicts.js";

const DRAWN_LAST = [VISIBLE, UNKNOWN, OCCLUDED];
const IMAGE_REACH_PX = 10;

export class CameraPanel {
  constructor(element, state, actions) {
    this.element = element;
    this.canvas = element.querySelector("canvas");
    this.state = state;
    this.image = null;
    this.canvas.addEventListener("click", (event) => {
      const box = this.canvas.getBoundingClientRect();
      const factor = this.canvas.width / box.width;
      actions.pick(this.pick((event.clientX - box.left) * factor, (event.clientY - box.top) * factor));
    });
  }

  /** A new frame; resolves when its image is decoded. */
  async refresh() {
    const { frame } = this.state;
    this.element.hidden = !frame.camera?.has_image;
    if (this.element.hidden) return;
    const image = new Image();
    image.src = `data:image/jpeg;base64,${frame.image}`;
    await image.decode();
    if (frame !== this.state.frame) return; // the timeline went on
    this.image = image;
    this.canvas.width = frame.camera.width_px;
    this.canvas.height = frame.camera.height_px;
    this.draw();
  }

  /** Pixel of a place; null where it is behind the camera or outside the image. */
  pixelOf(place) {
    const { image_from_velo: m, width_px, height_px } = this.state.frame.camera;
    const [u, v, w] = m.map((row) => row[0] * place[0] + row[1] * place[1] + row[2] * place[2] + row[3]);
    if (w <= 0) return null;
    const [x, y] = [u / w, v / w];
    return x >= 0 && y >= 0 && x < width_px && y < height_px ? [x, y, w] : null;
  }

  draw() {
    const { frame, shownStates, colours, line } = this.state;
    if (this.element.hidden || !this.image) return;
    const pen = this.canvas.getContext("2d");
    pen.drawImage(this.image, 0, 0);
    const { positions, states, count } = frame.verdicts;
    for (const drawn of DRAWN_LAST) {
      if (!shownStates[drawn]) continue;
      pen.fillStyle = colours.onImage[STATE_NAMES[drawn]];
      for (let i = 0; i < count; i++) {
        if (states[i] !== drawn) continue;
        const at = this.pixelOf(positions.subarray(3 * i, 3 * i + 3));
        if (at) pen.fillRect(at[0] - 1, at[1] - 1, 2, 2);
      }
    }
    if (line) this.drawLine(pen, line);
  }

  drawLine(pen, line) {
    const steps = 200;
    pen.lineWidth = 2.5;
    pen.strokeStyle = "#ffffff";
    pen.beginPath();
    let isDown = false;
    for (let k = 0; k <= steps; k++) {
      const place = line.start.map((value, axis) => value + (k / steps) * (line.end[axis] - value));
      const at = this.pixelOf(place);
      if (at && at[2] > 0.3) {
        if (isDown) pen.lineTo(at[0], at[1]);
        else pen.moveTo(at[0], at[1]);
      }
      isDown = Boolean(at && at[2] > 0.3);
    }
    pen.stroke();
    const end = this.pixelOf(line.end);
    if (!end) return;
    pen.beginPath();
    pen.arc(end[0], end[1], 6, 0, 2 * Math.PI);
    pen.stroke();
  }

  pick(x, y) {
    const { verdicts } = this.state.frame;
    let [best, least] = [-1, IMAGE_REACH_PX];
    for (let i = 0; i < verdicts.count; i++) {
      if (!this.state.shownStates[verdicts.states[i]]) continue;
      const at = this.pixelOf(verdicts.positions.subarray(3 * i, 3 * i + 3));
      if (!at) continue;
      const away = Math.hypot(at[0] - x, at[1] - y);
      if (away < least) [best, least] = [i, away];
    }
    return best;
  }
}
