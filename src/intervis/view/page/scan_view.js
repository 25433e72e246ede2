// A view of the scan: returns, layers and lines in WebGL, labels on a canvas above.

import { LAYERS, RINGS_M, layerGeometry, lineSegments, stateOfBox } from "./layers.js";
import { projected } from "./matrices.js";
import { pickReturn } from "./picking.js";
import { pointColours } from "./palette.js";
import { followPointer } from "./pointer.js";
import { Renderer, rgba } from "./renderer.js";
import { STATE_NAMES } from "./verdicts.js";

const MOST_LABELLED_M2 = 60; // larger blind spots are the surroundings, with no middle to speak of

export class ScanView {
  /** `state` is the state of the page (see page.js); `actions` are what clicks and drags cause. */
  constructor(element, camera, state, actions) {
    this.canvas = element.querySelector("canvas.gl");
    this.labels = element.querySelector("canvas.labels");
    this.camera = camera;
    this.state = state;
    this.renderer = new Renderer(this.canvas);
    this.layers = {};
    this.isMap = "halfM" in camera;
    followPointer(this.canvas, {
      onDrag: (du, dv, isPan) => {
        if (isPan) this.camera.pan(du, dv, this.aspect());
        else this.camera.turn(du, dv, this.aspect());
        this.draw();
      },
      onZoom: (factor, u, v) => {
        this.camera.zoom(factor, u, v, this.aspect());
        this.draw();
      },
      onClick: (x, y) => actions.pick(this.pick(x, y)),
      onGrab: (x, y) => this.grab(x, y, actions),
    });
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  aspect() {
    return this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    for (const canvas of [this.canvas, this.labels]) {
      canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
      canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    }
    this.draw();
  }

  pick(x, y) {
    const { frame, shownStates } = this.state;
    if (!frame) return -1;
    const matrix = this.camera.matrix(this.aspect());
    const { clientWidth, clientHeight } = this.canvas;
    return pickReturn(frame.verdicts, shownStates, matrix, clientWidth, clientHeight, x, y);
  }

  /** Where the engine answers, the viewpoint can be dragged at its height. */
  grab(x, y, actions) {
    const { frame, isServed } = this.state;
    if (!isServed || !frame || !this.state.shownLayers.viewpoint) return null;
    const at = this.pixelOf(frame.viewpoint);
    if (!at || Math.hypot(at[0] - x, at[1] - y) > 16) return null;
    return (toX, toY) => {
      const u = (2 * toX) / this.canvas.clientWidth - 1;
      const v = 1 - (2 * toY) / this.canvas.clientHeight;
      const { origin, direction } = this.camera.ray(u, v, this.aspect());
      const along = (frame.viewpoint[2] - origin[2]) / direction[2];
      if (!(along > 0) || along > 600) return;
      const place = origin.map((value, axis) => value + along * direction[axis]);
      actions.dragViewpoint([place[0], place[1], frame.viewpoint[2]]);
    };
  }

  pixelOf(place) {
    const { clientWidth, clientHeight } = this.canvas;
    return projected(this.camera.matrix(this.aspect()), ...place, clientWidth, clientHeight);
  }

  /** New returns, states or colours. */
  refresh() {
    const { frame, colouring, shownStates, colours } = this.state;
    if (!frame) return;
    this.renderer.release(this.points);
    const bytes = pointColours(frame.verdicts, colouring, shownStates, colours);
    this.points = this.renderer.pointBuffers(frame.verdicts.positions, bytes);
    for (const name of Object.keys(LAYERS)) this.fillLayer(name);
    this.refreshLine();
  }

  refreshLayer(name) {
    this.fillLayer(name);
    this.draw();
  }

  fillLayer(name) {
    const { segments, triangles, colours } = layerGeometry(name, this.state.frame, this.state.colours);
    this.renderer.release(this.layers[name]?.segments);
    this.renderer.release(this.layers[name]?.triangles);
    this.layers[name] = {
      segments: this.renderer.segmentBuffers(segments),
      triangles: this.renderer.pointBuffers(new Float32Array(triangles), new Uint8Array(colours)),
    };
  }

  /** A new selected line, or none. */
  refreshLine() {
    const { line, colours } = this.state;
    this.renderer.release(this.line);
    const segments = line ? lineSegments(line, colours, STATE_NAMES[line.state]) : [];
    this.line = this.renderer.segmentBuffers(segments);
    this.draw();
  }

  draw() {
    if (!this.points) return;
    const { colours, shownLayers } = this.state;
    const ratio = window.devicePixelRatio || 1;
    const matrix = this.camera.matrix(this.aspect());
    this.renderer.begin(rgba(colours.background));
    const grown = this.state.hasScans ? ratio : 2.5 * ratio; // a few nodes between the lines of their mesh
    const size = this.isMap
      ? { scale: 0, least: 1.5 * grown, most: 1.5 * grown }
      : { scale: 60 * grown, least: 2 * grown, most: 7 * ratio };
    this.renderer.drawPoints(this.points, matrix, size);
    for (const name of Object.keys(LAYERS)) {
      if (!shownLayers[name]) continue;
      this.renderer.drawTriangles(this.layers[name].triangles, matrix);
      const isCovered = !["viewpoint", "boxes", "mesh"].includes(name);
      this.renderer.drawSegments(this.layers[name].segments, matrix, ratio, isCovered);
    }
    this.renderer.drawSegments(this.line, matrix, ratio, false);
    this.drawLabels(ratio);
  }

  drawLabels(ratio) {
    const pen = this.labels.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.labels.width, this.labels.height);
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = this.state.colours.background;
    const taken = [];
    for (const label of this.wantedLabels()) this.say(pen, label, taken);
  }

