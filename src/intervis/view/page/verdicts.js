// The answers for the returns of one frame, and the sentences that explain them.

import { decimetres, metresText, percentText, placeText } from "./numbers.js";

export const OCCLUDED = 0;
export const VISIBLE = 1;
export const UNKNOWN = 2;
export const STATE_NAMES = ["occluded", "visible", "unknown"];

const BLOCKED = 0;
const OPEN = 1;
const NOT_OBSERVED = 2;
const NOT_DECIDED = 3;
const BLOCKED_SOMEWHERE = 4;
const PARTLY_OBSERVED = 8;
const NOTHING_BESIDE = 65535;
const STATE_OF_KIND = [OCCLUDED, VISIBLE, UNKNOWN, UNKNOWN, OCCLUDED, UNKNOWN];
export const PARTS = 16;
export const NO_PERCENT = 255;

/** Columns of intervis/view/verdicts.py, with look-ups by return. */
export class Verdicts {
  /** `unexplained` says why nothing but states and probabilities is known; empty otherwise. */
  constructor(columns, viewpoint, unexplained = "") {
    this.columns = columns;
    this.viewpoint = viewpoint;
    this.unexplained = unexplained;
    this.count = columns.x.length;
    this.positions = new Float32Array(3 * this.count);
    this.states = new Uint8Array(this.count);
    this.blockedAt = new Int32Array(this.count).fill(-1);
    this.partlyAt = new Int32Array(this.count).fill(-1);
    let blocked = 0;
    let partly = 0;
    for (let i = 0; i < this.count; i++) {
      this.positions[3 * i] = columns.x[i] / 100;
      this.positions[3 * i + 1] = columns.y[i] / 100;
      this.positions[3 * i + 2] = columns.z[i] / 100;
      const kind = this.kind(i);
      this.states[i] = STATE_OF_KIND[kind];
      if (kind === BLOCKED) this.blockedAt[i] = blocked++;
      if (columns.kind[i] & PARTLY_OBSERVED) this.partlyAt[i] = partly++;
    }
  }

  kind(i) {
    return this.columns.kind[i] & 7;
  }

  end(i) {
    const { x, y, z } = this.columns;
    return [x[i] / 100, y[i] / 100, z[i] / 100];
  }

  /** Observed (true) or unobserved parts of a line, from the viewpoint to the return. */
  parts(i) {
    const at = this.partlyAt[i];
    const bits = at < 0 ? 0 : this.columns.profile[at];
    return Array.from({ length: PARTS }, (_, k) => !((bits >> k) & 1));
  }

  /** Everything that is known of a line, and its explanation. */
  line(i) {
    const end = this.end(i);
    const lengthM = Math.hypot(...end.map((value, axis) => value - this.viewpoint[axis]));
    const lengthDm = decimetres(lengthM);
    const kind = this.kind(i);
    const stored = this.columns.metres[i];
    const clearance = this.columns.clearance[i];
    const at = this.blockedAt[i];
    const line = {
      row: this.columns.row[i],
      state: this.states[i],
      kind,
      percent: this.columns.percent[i],
      start: this.viewpoint,
      end,
      lengthM,
      lengthDm,
      unobservedDm: stored,
      clearanceDm: clearance === NOTHING_BESIDE ? null : clearance,
      blockerDm: null,
      blockerAtDm: null,
      parts: this.parts(i),
      unexplained: this.unexplained,
    };
    if (at >= 0) {
      line.blockerDm = ["x", "y", "z"].map((axis) => this.columns[`blocker_${axis}`][at]);
      line.blockerAtDm = this.columns.blocker_at[at];
    }
    line.text = explanation(line);
    return line;
  }
}

/** The sentences of intervis.sight.explanation for one line. */
export function explanation(line) {
  const length = metresText(line.lengthDm);
  const percent = percentText(line.percent);
  if (line.unexplained) return storedText(line, percent);
  if (line.kind === OPEN) return visibleText(line, length, percent);
  if (line.kind === NOT_OBSERVED) {
    return (
      "Unknown: not observed throughout; prior knowledge included, visible with a probability of" +
      ` ${percent}. No scan observed ${metresText(line.unobservedDm)} of its ${length} m, and no observed` +
      " surface clearly occludes the rest."
    );
  }
  if (line.kind === NOT_DECIDED) {
    return (
      "Unknown: not decided; the best estimate of the probability of being visible is" +
      ` ${percent}. The line of ${length} m passes close to observed surfaces, or through space` +
      " on which scans disagree."
    );
  }
  if (line.kind !== BLOCKED && line.kind !== BLOCKED_SOMEWHERE) {
    return "Unknown: the ends are too far apart for an answer.";
  }
  const answer = `Occluded: visible with a probability of ${percent}.`;
  if (line.kind === BLOCKED_SOMEWHERE) {
    return `${answer} No single surface that a scan observed decides this.`;
  }
  return (
    `${answer} An observed surface occludes the line ${metresText(line.blockerAtDm)} m from the` +
    ` viewpoint (of ${length} m), at ${placeText(line.blockerDm)}; the line would have to pass` +
    ` ${metresText(line.clearanceDm)} m higher, lower or beside to clear it.`
  );
}

/** What a run stored of a line, and why there is no more. */
function storedText(line, percent) {
  if (line.percent === NO_PERCENT) return `Not judged. ${line.unexplained}`;
  const answer = { [VISIBLE]: "Visible:", [OCCLUDED]: "Occluded: visible", [UNKNOWN]: "Unknown: visible" }[line.state];
  return `${answer} with a probability of ${percent}, as the run stored it. ${line.unexplained}`;
}

function visibleText(line, length, percent) {
  const crossed =
    line.lengthM < 0.05
      ? "Its ends are less than 0.1 m apart"
      : `Beams crossed ${metresText(line.lengthDm - line.unobservedDm)} of its ${length} m`;
  const beside =
    line.clearanceDm === null
      ? "no surface was observed beside it"
      : `it clears the nearest surface by ${metresText(line.clearanceDm)} m`;
  const answer = `Visible: with a probability of ${percent}. ${crossed}; ${beside}.`;
  if (2 * line.unobservedDm > line.lengthDm) {
    return `${answer} No scan observed most of it: prior knowledge of such space decides.`;
  }
  return answer;
}

/** A line that Python explained (stored with the page, or answered by the server), in the same form. */
export function lineOfAnswer(answer) {
  const dm = (value) => (value === null ? null : decimetres(value));
  const part = answer.length_m / PARTS;
  const probability = answer.probability;
  return {
    row: null,
    state: answer.state < 0 ? UNKNOWN : answer.state,
    percent: percentCode(probability),
    start: answer.start,
    end: answer.end,
    lengthM: answer.length_m,
    lengthDm: decimetres(answer.length_m),
    unobservedDm: decimetres(answer.unobserved_m),
    clearanceDm: answer.clearance_m === null ? null : decimetres(Math.abs(answer.clearance_m)),
    blockerDm: answer.blocker[0] === null ? null : answer.blocker.map(dm),
    blockerAtDm: dm(answer.blocker_m),
    parts: answer.parts_m.map((metres) => metres <= 0.5 * part),
    unexplained: "",
    text: answer.text,
  };
}

function percentCode(probability) {
  if (probability === null) return NO_PERCENT;
  if (probability < 0.01) return 0;
  return probability > 0.99 ? 101 : Math.round(100 * probability);
}
