// Address: time, spacecraft and views after the "#" of the page address, as a link to this state.

import { VIEWS } from "./viewpoints.js";

const LATE = 250; // milliseconds after the last change

/** Content of an address: { t, craft, oblique, top, close, layers }, each if present. */
export function readAddress(hash) {
  const found = {};
  for (const [key, value] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (key === "t" && value !== "" && Number.isFinite(Number(value))) found.t = Number(value);
    else if (key === "craft" || key === "hide" || key === "one") found[key] = value;
    else if (VIEWS.includes(key)) {
      const numbers = value.split(",").map(Number);
      if (numbers.length === 6 && numbers.every(Number.isFinite) && numbers[2] > 0) found[key] = numbers;
    }
  }
  return found;
}

export class Address {
  constructor(said) {
    this.said = said;
    this.written = location.hash;
    this.waiting = null;
  }

  /** Writes the pairs of key and text from `said` after a short delay. */
  write() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      const pairs = this.said().map(([key, value]) => `${key}=${encodeURIComponent(value).replace(/%2C/g, ",")}`);
      this.written = `#${pairs.join("&")}`;
      try {
        history.replaceState(null, "", this.written);
      } catch {
        this.write = () => {}; // a page inside another one has no address of its own
      }
    }, LATE);
  }
}
