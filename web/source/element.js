// Elements of the page: made of a tag, attributes and children; text is text, never HTML.

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** A button with a name for readers who do not see its sign. */
export function button(sign, name, clicked, more = {}) {
  return element("button", { type: "button", "aria-label": name, title: name, onclick: clicked, ...more }, sign);
}

/** Text that is set only where it changes. */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
