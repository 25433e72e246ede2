// Which return lies under the pointer.

import { projected } from "./matrices.js";

const REACH_PX = 14;
const SAME_PLACE_PX = 4;

/** Index of the return to pick: of those nearest to the pointer the one in front; -1 if none is near. */
export function pickReturn(verdicts, shownStates, matrix, width, height, x, y) {
  const { positions, states, count } = verdicts;
  const near = [];
  let nearest = REACH_PX;
  for (let i = 0; i < count; i++) {
    if (!shownStates[states[i]]) continue;
    const pixel = projected(matrix, positions[3 * i], positions[3 * i + 1], positions[3 * i + 2], width, height);
    if (!pixel) continue;
    const away = Math.hypot(pixel[0] - x, pixel[1] - y);
    if (away > REACH_PX) continue;
    near.push([i, away, depthOf(matrix, positions, i)]);
    nearest = Math.min(nearest, away);
  }
  let best = [-1, 0, Infinity];
  for (const candidate of near) {
    if (candidate[1] <= nearest + SAME_PLACE_PX && candidate[2] < best[2]) best = candidate;
  }
  return best[0];
}

function depthOf(matrix, positions, i) {
  const [x, y, z] = positions.subarray(3 * i, 3 * i + 3);
  const w = matrix[3] * x + matrix[7] * y + matrix[11] * z + matrix[15];
  return (matrix[2] * x + matrix[6] * y + matrix[10] * z + matrix[14]) / w;
}
