// Address: time, craft and views behind the "#" of the page's address, so that a moment can be sent.

import { VIEWS } from "./viewpoints.js";

const LATE = 250; // milliseconds after the last change

/** What an address says: { t, craft, oblique, top, close, layers } as far as it says anything. */
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

  /** Writes soon what `said` gives, as pairs of key and text. */
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
