// Legend: the meaning of colours and marks; each line switches its layer on or off.

import { element } from "./element.js";

/** The lines of a scene: key of the layer, sign (class of a swatch), text. */
function entries(scene) {
  const has = (kind) => scene.tracks.some((track) => track.kind === kind);
  const when = (which) => scene.conflicts.some((one) => one.when === which);
  const sigmas = [...new Set(scene.tubes.map((tube) => tube.sigmas))].join(", ");
  return [
    ["names", "letters", "spacecraft names", true],
    ["paths", "path", "path, faint in the future", true],
    ["before", "before", "path and spacecraft before avoidance", has("before")],
    ["planned", "planned", "plan before thruster firing", has("planned")],
    ["drifts", "drift", "drift from loss of thrust (✕) to closest approach (◆)", has("drift")],
    ["conflicts", "conflict", when("after") ? "in conflict" : "in conflict before avoidance", scene.conflicts.length > 0],
    ["zones", "zone", "keep-out zone for the centres of other spacecraft", scene.craft.some(({ zone }) => zone >= 0)],
    ["regions", "region", [...new Set(scene.regions.map(({ name }) => name))].join(", "), scene.regions.length > 0],
    ["errors", "tube", `position uncertainty: ${sigmas} sigma`, scene.tubes.length > 0],
    ["cones", "cone", "sensor cones of groups A and B, sun shades", scene.searches.length > 0],
    ["locks", "lock", "in lock now (thick), locked before (dashed)", scene.searches.length > 0],
    ["thrust", "thrust", "thrust (arrow) and impulses (◆)", scene.thrusts.length + scene.burns.length > 0],
    ["grid", "grid", "grid and plumb lines", true],
  ].filter(([, , , needed]) => needed);
}

export class Legend {
  constructor(scene, layers, changed) {
    this.layers = layers;
    this.boxes = new Map();
    const lines = entries(scene).map(([key, sign, words]) => {
      const box = element("input", { type: "checkbox", checked: layers[key] });
      this.boxes.set(key, box);
      box.addEventListener("change", () => {
        layers[key] = box.checked;
        changed();
      });
      return element("label", { class: "layer" }, box, element("span", { class: `swatch ${sign}`, "aria-hidden": "true" }, sign === "letters" ? "Aa" : ""), words);
    });
    this.sets = element("p", { class: "sets" });
    this.element = element("div", { class: "legend" }, ...lines, this.sets);
    this.labels = setLabels(scene);
  }

  /** Ticks the visible layers. */
  show() {
    for (const [key, box] of this.boxes) box.checked = this.layers[key];
  }

  /** Shows the colours of the sets during a search. */
  paint(palette, searching) {
    this.sets.replaceChildren(...(searching ? this.labels : []).map((label) => {
      const dot = element("span", { class: "dot", "aria-hidden": "true" });
      dot.style.background = palette.set(label);
      return element("span", { class: "set" }, dot, label < 0 ? "lost" : label === 0 ? "formation set" : `knowledge set ${label}`);
    }));
  }
}

/** The sets that occur in a scene, lost first. */
function setLabels(scene) {
  const found = new Set();
  for (const { sets } of scene.searches) {
    if (!sets) continue;
    scene.numbers(sets).forEach((label, k) => k % sets.columns && found.add(label));
  }
  return [...found].sort((a, b) => a - b).slice(0, 8);
}

export function layerKeys(scene) {
  return entries(scene).map(([key]) => key);
}
