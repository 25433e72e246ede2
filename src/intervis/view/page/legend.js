// Legend and switches: states with their counts, colouring with its scale, layers.

import { LAYERS } from "./layers.js";
import { COLOURINGS } from "./palette.js";
import { grouped } from "./numbers.js";
import { OCCLUDED, STATE_NAMES, UNKNOWN, VISIBLE } from "./verdicts.js";

function chip(className, text, title, isOn, onSwitch) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = `chip ${className}`;
  button.title = title;
  button.setAttribute("aria-pressed", isOn);
  const count = document.createElement("span");
  button.append(text, count);
  button.addEventListener("click", () => {
    const now = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", now);
    onSwitch(now);
  });
  return button;
}

export class Legend {
  /** `onChange(isOnlyLayers)` redraws. */
  constructor(element, state, onChange) {
    this.state = state;
    this.scale = element.querySelector(".scale");
    this.states = new Map();
    for (const at of state.hasStates ? [VISIBLE, OCCLUDED, UNKNOWN] : []) {
      const name = STATE_NAMES[at];
      const made = chip(`state ${name}`, name, `Show or hide ${name} returns`, true, (isOn) => {
        state.shownStates[at] = isOn;
        onChange(false);
      });
      this.states.set(name, made);
      element.querySelector(".states").append(made);
    }
    for (const [name, layer] of Object.entries(LAYERS)) {
      if (!state.hasLayer(name)) continue;
      const made = chip(`layer ${name}`, layer.name, layer.about, state.shownLayers[name], (isOn) => {
        state.shownLayers[name] = isOn;
        onChange(true);
      });
      element.querySelector(".layers").append(made);
    }
    const select = element.querySelector("select");
    for (const [key, { name, ofStates }] of Object.entries(COLOURINGS)) {
      if (state.hasStates || !ofStates) select.append(new Option(name, key));
    }
    select.addEventListener("change", () => {
      state.colouring = select.value;
      this.refresh();
      onChange(false);
    });
  }

  refresh() {
    const { frame, colouring, colours } = this.state;
    for (const [name, made] of this.states) {
      made.lastChild.textContent = ` ${grouped(frame[name])}`;
    }
    const { from, to, unit, name } = COLOURINGS[colouring];
    this.scale.hidden = from === undefined;
    if (this.scale.hidden) return;
    this.scale.querySelector("i").style.background = `linear-gradient(90deg, ${colours.sequential.join(",")})`;
    this.scale.querySelector(".from").textContent = from;
    this.scale.querySelector(".to").textContent = `${to} ${unit}`;
    this.scale.title = name;
  }
}
