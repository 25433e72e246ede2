// For browsers without WebGL2: the returns from above on a plain canvas.

import { RINGS_M } from "./layers.js";
import { OCCLUDED, STATE_NAMES, UNKNOWN, VISIBLE } from "./verdicts.js";

const SHOWN_M = 40;

export function drawStaticPicture(canvas, frame, colours) {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * ratio;
  canvas.height = canvas.clientHeight * ratio;
  const pen = canvas.getContext("2d");
  const perM = Math.min(canvas.width, canvas.height) / (2 * SHOWN_M);
  const pixel = (x, y) => [canvas.width / 2 - y * perM, canvas.height / 2 - x * perM];
  pen.fillStyle = colours.background;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = colours.faint;
  pen.fillStyle = colours.faint;
  pen.font = `${11 * ratio}px system-ui, sans-serif`;
  for (const radius of RINGS_M) {
    pen.beginPath();
    pen.arc(...pixel(0, 0), radius * perM, 0, 2 * Math.PI);
    pen.stroke();
    pen.fillText(`${radius} m`, ...pixel(radius, 0));
  }
  const { positions, states, count } = frame.verdicts;
  for (const state of [UNKNOWN, OCCLUDED, VISIBLE]) {
    pen.fillStyle = colours[STATE_NAMES[state]];
    for (let i = 0; i < count; i++) {
      if (states[i] === state) pen.fillRect(...pixel(positions[3 * i], positions[3 * i + 1]), 1.5 * ratio, 1.5 * ratio);
    }
  }
  pen.fillStyle = colours.ink;
  pen.beginPath();
  pen.arc(...pixel(...frame.viewpoint), 4 * ratio, 0, 2 * Math.PI);
  pen.fill();
}
