// Event list: all events in order of time; a click goes to the event.

import { element } from "./element.js";
import { clock } from "./units.js";

const SIGNS = { stage: "▸", phase: "▹", lock: "●", burn: "◆", conflict: "■", approach: "○", failure: "✕", end: "◼" };

const LONG = 1200; // seconds of a scene from which on times are told without tenths

export class EventList {
  constructor(scene, chosen) {
    this.scene = scene;
    this.rows = scene.events.map((event) =>
      element("button", { type: "button", class: `event ${event.kind} ${event.level}`, onclick: () => chosen(event) },
        element("span", { class: "sign", "aria-hidden": "true" }, SIGNS[event.kind] ?? "·"),
        element("time", {}, clock(event.time, scene.end - scene.start > LONG ? 0 : 1)),
        element("span", { class: "what" }, event.text)));
    this.element = element("ol", { class: "events", "aria-label": "Events" }, ...this.rows.map((row) => element("li", {}, row)));
    this.current = null;
  }

  /** Marks the last event up to a time, and keeps it in sight. */
  mark(time, follow) {
    let last = -1;
    this.scene.events.forEach((event, k) => {
      if (event.time <= time + 1e-6) last = k;
    });
    const row = this.rows[last] ?? null;
    if (row === this.current) return;
    this.current?.removeAttribute("aria-current");
    row?.setAttribute("aria-current", "true");
    this.current = row;
    if (!follow || !row) return;
    const list = this.element;
    const [top, bottom] = [row.offsetTop, row.offsetTop + row.offsetHeight];
    if (top < list.scrollTop || bottom > list.scrollTop + list.clientHeight) list.scrollTop = top - list.clientHeight / 3;
  }
}
