// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Elements from code. Text is always put in as text: nothing that comes from the spacecraft can become HTML.

/** h("button.primary", {onclick: f, disabled: true}, "Send", other_element): an element of that tag and classes. */
export function h(tag, attributes = {}, ...children) {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name || "div");
  if (classes.length) element.className = classes.join(" ");
  set_attributes(element, attributes);
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** The same for SVG. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  set_attributes(element, attributes);
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

function set_attributes(element, attributes) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "dataset") Object.assign(element.dataset, value);
    else if (key === "value") element.value = value;
    else element.setAttribute(key, value === true ? "" : value);
  }
}

/** Changes the text only when it differs: an unchanged node costs no layout. */
export function set_text(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function set_class(element, name, on) {
  if (element.classList.contains(name) !== Boolean(on)) element.classList.toggle(name, Boolean(on));
}

/** The symbol of a state. Each has its own shape, so that no meaning hangs on colour alone. */
const shapes = {
  ok: "M8 2a6 6 0 1 0 .01 0z",
  info: "M8 2a6 6 0 1 0 .01 0zM7.2 7h1.6v4.5H7.2zM7.2 4.3h1.6v1.6H7.2z",
  yellow: "M8 1.5 15 14H1zM7.2 6h1.6v4H7.2zM7.2 11h1.6v1.6H7.2z",
  red: "M8 .8 15.2 8 8 15.2.8 8zM7.2 4h1.6v5H7.2zM7.2 10.2h1.6v1.6H7.2z",
  stale: "M8 2a6 6 0 1 0 .01 0zM8 3.5a4.5 4.5 0 1 1-.01 0zM7.3 5h1.4v2.7l2 1.2-.7 1.2-2.7-1.6z",
  wait: "M3 7h2v2H3zM7 7h2v2H7zM11 7h2v2h-2z",
  done: "M6.4 12.6 2 8.2l1.4-1.4 3 3 6.2-6.2L14 5z",
  failed: "M3.4 2 8 6.6 12.6 2 14 3.4 9.4 8l4.6 4.6-1.4 1.4L8 9.4 3.4 14 2 12.6 6.6 8 2 3.4z",
  off: "M8 2a6 6 0 1 0 .01 0zM8 3.6a4.4 4.4 0 1 1-.01 0z",
};
export function shape(kind, label = "") {
  return svg(
    "svg",
    {
      viewBox: "0 0 16 16",
      class: `shape ${kind}`,
      role: label ? "img" : null,
      "aria-label": label || null,
      "aria-hidden": label ? null : "true",
    },
    svg("path", { d: shapes[kind] ?? shapes.off, "fill-rule": "evenodd" }),
  );
}

/** "▲ 3.2 V (yellow)": shape and words of a limit. */
export function limit_shape(limit) {
  return limit === "red" || limit === "yellow" ? shape(limit, limit) : null;
}

/** A panel: heading, and what is below it. */
export function panel(title, ...content) {
  return h("section.panel", { "aria-label": title }, h("h2", {}, title), h("div.body", {}, ...content));
}

/** A table with these headings. */
export function table(kind, headings, body) {
  return h(`table.${kind}`, {}, h("thead", {}, h("tr", {}, ...headings.map((text) => h("th", { scope: "col" }, text)))), body);
}

/** Does @p order and says how it went. */
export async function attempt(order, done) {
  try {
    await order();
    if (done) toast(done);
    return true;
  } catch (error) {
    toast(error.message, "failed");
    return false;
  }
}

/** Focusable rows of a table or list: arrow keys, j and k go up and down. */
export function walk_by_keys(list, selector) {
  list.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, j: 1, ArrowUp: -1, k: -1 }[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea")) return;
    const rows = [...list.querySelectorAll(selector)].filter((row) => row.offsetParent);
    const next = rows[rows.indexOf(event.target.closest(selector)) + step];
    if (!next) return;
    event.preventDefault();
    next.focus();
  });
}

/** A modal dialog. @return it; it is removed when it closes */
export function dialog(title, ...content) {
  const element = h(
    "dialog",
    { "aria-label": title, onclose: () => element.remove(), onclick: (event) => event.target === element && element.close() },
    h(
      "div.dialog",
      {},
      h(
        "header",
        {},
        h("h2", {}, title),
        h("button.quiet", { onclick: () => element.close(), "aria-label": "Close", title: "Close (Esc)" }, shape("failed")),
      ),
      ...content,
    ),
  );
  document.body.append(element);
  element.showModal();
  return element;
}

/** A short message at the edge of the page. */
export function toast(text, kind = "info") {
  const box = document.getElementById("toasts");
  const note = h(`div.toast.${kind}`, {}, shape(kind === "failed" ? "red" : kind), h("span", {}, text));
  box.append(note);
  while (box.children.length > 4) box.firstChild.remove();
  setTimeout(() => note.remove(), kind === "failed" ? 12000 : 5000);
}
