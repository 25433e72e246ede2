// The page: its state, and what happens when a frame, a line or a switch changes.

import { CameraPanel } from "./camera_panel.js";
import { Charts, mostLines } from "./charts.js";
import { Judge, askLine } from "./engine.js";
import { Frames } from "./frames.js";
import { LAYERS } from "./layers.js";
import { Legend } from "./legend.js";
import { Measures } from "./measures.js";
import { grouped, nearestIndex } from "./numbers.js";
import { MapCamera, OrbitCamera } from "./orbit.js";
import { ScanView } from "./scan_view.js";
import { Selection } from "./selection.js";
import { drawStaticPicture } from "./static_picture.js";
import { Timeline } from "./timeline.js";
import { lineOfAnswer } from "./verdicts.js";

const byId = (id) => document.getElementById(id);

class Page {
  constructor(content) {
    this.page = content;
    this.frames = new Frames(content.frames);
    this.isServed = content.is_served;
    this.hasStates = content.run?.has_states ?? true;
    this.hasScans = content.run?.has_drive ?? true;
    this.frame = null;
    this.index = 0;
    this.line = null;
    this.picked = -1;
    this.stored = -1;
    this.colouring = this.hasStates ? "state" : "height";
    this.shownStates = [true, true, true];
    this.shownLayers = Object.fromEntries(
      Object.entries(LAYERS).map(([name, layer]) => [name, layer.shown || (content.run && layer.isOfRun) || false]),
    );
    this.places = null;
    this.readTheme();
  }

  readTheme() {
    const chosen = document.documentElement.dataset.theme;
    const isDark = chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    this.theme = isDark ? "dark" : "light";
    this.colours = this.page.colours[this.theme];
    for (const name of ["visible", "occluded", "unknown", "line", "ink"]) {
      document.documentElement.style.setProperty(`--${name}`, this.colours[name]);
    }
  }

  /** Whether any frame has something to show in a layer. */
  hasLayer(name) {
    const { frames } = this.page;
    if (name === "boxes") return frames.some((frame) => frame.boxes.length);
    if (name === "spots") return frames.some((frame) => frame.spots?.length);
    if (name === "mesh" || name === "region") return frames.some((frame) => "TPI" in frame);
    return true;
  }

  async start() {
    const actions = {
      pick: (i) => this.pick(i),
      dragViewpoint: (place) => this.dragViewpoint(place),
    };
    const first = this.page.frames[0];
    const ground = first.ground_m ?? -1.7;
    try {
      const target = [first.viewpoint[0] + 6, first.viewpoint[1], ground];
      const orbit = new OrbitCamera({ target, azimuth: 0, elevation: 0.5, distance: 38 });
      this.scan = new ScanView(byId("scan"), orbit, this, actions);
      const map = new MapCamera({ target: [first.viewpoint[0], first.viewpoint[1], 0], halfM: 32 });
      this.above = new ScanView(byId("above"), map, this, actions);
    } catch (error) {
      if (error.message !== "no WebGL2") throw error;
      this.showWithoutWebGL();
    }
    this.camera = new CameraPanel(byId("camera"), this, actions);
    this.selection = new Selection(byId("selection"), this);
    this.measures = new Measures(byId("measures"), this.page.run);
    this.legend = new Legend(byId("legend"), this, (isOnlyLayers) => this.redraw(isOnlyLayers));
    const numbers = this.page.frames.map((frame) => frame.number);
    this.timeline = new Timeline(byId("timeline"), numbers, (index) => this.show(index));
    this.charts = new Charts(byId("charts"), this.page.frames, numbers, (index) => this.go(index));
    byId("charts").hidden = numbers.length < 2;
    this.judge = new Judge(
      async (number, answer) => {
        const index = numbers.indexOf(number);
        this.afterJudging(index, await this.frames.judged(index, answer));
      },
      (message) => this.tell(message),
    );
    this.listen();
    await this.showWanted(numbers);
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    document.documentElement.dataset.ready = "true";
  }

  /** What the address asks for, as #frame=12&return=3456; of what is not stored, the nearest. */
  async showWanted(numbers) {
    const asked = new URLSearchParams(location.hash.slice(1));
    const said = [];
    const choose = (stored, name) => {
      const at = nearestIndex(stored, Number(asked.get(name)));
      if (String(stored[at]) !== asked.get(name)) {
        const instead = at < 0 ? "" : `; this is the nearest, ${name} ${grouped(stored[at])}`;
        said.push(`The page holds no ${name} ${asked.get(name)}${instead}.`);
      }
      return at;
    };
    await this.go(asked.has("frame") ? Math.max(0, choose(numbers, "frame")) : 0);
    if (asked.has("return")) this.pick(choose(this.frame.verdicts.columns.row, "return"));
    if (said.length) this.tell(said.join(" "));
  }

  showWithoutWebGL() {
    byId("no-webgl").hidden = false;
    byId("above").hidden = true;
    for (const element of document.querySelectorAll(".only-webgl")) element.hidden = true;
  }

