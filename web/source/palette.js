// Colours: those of the style sheet for the theme that holds, and those of craft, readable on either ground.

const NAMES = ["paper", "panel", "ink", "quiet", "line", "grid", "conflict", "zone", "region", "before", "drift", "thrust", "sun",
  "shade", "tube", "lock", "cone-a", "cone-b", "radial", "along", "cross"];
// Sets: formation, then knowledge sets in turn. As in the other pictures.
const SETS = { light: ["#202124", "#009e73", "#c0609a", "#b59b00", "#3a9bd6"], dark: ["#ffffff", "#2cc79b", "#e08cbc", "#f0e442", "#6cc3f5"] };
const [BRIGHT, FAINTEST, LEGIBLE] = [0.26, 0.42, 0.19]; // luminance: on dark 5 to 1; on white lines, and words 4.4 to 1
const LOST = { light: "#9aa0a6", dark: "#7f8790" };

export class Palette {
  constructor(element) {
    const style = getComputedStyle(element);
    for (const name of NAMES) this[name.replace("-", "_")] = style.getPropertyValue(`--${name}`).trim();
    this.dark = luminance(rgb(this.paper)) < 0.2;
  }

  /** Of a craft, lightened on a dark ground, darkened a little on a light one where it would be too faint. */
  craft(colour) {
    return this.dark ? shaded(colour, 1, (light) => light >= BRIGHT) : shaded(colour, 0, (light) => light <= FAINTEST);
  }

  /** Of a craft's name, which is to be read. */
  name(colour) {
    return this.dark ? this.craft(colour) : shaded(colour, 0, (light) => light <= LEGIBLE);
  }

  /** Of a set by its label: -1 lost, 0 the formation, k >= 1 a knowledge set. */
  set(label) {
    const theme = this.dark ? "dark" : "light";
    if (label < 0) return LOST[theme];
    return SETS[theme][label === 0 ? 0 : 1 + ((label - 1) % 4)];
  }
}

/** A colour taken towards black (0) or white (1) until its luminance will do. */
function shaded(colour, goal, enough) {
  let now = rgb(colour);
  for (let k = 0; k < 30 && !enough(luminance(now)); k++) now = now.map((part) => part + 0.08 * (goal - part));
  return hex(now);
}

/** Red, green and blue from 0 to 1 of "#rrggbb". */
export function rgb(colour) {
  return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255);
}

function hex(parts) {
  return `#${parts.map((part) => Math.round(255 * part).toString(16).padStart(2, "0")).join("")}`;
}

function luminance(parts) {
  const [r, g, b] = parts.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
