// What is drawn besides the returns: segments and triangles of each layer, from a frame.

import { mix } from "./matrices.js";
import { rgba } from "./renderer.js";
import { PARTS } from "./verdicts.js";

export const LAYERS = {
  boxes: { name: "boxes", shown: true, about: "labelled objects, coloured by what most of each is" },
  viewpoint: { name: "viewpoint, frustum", shown: true, about: "where the lines start; the camera's view" },
  spots: { name: "blind spots", shown: false, about: "ground around the viewpoint where something 1 m high is not visible" },
  region: { name: "region", shown: false, isOfRun: true, about: "the paper's intervisible region" },
  mesh: { name: "mesh", shown: false, isOfRun: true, about: "the paper's finite elements; intervisible edges are coloured" },
  rings: { name: "rings", shown: true, about: "ground range from the sensor" },
};

export const RINGS_M = [10, 20, 40, 80];
const BOX_EDGES = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
const DASHES_PER_PART = 3;

/** Segments and triangles of one layer; empty where the frame has none. */
export function layerGeometry(name, frame, colours) {
  const build = { boxes, viewpoint, spots, region, mesh, rings }[name];
  const geometry = { segments: [], triangles: [], colours: [] };
  build(frame, colours, geometry);
  return geometry;
}

function points(columns, prefix, at) {
  return ["x", "y", "z"].map((axis) => columns[`${prefix}_${axis}`][at] / 100);
}

function boxes(frame, colours, { segments }) {
  for (const box of frame.boxes) {
    const state = stateOfBox(box);
    const colour = rgba(colours[state === "unknown" ? "line" : state]);
    for (const [a, b] of BOX_EDGES) {
      segments.push({ from: box.corners[a], to: box.corners[b], colour, width: 1.6 });
    }
  }
}

/** What at least half of a box is; unknown otherwise. */
export function stateOfBox(box) {
  if (box.visible >= 0.5) return "visible";
  return box.occluded >= 0.5 ? "occluded" : "unknown";
}

function viewpoint(frame, colours, { segments }) {
  const ink = rgba(colours.ink);
  const place = frame.viewpoint;
  for (const axis of [0, 1, 2]) {
    const [from, to] = [[...place], [...place]];
    from[axis] -= 0.7;
    to[axis] += 0.7;
    segments.push({ from, to, colour: ink, width: 2.4 });
  }
  if (frame.ground_m !== null) {
    const foot = [place[0], place[1], frame.ground_m];
    segments.push({ from: place, to: foot, colour: rgba(colours.ink, 0.5), width: 1.2 });
  }
  if (!frame.camera) return;
  const { centre, frustum } = frame.camera;
  const faint = rgba(colours.ink, 0.55);
  frustum.forEach((corner, k) => {
    segments.push({ from: centre, to: corner, colour: faint, width: 1.1 });
    segments.push({ from: corner, to: frustum[(k + 1) % 4], colour: faint, width: 1.1 });
  });
}

function spots(frame, colours, geometry) {
  const { cell_x: x, cell_y: y, cell_z: z, cell_occluded: isOccluded } = frame.columns;
  const half = 0.47 * (frame.cell_m ?? 0);
  for (let k = 0; k < (x?.length ?? 0); k++) {
    const colour = rgba(isOccluded[k] ? colours.occluded : colours.line, isOccluded[k] ? 0.45 : 0.25);
    const corner = (dx, dy) => [x[k] / 100 + dx * half, y[k] / 100 + dy * half, z[k] / 100];
    const [a, b, c, d] = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    geometry.triangles.push(...a, ...b, ...c, ...a, ...c, ...d);
    for (let n = 0; n < 6; n++) geometry.colours.push(...colour);
  }
}

function region(frame, colours, geometry) {
  const { region_a: a, region_b: b, region_c: c } = frame.columns;
  const colour = rgba(colours.region, 0.5);
  for (let k = 0; k < (a?.length ?? 0); k++) {
    for (const node of [a[k], b[k], c[k]]) {
      geometry.triangles.push(...points(frame.columns, "node", node));
      geometry.colours.push(...colour);
    }
  }
}

function mesh(frame, colours, { segments }) {
  const { edge_a: a, edge_b: b, edge_intervisible: isGood } = frame.columns;
  for (let k = 0; k < (a?.length ?? 0); k++) {
    segments.push({
      from: points(frame.columns, "node", a[k]),
      to: points(frame.columns, "node", b[k]),
      colour: rgba(isGood[k] ? colours.visible : colours.ink, isGood[k] ? 0.9 : 0.3),
      width: isGood[k] ? 1.4 : 0.9,
    });
  }
}

function rings(frame, colours, { segments }) {
  const colour = rgba(colours.ink, 0.16);
  const z = frame.ground_m ?? 0;
  for (const radius of RINGS_M) {
    const at = (k) => [radius * Math.cos((k * Math.PI) / 48), radius * Math.sin((k * Math.PI) / 48), z];
    for (let k = 0; k < 96; k++) segments.push({ from: at(k), to: at(k + 1), colour, width: 1 });
  }
}

/** A sight line: observed parts whole, unobserved parts dashed; a cross where it is blocked. */
export function lineSegments(line, colours, stateName) {
  const colour = rgba(colours[stateName === "unknown" ? "line" : stateName]);
  const segments = [];
  const at = (share) => mix(line.start, line.end, share);
  line.parts.forEach((isObserved, k) => {
    if (isObserved) {
      segments.push({ from: at(k / PARTS), to: at((k + 1) / PARTS), colour, width: 3 });
      return;
    }
    for (let d = 0; d < DASHES_PER_PART; d++) {
      const from = (k + d / DASHES_PER_PART) / PARTS;
      segments.push({ from: at(from), to: at(from + 0.45 / DASHES_PER_PART / PARTS), colour, width: 2 });
    }
  });
  if (line.blockerDm) {
    const place = line.blockerDm.map((dm) => dm / 10);
    for (const [dx, dy, dz] of [[0.3, 0, 0.3], [0.3, 0, -0.3], [0, 0.3, 0.3], [0, 0.3, -0.3]]) {
      segments.push({
        from: [place[0] - dx, place[1] - dy, place[2] - dz],
        to: [place[0] + dx, place[1] + dy, place[2] + dz],
        colour: rgba(colours.occluded),
        width: 3,
      });
    }
  }
  return segments;
}