  listen() {
    byId("theme").addEventListener("click", () => {
      document.documentElement.dataset.theme = this.theme === "dark" ? "light" : "dark";
      this.recolour();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    byId("reset").addEventListener("click", () => this.resetViews());
    byId("between").hidden = !this.isServed;
    if (this.isServed) this.tell("Drag the viewpoint: the scan is judged again.");
    byId("between").addEventListener("click", () => this.startLine());
    document.addEventListener("keydown", (event) => this.key(event));
    mostLines(this.page.frames).forEach((_, k) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `Line ${k + 1}`;
      button.addEventListener("click", () => this.selectStored(k));
      byId("stored").append(button);
    });
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
    if (event.key === " " && event.target.tagName === "BUTTON") return; // the button's own key
    const last = this.page.frames.length - 1;
    const action = {
      " ": () => this.timeline.toggle(),
      ArrowLeft: () => this.timeline.step(-1),
      ArrowRight: () => this.timeline.step(1),
      Home: () => this.go(0),
      End: () => this.go(last),
      Escape: () => this.select(null, -1),
      r: () => this.resetViews(),
      t: () => byId("theme").click(),
    }[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  go(index) {
    this.timeline.pause();
    return this.timeline.go(index);
  }

  /** Show a frame; the selected return is dropped, a stored line stays. */
  async show(index) {
    const frame = await this.frames.at(index);
    if (this.timeline.index !== index) return;
    this.index = index;
    this.frame = frame;
    this.line = this.storedLine(frame);
    this.picked = -1;
    this.places = null;
    this.refresh();
    await this.camera.refresh();
  }

  refresh() {
    this.legend.refresh();
    this.charts.show(this.index);
    this.measures.refresh(this.frame);
    this.selection.refresh();
    this.redraw(false);
    this.camera.draw();
  }

  redraw(isOnlyLayers) {
    for (const view of [this.scan, this.above]) {
      if (isOnlyLayers) view?.draw();
      else view?.refresh();
    }
    if (!this.scan) drawStaticPicture(byId("scan").querySelector("canvas.gl"), this.frame, this.colours);
    if (!isOnlyLayers) this.camera.draw();
  }

  recolour() {
    this.readTheme();
    this.refresh();
  }

  resetViews() {
    for (const view of [this.scan, this.above]) {
      view?.camera.reset();
      view?.draw();
    }
  }

  /** Select the line to a return, or nothing where i is -1. */
  pick(i) {
    if (this.places && i >= 0) {
      this.addPlace(this.frame.verdicts.end(i));
      return;
    }
    this.stored = -1;
    this.select(i < 0 ? null : this.frame.verdicts.line(i), i);
  }

  select(line, i) {
    this.line = line;
    this.picked = i;
    if (!line) this.stored = -1;
    this.selection.refresh();
    this.scan?.refreshLine();
    this.above?.refreshLine();
    this.camera.draw();
  }

  selectStored(k) {
    this.stored = k;
    this.select(this.storedLine(this.frame), -1);
  }

  /** The selected line of `--to` in a frame; null where none is selected, or the frame lacks it. */
  storedLine(frame) {
    const answer = frame.lines[this.stored];
    return answer ? lineOfAnswer(answer) : null;
  }

  startLine() {
    this.places = [];
    this.tell("Click the first end of the line.");
  }

  async addPlace(place) {
    this.places.push(place);
    if (this.places.length < 2) {
      this.tell("Click the other end.");
      return;
    }
    const [start, end] = this.places;
    this.places = null;
    this.tell("");
    try {
      this.select(lineOfAnswer(await askLine(this.frame.number, start, end)), -1);
    } catch (error) {
      this.tell(error.message);
    }
  }

  dragViewpoint(place) {
    this.frame.viewpoint = place;
    this.scan.refreshLayer("viewpoint");
    this.above.refreshLayer("viewpoint");
    this.judge.request(this.frame.number, place);
  }

  afterJudging(index, frame) {
    if (index !== this.index) return;
    if (this.judge.waiting) frame.viewpoint = this.judge.waiting.from; // the pointer is ahead
    const place = frame.viewpoint.map((value) => value.toFixed(1)).join(", ");
    this.tell(`Judged from (${place}); the charts show the viewpoint of the page.`);
    if (this.stored >= 0) this.line = this.storedLine(frame);
    else this.line = this.picked >= 0 ? frame.verdicts.line(this.picked) : null;
    this.refresh();
  }

  tell(message) {
    byId("message").textContent = message;
  }
}

async function start() {
  const content = JSON.parse(byId("page").textContent);
  if (typeof DecompressionStream === "undefined") {
    byId("message").textContent = "This browser is too old for this page: it lacks DecompressionStream.";
    return;
  }
  window.intervis = new Page(content);
  await window.intervis.start();
}

start().catch((error) => {
  byId("message").textContent = `The page cannot be shown: ${error.message}`;
  throw error;
});
