"use strict";
// What the pages share. Text reaches a page as text nodes alone, never as markup.

function element(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

function svg(name, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "colour") node.style.setProperty("--colour", value);
    else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

function shown(value) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  // Three significant digits, and none before the point lost.
  const size = Math.abs(Number(value.toPrecision(3)));
  if (size >= 1e7 || size < 1e-3) return value.toExponential(2);
  return value.toFixed(Math.max(0, 2 - Math.floor(Math.log10(size))));
}

function press(button, on) {
  button.setAttribute("aria-pressed", String(on));
}

// Whole steps of 1, 2 or 5 times a power of ten, from low up to high.
function ticks(low, high, about) {
  const rough = (high - low) / about || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((unit) => unit * power).find((one) => one >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * Math.abs(high); k++) found.push(k * step);
  return found;
}

// Headings become buttons that sort: sort(column, up).
function sortBy(headings, sort) {
  headings.forEach((heading, column) => {
    const button = element("button", { type: "button" }, ...heading.childNodes);
    heading.replaceChildren(button);
    button.addEventListener("click", () => {
      const up = heading.getAttribute("aria-sort") !== "ascending";
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      sort(column, up);
    });
  });
}

// Tables whose headings sort their rows.
function sorting() {
  for (const table of document.querySelectorAll("table.sortable")) {
    sortBy([...table.tHead.rows[0].cells], (column, up) => {
      const text = (row) => row.cells[column].textContent;
      const compare = (a, b) => parseFloat(text(a)) - parseFloat(text(b)) || text(a).localeCompare(text(b));
      const rows = [...table.tBodies[0].rows].sort((a, b) => compare(a, b) * (up ? 1 : -1));
      table.tBodies[0].append(...rows);
    });
  }
}

function theme() {
  const root = document.documentElement;
  const button = document.getElementById("theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const dark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  button.hidden = false;
  press(button, dark());
  system.addEventListener("change", () => press(button, dark()));
  button.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    press(button, dark());
  });
}

// Paper has nothing to click: folded parts are printed open.
function printing() {
  const folded = [];
  addEventListener("beforeprint", () => {
    for (const part of document.querySelectorAll("details:not([open])")) {
      part.open = true;
      folded.push(part);
    }
  });
  addEventListener("afterprint", () => {
    while (folded.length) folded.pop().open = false;
  });
}

