// Charts of lines, for the pages that have them.

const methods = new Map();
const hidden = new Set();
const groups = [];
let singleSeeds = false;

// Methods by name, with colour and dash, and whether they are shown at first.
function knowMethods(known) {
  for (const method of known) {
    methods.set(method.name, method);
    if (!method.shown) hidden.add(method.name);
  }
}

// Path along points; a missing value interrupts it.
function path(points) {
  let text = "";
  let pen = "M";
  for (const point of points) {
    if (point === null) pen = "M";
    else {
      text += `${pen}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
      pen = "L";
    }
  }
  return text;
}

// What runs along the horizontal axis: its label, and how a value of it is said.

const SAMPLES = { label: "collected samples", one: "a number of collected samples", say: (value) => `${value} samples` };
const LEVELS = {
  label: "level of the interval",
  one: "a level",
  say: (value) => `interval of ${+(100 * value).toPrecision(3)} %`,
  diagonal: true,
};

// A chart: lines over such an axis. The charts of a group share scale and cursor.

class Group {
  constructor(axis, { unit, top, across = SAMPLES }) {
    Object.assign(this, { axis, unit, top, across, charts: [], cursor: null });
    groups.push(this);
  }

  draw() {
    for (const chart of this.charts) chart.draw();
  }

  highest() {
    if (this.top) return this.top;
    let most = 0;
    for (const chart of this.charts) {
      for (const line of chart.visible()) {
        const seeds = singleSeeds ? Object.values(line.seeds ?? {}) : [];
        for (const values of [line.mean, line.high, ...seeds]) most = Math.max(most, ...values);
      }
    }
    return most * 1.04 || 1;
  }

  move(cursor, active) {
    this.cursor = cursor;
    for (const chart of this.charts) chart.point(chart === active);
  }
}

class Chart {
  constructor(group, title, lines) {
    this.group = group;
    this.title = title;
    this.lines = lines;
    this.tip = element("div", { class: "tip", "aria-hidden": "true", hidden: "" });
    this.plot = element("div", {
      class: "plot",
      tabindex: "0",
      role: "slider",
      "aria-label": `${title}: values at ${group.across.one}`,
      "aria-valuemin": group.axis[0],
      "aria-valuemax": group.axis.at(-1),
    });
    this.figure = element("figure", {}, element("figcaption", {}, title), this.plot);
    this.plot.addEventListener("pointermove", (event) => this.follow(event));
    this.plot.addEventListener("pointerdown", (event) => this.follow(event));
    this.plot.addEventListener("pointerleave", () => group.move(null));
    this.plot.addEventListener("focus", () => {
      if (group.cursor === null) group.move(group.axis.length - 1, this);
    });
    this.plot.addEventListener("blur", () => group.move(null));
    this.plot.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => {
      if (Math.abs(this.plot.clientWidth - this.width) > 1) this.draw();
    }).observe(this.plot);
    group.charts.push(this);
  }

  visible() {
    return this.lines.filter((line) => !hidden.has(line.method));
  }

  draw() {
    const { axis, unit } = this.group;
    this.width = this.plot.clientWidth || 340;
    const width = this.width;
    const height = Math.round(Math.min(300, Math.max(200, width * 0.62)));
    const box = { left: 44, right: width - 18, top: 10, bottom: height - 36 };
    const top = this.group.highest();
    const span = axis.at(-1) - axis[0] || 1;
    this.x = (value) => box.left + ((value - axis[0]) / span) * (box.right - box.left);
    this.y = (value) => box.bottom - (value / top) * (box.bottom - box.top);
    this.box = box;
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
    for (const value of ticks(0, top, 5)) {
      drawing.append(
        svg("line", { class: "grid", x1: box.left, x2: box.right, y1: this.y(value), y2: this.y(value) }),
        svg("text", { x: box.left - 6, y: this.y(value) + 4, "text-anchor": "end" }, String(+value.toPrecision(6))),
      );
    }
    for (const value of ticks(axis[0], axis.at(-1), width / 70)) {
      drawing.append(svg("text", { x: this.x(value), y: box.bottom + 16, "text-anchor": "middle" }, String(+value.toPrecision(6))));
    }
    if (this.group.across.diagonal) {
      drawing.append(svg("line", { class: "diagonal", x1: this.x(axis[0]), x2: this.x(axis.at(-1)), y1: this.y(axis[0]), y2: this.y(axis.at(-1)) }));
    }
    drawing.append(
      svg("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }),
      svg("text", { class: "label", x: box.right, y: height - 4, "text-anchor": "end" }, this.group.across.label),
      svg("text", { class: "label", x: box.left + 4, y: box.top + 2 }, unit),
    );
    // Bands end at the axes, not at the picture's border, where words stand.
    this.clip = `axes-${groups.indexOf(this.group)}-${this.group.charts.indexOf(this)}`;
    const inside = { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top };
    drawing.append(svg("clipPath", { id: this.clip }, svg("rect", inside)));
    const lines = this.visible();
    for (const line of lines) drawing.append(this.band(line));
    if (singleSeeds) {
      for (const line of lines) {
        for (const [seed, values] of Object.entries(line.seeds ?? {})) {
          drawing.append(this.line(line.method, values, { class: "seed", "data-seed": seed }));
        }
      }
    }
    for (const line of lines) {
      const dash = methods.get(line.method).dash;
      drawing.append(this.line(line.method, line.mean, { class: "line", "stroke-dasharray": dash }));
    }
    this.marks = svg("g");
    drawing.append(this.marks);
    this.plot.replaceChildren(drawing, this.tip);
    this.point(false);
  }

  line(method, values, attributes) {
    const points = values.map((value, i) => (value === null ? null : [this.x(this.group.axis[i]), this.y(value)]));
    const colour = methods.get(method).colour;
    return svg("path", { "data-method": method, d: path(points), colour, ...attributes });
  }

  band(line) {
    const edge = (values, i) => [this.x(this.group.axis[i]), this.y(values[i])];
    let d = "";
    let run = [];
    const close = () => {
      if (run.length > 1) {
        const outline = [...run.map((i) => edge(line.high, i)), ...run.toReversed().map((i) => edge(line.low, i))];
        d += `${path(outline)}Z`;
      }
      run = [];
    };
    line.low.forEach((low, i) => (low === null ? close() : run.push(i)));
    close();
    const colour = methods.get(line.method).colour;
    return svg("path", { class: "band", "data-method": line.method, d, colour, "clip-path": `url(#${this.clip})` });
  }

  // Show the values at the group's cursor: marks on every chart, words on the active one.
  point(active) {
    const at = this.group.cursor;
    this.marks.replaceChildren();
    this.tip.hidden = true;
    const known = at === null ? [] : this.visible().filter((line) => line.mean[at] !== null);
    known.sort((a, b) => b.mean[at] - a.mean[at]);
    const spoken = at === null ? this.group.axis.length - 1 : at;
    this.plot.setAttribute("aria-valuenow", this.group.axis[spoken]);
    this.plot.setAttribute("aria-valuetext", this.words(known, spoken));
    if (at === null) return;
    const x = this.x(this.group.axis[at]);
    this.marks.append(svg("line", { class: "cursor", x1: x, x2: x, y1: this.box.top, y2: this.box.bottom }));
    for (const line of known) {
      const colour = methods.get(line.method).colour;
      this.marks.append(svg("circle", { class: "dot", cx: x, cy: this.y(line.mean[at]), r: 4, colour }));
    }
    if (!active) return;
    const rows = known.map((line) =>
      element(
        "tr",
        {},
        element("td", {}, key(line.method)),
        element("td", {}, line.method),
        element("td", { class: "number" }, shown(line.mean[at])),
        element("td", { class: "number muted" }, interval(line, at)),
      ),
    );
    const heading = `${this.group.across.say(this.group.axis[at])}${this.group.unit ? `, ${this.group.unit}` : ""}`;
    this.tip.replaceChildren(element("strong", {}, heading), element("table", {}, element("tbody", {}, ...rows)));
    this.tip.hidden = false;
    const room = this.width - this.tip.offsetWidth;
    const beside = x > this.width / 2 ? x - this.tip.offsetWidth - 12 : x + 12;
    this.tip.style.left = `${Math.max(0, Math.min(room, beside))}px`;
  }

  words(lines, at) {
    const values = lines.map((line) => `${line.method} ${shown(line.mean[at])} ${interval(line, at)}`.trim());
    return `${this.group.across.say(this.group.axis[at])}: ${values.join("; ")}`;
  }

  follow(event) {
    const x = event.clientX - this.plot.getBoundingClientRect().left;
    let best = 0;
    this.group.axis.forEach((value, i) => {
      if (Math.abs(this.x(value) - x) < Math.abs(this.x(this.group.axis[best]) - x)) best = i;
    });
    this.group.move(best, this);
  }

  key(event) {
    const last = this.group.axis.length - 1;
    const from = this.group.cursor ?? last;
    const targets = {
      ArrowLeft: from - 1,
      ArrowDown: from - 1,
      ArrowRight: from + 1,
      ArrowUp: from + 1,
      PageDown: from - 10,
      PageUp: from + 10,
      Home: 0,
      End: last,
    };
    if (event.key === "Escape") this.group.move(null);
    else if (event.key in targets) this.group.move(Math.max(0, Math.min(last, targets[event.key])), this);
    else return;
    event.preventDefault();
  }
}

function interval(line, at) {
  return line.low[at] === null ? "" : `[${shown(line.low[at])}, ${shown(line.high[at])}]`;
}

// A short piece of a method's line.
function key(method) {
  const { colour, dash } = methods.get(method);
  const stroke = svg("path", { class: "line", d: "M1 6H29", "stroke-dasharray": dash, colour });
  return svg("svg", { class: "key", viewBox: "0 0 30 12", "aria-hidden": "true" }, stroke);
}

// Buttons that hide and show methods; all legends tell the same.
function legend(host, names) {
  for (const name of names) {
    const button = element("button", { type: "button", "data-method": name }, key(name), name);
    press(button, !hidden.has(name));
    button.addEventListener("click", () => {
      if (!hidden.delete(name)) hidden.add(name);
      for (const twin of document.querySelectorAll(".legend button")) {
        press(twin, !hidden.has(twin.dataset.method));
      }
      for (const group of groups) group.draw();
    });
    host.append(button);
  }
}

function methodsOf(lines) {
  const present = new Set(lines.map((line) => line.method));
  return [...methods.keys()].filter((name) => present.has(name));
}

function options(select, titles, chosen, choose) {
  titles.forEach((title, i) => select.append(element("option", { value: i }, title)));
  select.value = chosen;
  select.addEventListener("change", () => choose(Number(select.value)));
  choose(chosen);
}
