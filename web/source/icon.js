// Icons: drawn as lines, since not every machine has letters for them.

const SHAPES = {
  play: "M6 4l13 8-13 8z", pause: "M6 4h4v16H6zM14 4h4v16h-4z", last: "M20 5v14l-10-7zM5 5h3v14H5z", next: "M4 5v14l10-7zM16 5h3v14h-3z",
  back: "M15 5l-8 7 8 7z", on: "M9 5l8 7-8 7z", home: "M12 3l9 8h-3v9h-4v-6h-4v6H6v-9H3z", alone: "M4 4h7v2H6v5H4zM20 20h-7v-2h5v-5h2z",
  slower: "M5 11h14v2H5z", faster: "M11 5h2v6h6v2h-6v6h-2v-6H5v-2h6z",
  theme: "M12 3a9 9 0 1 0 0 18zM12 3a9 9 0 0 1 0 18v-2a7 7 0 0 0 0-14z",
};

export function icon(name) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  made.setAttribute("viewBox", "0 0 24 24");
  made.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", SHAPES[name]);
  made.append(path);
  return made;
}
