// Page: its elements and controls, without the drawings in them.

import { button, element } from "./element.js";
import { icon } from "./icon.js";
import { TITLES } from "./strip.js";
import { VIEWS } from "./viewpoints.js";

const KEYS = [["space", "play"], ["← →", "step (Shift: ten)"], ["↑ ↓", "speed"], ["n p", "next, previous event"], ["1 – 9", "follow spacecraft"], ["v", "one view"], ["0", "reset all views"], ["t", "theme"], ["?", "help (Esc closes it)"]];

export class Page {
  constructor(root, scene, does) {
    Object.assign(this, { root, scene });
    const craft = scene.craft.map(({ name }, k) => element("option", { value: k }, name));
    this.follow = element("select", { class: "follow", "aria-label": "Craft to follow", onchange: () => does.follow(Number(this.follow.value)) }, ...craft);
    this.clock = element("strong", { class: "clock" });
    this.fine = element("span", { class: "fine" });
    this.phase = element("span", { class: "phase" });
    this.theme = button(icon("theme"), "Theme", does.theme);
    this.help = button("?", "Help", does.help, { "aria-expanded": "false" });
    const report = scene.report ? [element("a", { href: scene.report, class: "report" }, "Report")] : [];
    const head = element("header", {},
      element("div", { class: "titles" },
        element("h1", { title: scene.title }, scene.title),
        element("p", { class: `verdict ${scene.ok ? "good" : "bad"}`, title: scene.verdict }, scene.verdict)),
      element("div", { class: "now", "aria-live": "off" }, this.phase, this.clock, this.fine),
      element("div", { class: "tools" }, ...report, this.theme, this.help));

    this.space = element("canvas", { class: "space", "aria-hidden": "true" });
    this.over = element("canvas", { class: "over", "aria-hidden": "true" });
    this.panes = Object.fromEntries(VIEWS.map((key) => [key, element("div", { class: `pane ${key}`, tabindex: "0", role: "group" })]));
    this.tools = {};
    for (const [key, pane] of Object.entries(this.panes)) {
      const buttons = [button(icon("home"), "Reset view", () => does.home(key), { class: "home" }), button(icon("alone"), "This view alone", () => does.alone(key))];
      this.tools[key] = element("span", { class: "tools" }, ...(key === "close" ? [this.follow] : []), ...buttons);
      pane.append(this.tools[key]);
    }
    this.views = element("section", { class: "views", "aria-label": "Views" }, this.space, this.over, ...Object.values(this.panes));

    this.play = button(icon("play"), "Play", does.play, { class: "play" });
    this.speed = element("output", { class: "speed", "aria-label": "Speed" });
    const transport = element("div", { class: "transport" },
      button(icon("last"), "Previous event", () => does.event(-1)), button(icon("back"), "Step back", () => does.step(-1)), this.play,
      button(icon("on"), "Step forward", () => does.step(1)), button(icon("next"), "Next event", () => does.event(1)),
      button(icon("slower"), "Slower", () => does.faster(-1)), this.speed, button(icon("faster"), "Faster", () => does.faster(1)));
    this.line = element("div", { class: "line", role: "slider", tabindex: "0", "aria-label": "Time", "aria-valuemin": scene.start, "aria-valuemax": scene.end });
    this.time = element("section", { class: "time", "aria-label": "Time" }, transport, this.line);

    const kinds = Object.keys(TITLES).filter((kind) => scene.series.some((one) => one.kind === kind));
    this.strips = Object.fromEntries(kinds.map((kind) => [kind, element("div", { class: "strip", role: "img", "aria-label": TITLES[kind] })]));
    this.charts = element("section", { class: "charts", "aria-label": "Curves" }, ...Object.values(this.strips));
    if (!kinds.length) this.charts.hidden = true;

    this.side = element("aside", { "aria-label": "Events and legend" });
    this.hint = element("div", { class: "hint", hidden: true });
    this.keys = element("p", { class: "keys", hidden: true }, ...KEYS.map(([key, what]) => element("span", {}, element("kbd", {}, key), ` ${what}`)),
      element("span", {}, "drag: turn; wheel or two fingers: zoom; Shift and drag: move; click on a spacecraft: follow it"));
    root.append(head, this.views, this.time, this.charts, this.side, this.keys, this.hint);
  }

  /** Shows what the button would do. */
  playing(whether) {
    if ((this.play.getAttribute("aria-label") === "Pause") === whether) return;
    this.play.replaceChildren(icon(whether ? "pause" : "play"));
    this.play.setAttribute("aria-label", whether ? "Pause" : "Play");
    this.play.title = whether ? "Pause" : "Play";
  }

  /** A line of words at the pointer; none without text. */
  tell(text, x = 0, y = 0) {
    this.hint.hidden = !text;
    if (!text) return;
    this.hint.textContent = text;
    const wide = this.hint.offsetWidth;
    this.hint.style.left = `${Math.max(4, Math.min(window.innerWidth - wide - 4, x - wide / 2))}px`;
    this.hint.style.top = `${y - this.hint.offsetHeight - 14}px`;
  }

  /** Fills the column beside the views with sections that can be folded. */
  fill(events, legend) {
    const { warnings, pictures } = this.scene;
    const told = warnings.map((line) => element("p", { class: "warning" }, line));
    const links = pictures.map(({ name, title }) => element("li", {}, element("a", { href: encodeURIComponent(name) }, title)));
    this.side.append(
      ...told,
      element("details", { open: true, class: "key" }, element("summary", {}, "Legend"), legend),
      element("details", { open: true, class: "list" }, element("summary", {}, "Events"), events),
      ...(links.length ? [element("details", { class: "key" }, element("summary", {}, "Pictures"), element("ul", { class: "pictures" }, ...links))] : []));
  }
}
