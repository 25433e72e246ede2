// Colours of the points: by state, probability, clearance or height, for both themes.

import { rgba } from "./renderer.js";
import { STATE_NAMES } from "./verdicts.js";

export const COLOURINGS = {
  state: { name: "state", ofStates: true },
  percent: { name: "probability", ofStates: true, from: 0, to: 100, unit: "% visible" },
  clearance: { name: "clearance", ofStates: true, from: 0, to: 3, unit: "m; of occluded lines the shift" },
  height: { name: "height", from: -2.5, to: 2.5, unit: "m above the sensor" },
};

/** Colour of a share from 0 to 1 on a scale of colours, as [r, g, b, 255]. */
export function onScale(scale, share) {
  const at = Math.min(Math.max(share, 0), 1) * (scale.length - 1);
  const low = Math.min(Math.floor(at), scale.length - 2);
  return scale[low].map((value, k) => Math.round(value + (at - low) * (scale[low + 1][k] - value)));
}

/** (N, 4) bytes; the opacity is 0 for returns whose state is not shown. */
export function pointColours(verdicts, colouring, shownStates, colours) {
  const result = new Uint8Array(4 * verdicts.count);
  const ofState = STATE_NAMES.map((name) => rgba(colours[name]));
  const scale = colours.sequential.map((hex) => rgba(hex));
  const value = valueOf(verdicts, colouring);
  const { from, to } = COLOURINGS[colouring];
  const table = Array.from({ length: 256 }, (_, k) => onScale(scale, k / 255));
  for (let i = 0; i < verdicts.count; i++) {
    if (!shownStates[verdicts.states[i]]) continue;
    const share = value && (value(i) - from) / (to - from);
    const colour = value
      ? table[Math.min(255, Math.max(0, Math.round(255 * share)))]
      : ofState[verdicts.states[i]];
    result.set(colour, 4 * i);
  }
  return result;
}

function valueOf(verdicts, colouring) {
  const { percent, clearance, z } = verdicts.columns;
  if (colouring === "percent") return (i) => Math.min(percent[i], 100);
  if (colouring === "clearance") return (i) => clearance[i] / 10;
  if (colouring === "height") return (i) => z[i] / 100;
  return null;
}
