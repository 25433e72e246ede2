// The explanation of the selected line.

import { grouped, metresText, percentText } from "./numbers.js";
import { NO_PERCENT, PARTS, STATE_NAMES } from "./verdicts.js";

const metres = (values, digits) => `(${values.map((value) => value.toFixed(digits)).join(", ")}) m`;

const NO_SCANS = "Click a node, in any view, to see what the run stored of the sight line to it.";
const NO_STATES = "The run stored no sight lines, and its drive is missing: no return can be judged.";

function element(name, className, text) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

/** A word for a shell, quoted where it holds more than plain characters. */
function shellWord(text) {
  return /^\w[\w./-]*$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

export class Selection {
  constructor(parent, state) {
    this.parent = parent;
    this.state = state;
    if (!state.hasScans) parent.querySelector(".hint").textContent = state.hasStates ? NO_SCANS : NO_STATES;
    this.hint = parent.querySelector(".hint").textContent;
  }

  refresh() {
    const { line, frame } = this.state;
    const body = this.parent.querySelector(".body");
    body.replaceChildren();
    if (!line) {
      body.append(element("p", "hint", this.hint));
      return;
    }
    const state = STATE_NAMES[line.state];
    const head = element("p", "head");
    const isJudged = !line.unexplained || line.percent !== NO_PERCENT;
    head.append(element("span", `badge ${state}`, isJudged ? state : "not judged"));
    head.append(line.row === null ? "line" : `return ${grouped(line.row)} of frame ${frame.number}`);
    body.append(head, element("p", "text", line.text));
    if (!line.unexplained) body.append(this.bar(line, state));
    body.append(this.table(line));
    if (this.state.page.has_command && !line.unexplained) {
      body.append(element("p", "hint", this.commandTitle(line)), this.command(line));
    }
  }

  /** The line from the viewpoint (left) to its end, with what was observed of it. */
  bar(line, state) {
    const bar = element("div", `bar ${state}`);
    const parts = element("div", "parts");
    for (const isObserved of line.parts) parts.append(element("i", isObserved ? "observed" : "unobserved"));
    bar.append(parts);
    if (line.blockerAtDm !== null && line.lengthDm) {
      const mark = element("span", "mark", "✕");
      mark.style.left = `${Math.min(100, (100 * line.blockerAtDm) / line.lengthDm)}%`;
      bar.append(mark);
    }
    const scale = element("div", "scale");
    scale.append(element("span", "", "viewpoint"), element("span", "", `${(line.lengthDm / 10).toFixed(1)} m`));
    bar.append(scale);
    bar.title = `Each of ${PARTS} parts: solid where beams crossed most of it, hatched where not.`;
    return bar;
  }

  /** The run's lines end at the returns, not at their rounded coordinates. */
  commandTitle(line) {
    const isStored = line.row !== null && Object.keys(this.state.frame.run?.shares ?? {}).length;
    return isStored ? "Asked again from the command line, its end rounded to 1 cm:" : "The same from the command line:";
  }

  table(line) {
    const rows = [["probability of being visible", line.percent === NO_PERCENT ? "none" : percentText(line.percent)]];
    rows.push(...(line.unexplained ? [["length", `${metresText(line.lengthDm)} m`]] : this.explained(line)));
    rows.push(["end", metres(line.end, 2)], ["viewpoint", metres(line.start, 2)]);
    const table = element("table");
    for (const [name, value] of rows) {
      const row = element("tr");
      row.append(element("th", "", name), element("td", "", value));
      table.append(row);
    }
    return table;
  }

  /** Rows of the table that need the scans. */
  explained(line) {
    const observed = Math.max(line.lengthDm - line.unobservedDm, 0);
    const rows = [["observed, unobserved", `${metresText(observed)} m, ${(line.unobservedDm / 10).toFixed(1)} m`]];
    if (line.blockerDm) {
      const place = metres(line.blockerDm.map((dm) => dm / 10), 1);
      rows.push(["blocker", `${place}, ${metresText(line.blockerAtDm)} m from the viewpoint`]);
      rows.push(["shift that clears it", `${metresText(line.clearanceDm)} m`]);
    } else {
      rows.push(["clearance", line.clearanceDm === null ? "nothing observed beside" : `${metresText(line.clearanceDm)} m`]);
    }
    return rows;
  }

  /** The start of a line, by its name where the page was made with one. */
  from(line) {
    const { page, frame } = this.state;
    const isNamed = page.viewpoint !== null && line.start === frame.viewpoint && !frame.isMoved;
    return isNamed ? page.viewpoint : line.start.join(",");
  }

  command(line) {
    const { page, frame } = this.state;
    const memory = frame.memory.length
      ? ` --frames ${Math.min(frame.number, ...frame.memory)}:${Math.max(frame.number, ...frame.memory) + 1}`
      : "";
    const risk = page.risk === page.default_risk ? "" : ` --risk ${page.risk}`;
    const text =
      `intervis sight ${shellWord(page.drive)} --frame ${frame.number}${memory}${risk}` +
      ` --from=${this.from(line)} --to=${line.end.map((value) => Number(value.toFixed(4))).join(",")}`;
    const row = element("div", "command");
    row.append(element("code", "", text));
    const button = element("button", "", "Copy");
    button.type = "button";
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(text);
        button.textContent = "Copied";
      } catch {
        getSelection().selectAllChildren(row.firstChild);
      }
    });
    row.append(button);
    return row;
  }
}