  /** Labels in the order in which they get their room: [place, text, colour, pixels below]. */
  wantedLabels() {
    const { frame, line, shownLayers, colours } = this.state;
    const labels = [];
    if (line?.blockerDm) {
      const text = `blocked at ${(line.blockerAtDm / 10).toFixed(1)} m`;
      labels.push([line.blockerDm.map((dm) => dm / 10), text, colours.occluded]);
    }
    if (line) labels.push([line.end, `${(line.lengthDm / 10).toFixed(1)} m`, colours.ink, 14]);
    if (shownLayers.viewpoint) labels.push([frame.viewpoint, "viewpoint", colours.ink]);
    if (shownLayers.boxes) {
      for (const box of frame.boxes) {
        const share = box.visible === null ? "" : ` ${Math.round(100 * box.visible)} %`;
        const state = stateOfBox(box);
        const colour = colours[state === "unknown" ? "line" : state];
        labels.push([box.corners[7], `${box.category}${share}`, colour]);
      }
    }
    if (shownLayers.spots) {
      const shown = (frame.spots ?? []).filter((spot) => spot.hides && spot.area_m2 < MOST_LABELLED_M2);
      for (const spot of shown) {
        labels.push([[...spot.centre, frame.ground_m ?? 0], `could hide a ${spot.hides}`, colours.ink]);
      }
    }
    if (shownLayers.rings) {
      for (const radius of RINGS_M) labels.push([[radius, 0, frame.ground_m ?? 0], `${radius} m`, colours.faint]);
    }
    return labels;
  }

  /** Write a label, unless it would cover another. */
  say(pen, [place, text, colour, below = -5], taken) {
    const at = this.pixelOf(place);
    if (!at) return;
    const [x, y] = [at[0] + 7, at[1] + below];
    const box = [x, y - 11, x + pen.measureText(text).width, y + 3];
    if (taken.some((one) => box[0] < one[2] && one[0] < box[2] && box[1] < one[3] && one[1] < box[3])) return;
    taken.push(box);
    pen.fillStyle = colour;
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
  }
}
