// Small charts over the frames; a click goes to a frame.

const CHART_HEIGHT = 64;
const AXIS_PX = 40;
const CHART_WIDTH = 340;
const MOST_DIGITS = 3;
const NAMESPACE = "http://www.w3.org/2000/svg";

/** Percent of the returns in a state: of all, as a run stored it, or of those of the page. */
function shareOf(frame, name) {
  const stored = frame.run?.shares[name];
  if (stored !== undefined) return stored === null ? null : 100 * stored;
  const count = frame.visible + frame.occluded + frame.unknown;
  return count && !frame.unexplained ? (100 * frame[name]) / count : null;
}

/** Charts of the page: name, unit and series of each; those without numbers are left out. */
export function chartsOf(frames) {
  const share = (name) => frames.map((frame) => shareOf(frame, name));
  const spotArea = frames.map((frame) => frame.spots?.reduce((sum, spot) => sum + spot.area_m2, 0) ?? null);
  const charts = [
    { title: "visible", unit: "% of the returns", colour: "visible", values: share("visible") },
    { title: "occluded", unit: "% of the returns", colour: "occluded", values: share("occluded") },
    { title: "unknown", unit: "% of the returns", colour: "line", values: share("unknown") },
    { title: "blind spots in a square of 60 m", unit: "m²", colour: "ink", values: spotArea },
    { title: "TPI, the paper's measure", unit: "%", colour: "ink", values: frames.map((frame) => frame.TPI ?? null) },
  ];
  mostLines(frames).forEach((_, k) => {
    const probabilities = frames.map((frame) => frame.lines[k]?.probability ?? null);
    const values = probabilities.map((probability) => (probability === null ? null : 100 * probability));
    charts.push({ title: `line ${k + 1}, P(visible)`, unit: "%", colour: "ink", values });
  });
  return charts.filter((chart) => chart.values.some((value) => value !== null));
}

/** The lines of a frame that has all that were asked for. */
export function mostLines(frames) {
  return frames.reduce((most, { lines }) => (lines.length > most.length ? lines : most), []);
}

function svg(name, attributes, parent) {
  const element = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

/** Digits after the point that tell the two ends of an axis apart. */
function digitsOf(low, high) {
  let digits = Math.max(Math.abs(low), Math.abs(high)) >= 100 ? 0 : 1;
  while (digits < MOST_DIGITS && (high - low) * 10 ** digits < 2) digits++;
  return digits;
}

export class Charts {
  constructor(parent, frames, numbers, go) {
    this.frames = frames;
    this.numbers = numbers;
    this.drawn = chartsOf(frames).map((chart) => this.draw(parent, chart, go));
  }

  draw(parent, chart, go) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const value = document.createElement("b");
    caption.append(`${chart.title}, ${chart.unit} `, value);
    const picture = svg("svg", { viewBox: `0 0 ${CHART_WIDTH} ${CHART_HEIGHT + 18}`, role: "img" }, figure);
    const known = chart.values.filter((one) => one !== null);
    let [low, high] = [Math.min(...known), Math.max(...known)];
    if (high - low < 2 / 10 ** MOST_DIGITS) [low, high] = [low - 0.5, high + 0.5];
    const digits = digitsOf(low, high);
    const x = (k) => AXIS_PX + ((CHART_WIDTH - AXIS_PX - 6) * (k + 0.5)) / chart.values.length;
    const y = (one) => 6 + (CHART_HEIGHT - 10) * (1 - (one - low) / (high - low));
    for (const one of [low, high]) {
      svg("line", { x1: AXIS_PX, x2: CHART_WIDTH, y1: y(one), y2: y(one), class: "grid" }, picture);
      svg("text", { x: AXIS_PX - 5, y: y(one) + 4, "text-anchor": "end" }, picture).textContent = one.toFixed(digits);
    }
    const [first, last] = [this.numbers[0], this.numbers[this.numbers.length - 1]];
    svg("text", { x: AXIS_PX, y: CHART_HEIGHT + 14 }, picture).textContent = `frame ${first}`;
    if (last !== first) {
      svg("text", { x: CHART_WIDTH, y: CHART_HEIGHT + 14, "text-anchor": "end" }, picture).textContent = last;
    }
    const path = chart.values.map((one, k) => (one === null ? "" : `${x(k)},${y(one)}`)).filter(Boolean);
    const colour = `var(--${chart.colour})`;
    svg("polyline", { points: path.join(" "), style: `stroke:${colour}`, class: "series" }, picture);
    const cursor = svg("line", { y1: 2, y2: CHART_HEIGHT, class: "cursor" }, picture);
    const dot = svg("circle", { r: 3.5, style: `fill:${colour}` }, picture);
    picture.addEventListener("click", (event) => {
      const box = picture.getBoundingClientRect();
      const at = ((event.clientX - box.left) / box.width) * CHART_WIDTH;
      const count = chart.values.length;
      go(Math.min(count - 1, Math.max(0, Math.floor(((at - AXIS_PX) / (CHART_WIDTH - AXIS_PX - 6)) * count))));
    });
    figure.prepend(caption);
    parent.append(figure);
    return { chart, cursor, dot, value, digits, x, y };
  }

  show(index) {
    for (const { chart, cursor, dot, value, digits, x, y } of this.drawn) {
      const one = chart.values[index];
      cursor.setAttribute("x1", x(index));
      cursor.setAttribute("x2", x(index));
      dot.style.visibility = one === null ? "hidden" : "visible";
      if (one !== null) {
        dot.setAttribute("cx", x(index));
        dot.setAttribute("cy", y(one));
      }
      value.textContent = one === null ? "" : one.toFixed(digits);
    }
  }
}
