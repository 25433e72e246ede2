// What a run stored of the frame at hand: the paper's measures, tau and the time, as in its files.

import { grouped } from "./numbers.js";

const COUNT = (value) => grouped(value);
const PERCENT = (value) => `${value.toFixed(2)} %`;

/** Name in the files, words, and form of each number. */
const MEASURES = [
  ["n_raw", "returns of the scan", COUNT],
  ["n_fov", "returns in view", COUNT],
  ["tau", "returns per node", COUNT],
  ["n", "nodes", COUNT],
  ["N", "finite elements", COUNT],
  ["SP", "edges, pairs compared", COUNT],
  ["ARR", "returns that are no node", PERCENT],
  ["TPI", "intervisible edges of 3 N", PERCENT],
  ["TPI_unique", "intervisible edges of SP", PERCENT],
  ["DCP", "sight lines saved", PERCENT],
  ["total", "raw scan to region", (value) => `${(1000 * value).toFixed(1)} ms`],
];

export class Measures {
  /** `run` is what the page says of its run, if it shows one. */
  constructor(element, run) {
    this.element = element;
    this.run = run;
    element.hidden = !run;
  }

  refresh(frame) {
    if (!this.run) return;
    const numbers = { tau: frame.run.tau, ...frame.run.measures, total: frame.run.times_s.total };
    const list = this.element.querySelector("dl");
    list.replaceChildren();
    for (const [name, words, form] of MEASURES) {
      const value = numbers[name];
      if (value === null || value === undefined) continue;
      const item = document.createElement("div");
      item.title = `${name}: ${value}`;
      for (const [tag, text] of [["dt", name === "total" ? "time" : name], ["dd", form(value)], ["dd", words]]) {
        const part = document.createElement(tag);
        part.textContent = text;
        item.append(part);
      }
      list.append(item);
    }
    const note = this.element.querySelector("p");
    note.textContent = frame.unexplained;
    note.hidden = !frame.unexplained || !this.run.has_drive; // else it is said above
  }
}
